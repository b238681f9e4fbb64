"""The commands before any answer: the shipped scenes, the schema of a scene file, completion."""

from __future__ import annotations

import argparse
import sys

from multipendula import completion as completing
from multipendula.command import Command
from multipendula.options import offer
from multipendula.parser import Page

SHELLS = ("bash", "zsh", "fish", "powershell")


def scenes(options: argparse.Namespace) -> None:
    """List the shipped scenes, or print one."""
    from modal.scene import files

    if options.name:
        sys.stdout.write(files.example_text(options.name))
        return
    names = files.example_names()
    width = max(map(len, names))
    for name in names:
        print(f"{name:<{width}}  {files.load(name).title}")


def _scenes_arguments(page: Page) -> None:
    name = page.asked.add_argument(
        "name", nargs="?", metavar="NAME", help="print this scene's file, to start one of your own"
    )
    offer(name, completing.names)


def schema(options: argparse.Namespace) -> None:
    """Print the JSON Schema of a scene file."""
    import json

    from modal.scene import files

    print(json.dumps(files.schema(), indent=2))


def _schema_arguments(page: Page) -> None:
    """None."""


def completion(options: argparse.Namespace) -> None:
    """Print what a shell needs to complete this command."""
    from argcomplete.shell_integration import shellcode

    print(shellcode(["multipendula"], shell=options.shell))


def _completion_arguments(page: Page) -> None:
    page.asked.add_argument("shell", choices=SHELLS)


COMMANDS = (
    Command(
        name="scenes",
        topic="look",
        run=scenes,
        arguments=_scenes_arguments,
        details=(
            "Every shipped scene has a name that commands take in place of a file. With a name, its file is printed: a "
            "start for a scene of your own, in TOML and SI units, with angles in degrees from the hanging rest."
        ),
        examples=(
            ("scenes", "names and titles"),
            ("scenes crane-hook", "one of them, to read"),
            ("scenes crane-hook > mine.toml", "the start of a scene of your own"),
        ),
    ),
    Command(
        name="schema",
        topic="look",
        run=schema,
        arguments=_schema_arguments,
        details="Editors that know JSON Schema complete a scene file while it is written and mark what is wrong in it.",
        examples=(
            ("schema > scene.schema.json", "once, beside your scenes"),
            ("scenes crane-hook > mine.toml", "then put `#:schema ./scene.schema.json` in its first line"),
        ),
    ),
    Command(
        name="completion",
        topic="look",
        run=completion,
        arguments=_completion_arguments,
        details=(
            "The shell then completes commands, options, names of scenes, files of the right kind, places of a scene "
            "and words such as those of --show and --measure. Write the lines to a file once and have your shell read "
            "it whenever it starts. It works where `multipendula` itself is found."
        ),
        examples=(
            ("completion bash > ~/.multipendula.bash", "then `. ~/.multipendula.bash` in ~/.bashrc"),
            ("completion zsh > ~/.multipendula.zsh", "then `. ~/.multipendula.zsh` in ~/.zshrc, after compinit"),
            (
                "completion fish > ~/.multipendula.fish",
                "then `source ~/.multipendula.fish` in ~/.config/fish/config.fish",
            ),
            (
                "completion powershell > ~/multipendula.ps1",
                "then `. ~/multipendula.ps1` in the file that $PROFILE names",
            ),
        ),
    ),
)
