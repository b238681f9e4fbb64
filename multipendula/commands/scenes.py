"""The commands to get started: the shipped scenes and the schema of a scene file; shell completion."""

from __future__ import annotations

import argparse

import modal
from multipendula.command import Command, Option, argument, text_file
from multipendula.commands.shared import is_new, output
from multipendula.completion import names
from multipendula.flags import ASIDE, Flag

SHELLS = ("bash", "zsh", "fish", "powershell")


def scenes(options: argparse.Namespace) -> None:
    """List the shipped scenes, print one of them, or the JSON Schema of a scene file.

    Commands accept the name of a shipped scene in place of a file. With a name, its file is printed, as a template
    for a scene of your own: TOML, SI units, angles in degrees from the downward vertical. With the schema, editors
    complete scene files and mark mistakes in them: put `#:schema ./scene.schema.json` in the first line.

    Examples
    --------
    scenes
        names and titles
    scenes crane-hook
        the file of one scene
    scenes crane-hook -o mine.toml
        a template for a scene of your own
    scenes --schema -o scene.schema.json
        for editors, once in the folder of your scenes
    """
    from modal.report import as_json, folded
    from modal.scene import files

    if options.schema and options.name:
        raise modal.SceneError([f"{options.name}: the schema is that of every scene: omit the name or --schema"])
    if is_new(options.output):
        kinds = ("json", "txt") if options.schema else ("toml", "txt") if options.name else ("txt",)
        files.kind_of(options.output, kinds, "-o ")
    names = files.example_names()
    width = max(map(len, names))
    with output(options.output) as write:
        if options.schema:
            write(as_json(files.schema()))
            return
        if options.name:
            write(files.example_text(options.name))
            return
        for name in names:
            write(folded(f"{name:<{width}}  {files.load(name).title}") + "\n")


def completion(options: argparse.Namespace) -> None:
    """Print the script with which a shell completes this command.

    The shell then completes commands, options, names of scenes, files of the right kind, places in a scene and
    values such as those of --show and --measure. Write the script to a file once and have your shell source it at
    startup. It needs `multipendula` to be on the PATH.

    Examples
    --------
    completion bash -o ~/.multipendula.bash
        then `. ~/.multipendula.bash` in ~/.bashrc
    completion zsh -o ~/.multipendula.zsh
        then `. ~/.multipendula.zsh` in ~/.zshrc, after compinit
    completion fish -o ~/.multipendula.fish
        then `source ~/.multipendula.fish` in ~/.config/fish/config.fish
    completion powershell -o "$HOME/multipendula.ps1"
        then `. $HOME/multipendula.ps1` in the file that $PROFILE names
    """
    from argcomplete.shell_integration import shellcode

    with output(options.output) as write:
        write(shellcode(["multipendula"], shell=options.shell) + "\n")


COMMANDS = (
    Command(
        topic="look",
        run=scenes,
        main=("--schema", "--output"),
        takes=(argument("name", "NAME", "print this scene's file", names, nargs="?"), "--schema", *text_file()),
    ),
    Command(
        topic=ASIDE,
        run=completion,
        main=("--output",),
        takes=(Option("shell", Flag("SHELL", "bash, zsh, fish or powershell", choices=SHELLS)), *text_file()),
    ),
)
