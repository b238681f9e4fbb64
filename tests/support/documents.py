"""Pages of Markdown as programs: every block of code and every command in running text is done, or the page is wrong.

A block is, by the language after its fence:

- `sh`: commands, done in order in the page's folder.  `multipendula …` runs in this process, with `> file`,
  `|` into another one, `&&`, and `|| true` after one that is to be refused; `sed …` runs as it is; all else must be one
  of `KNOWN` or a benchmark with flags that it has.
- `console`, and whatever begins with `$ `: commands, each with what it prints, be it done or refused.
- `python`: executed, all blocks of a page in one namespace.
- `text`, or nothing: what the block before it printed, in full; `…` stands for the rest of a line, on a line by itself
  for any lines.
- `toml`: a scene.  `toml fragment`: part of one, completed by `MINIMAL`.
- `json`: parsed.

An indented block is a formula, which neither Python nor TOML can read.  Whatever else there is, is wrong.
"""

from __future__ import annotations

import ast
import io
import json
import os
import re
import shlex
import subprocess
import sys
import tomllib
from collections.abc import Callable, Iterator
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass, field
from pathlib import Path

from markdown_it import MarkdownIt

from modal.scene import parse, scene_from
from multipendula.cli import _parser, main

ROOT = Path(__file__).parents[2]
MINIMAL = {"gravity": 9.81, "pendulum": [{"links": [{"kind": "bob", "mass": 1.0, "length": 1.0}]}]}
KNOWN = {
    "python3 -m venv .venv",
    ". .venv/bin/activate",
    *(
        f"{place}pip install {what}"
        for place in ("", ".venv/bin/", "uv ")
        for what in (".", "-c requirements.lock -e .[dev]")
    ),
    ".venv/bin/pytest",
    "uv venv",
    "uv run --no-sync pytest",
}
"""What other steps of .ci/run do, or an installer does."""

OURS = ("multipendula", ".venv/bin/multipendula", "uv run --no-sync multipendula")
SPOKEN = ("multipendula ", "uv ", "pip install ", "python benchmarks/")
"""How commands begin in running text."""

PROSE = {"toctree", "bibliography", "include", "literalinclude", "grid", "grid-item-card", "figure", "image", "math"}
PROSE |= {"note", "tip", "warning", "admonition", "dropdown", "tab-set", "tab-item"}
"""Directives that hold no code of their own."""


class WrongPageError(AssertionError):
    """A page that does not do what it says, and where."""


@dataclass(frozen=True)
class Block:
    """Something to do: its language (`formula` if indented, `spoken` in running text), what it says, and its line."""

    language: str
    text: str
    line: int


def blocks(text: str, first: int = 1) -> Iterator[Block]:
    """All that a page holds, in its order."""
    for token in MarkdownIt("commonmark").enable("table").parse(text):
        line = first + (token.map[0] if token.map else 0)
        directive = re.match(r"\{([\w-]+)\}", token.info) if token.type == "fence" else None
        if directive and directive[1] in PROSE:
            yield from blocks(token.content, line + 1)
        elif token.type in ("fence", "code_block"):
            yield Block(token.info.strip() if token.type == "fence" else "formula", token.content, line)
        for child in token.children or ():
            if child.type == "code_inline" and child.content.startswith(SPOKEN):
                yield Block("spoken", child.content, line)


@dataclass
class Page:
    """A page being done in the current folder."""

    name: str
    printed: str | None = None
    errors: str = ""
    names: dict[str, object] = field(default_factory=dict)

    def done(self, text: str) -> None:
        """Do all of it; WrongPageError for the first thing that does not work."""
        ways: dict[str, Callable[[str], None]] = {
            **{"sh": self.shell, "console": self.session, "text": self.output, "": self.output},
            **{"spoken": self.spoken, "python": self.python, "json": json.loads, "formula": formula},
            **{"toml": lambda text: parse(text.encode()), "toml fragment": fragment},
        }
        for block in blocks(text):
            if block.language not in ways:
                raise WrongPageError(f"{self.name}:{block.line}: nobody knows how to do {block.language!r}")
            try:
                (self.session if block.text.startswith("$ ") else ways[block.language])(block.text)
            except (Exception, SystemExit) as error:
                raise WrongPageError(f"{self.name}:{block.line}: {type(error).__name__}: {error}") from error

    def session(self, text: str) -> None:
        """Commands after `$ `, each with what it prints."""
        before, *parts = re.split(r"^\$ ", text, flags=re.MULTILINE)
        if before or not parts:
            raise WrongPageError("a session begins with a command, after `$ `")
        for command, _, shown in (part.partition("\n") for part in parts):
            self.shell(command, refused=None)
            self.output(shown)

    def shell(self, text: str, refused: bool | None = False) -> None:
        """The commands of a block; None for `refused` where they may be."""
        self.printed, self.errors = "", ""
        for line in text.replace("\\\n", " ").splitlines():
            words = [os.path.expanduser(os.path.expandvars(word)) for word in tokens(line)]
            wrong = words[-2:] == ["||", "true"]
            for piece in divided(words[: -2 if wrong else None], "&&"):
                self.pipe(piece, wrong or refused)

    def pipe(self, words: list[str], refused: bool | None) -> None:
        """Commands joined by `|`, the last one's output kept, or in a file."""
        target = words.pop() if words[-2:-1] == [">"] else None
        if target:
            words.pop()
        piped = ""
        for command in divided(words, "|"):
            piped = self.command(command, piped, refused)
        if target:
            Path(target).write_text(piped, encoding="utf-8")
        else:
            self.printed = (self.printed or "") + piped

    def command(self, words: list[str], piped: str, refused: bool | None) -> str:
        """What one command prints."""
        line = " ".join(words)
        ours = next((start for start in OURS if line == start or line.startswith(f"{start} ")), None)
        if ours:
            return self.ours(words[len(ours.split()) :], piped, refused)
        if words[0] == "sed":
            return subprocess.run(words, capture_output=True, text=True, check=True).stdout
        if words[0] == "python" and words[1].startswith("benchmarks/"):
            benchmark(Path(words[1]), words[2:])
        elif line not in KNOWN and not extras(line):
            raise WrongPageError(f"nobody knows how to do `{line}`")
        return ""

    def ours(self, words: list[str], piped: str, refused: bool | None) -> str:
        """What this project's command prints; its standard error is stored separately."""
        code, out, err = outcome(words, piped)
        self.errors += err
        if refused is not None and bool(code) != refused:
            raise WrongPageError(f"`multipendula {' '.join(words)}` leaves with {code}: {err}")
        return out

    def spoken(self, text: str) -> None:
        """A command in running text; where it names no scene but SCENE, its words alone are looked at."""
        name, *words = text.split()[1:] or [""]
        vague = not words or any(re.fullmatch(r"[A-Z]{4,}|…", word) for word in (name, *words))
        if not text.startswith("multipendula ") or not vague:
            before = self.printed, self.errors
            self.shell(text)
            self.printed, self.errors = before
            return
        pages = _parser()._subparsers._group_actions[0].choices
        if name != "COMMAND" and name not in pages:
            raise WrongPageError(f"there is no command {name}")
        known = pages.get(name, _parser())._option_string_actions
        if strange := [word for word in words if word.startswith("-") and word.partition("=")[0] not in known]:
            raise WrongPageError(f"{name} has no {', '.join(strange)}")

    def python(self, text: str) -> None:
        """Lines of Python."""
        out = io.StringIO()
        with redirect_stdout(out):
            exec(compile(text, self.name, "exec"), self.names)
        self.printed, self.errors = out.getvalue(), ""

    def output(self, text: str) -> None:
        """What was printed, to standard output or with what went to standard error."""
        if self.printed is None:
            raise WrongPageError("there is nothing before it that prints")
        if not any(agrees(text, printed) for printed in (self.printed, self.printed + self.errors)):
            raise WrongPageError(f"this was printed instead:\n{self.printed}{self.errors}")


OUTCOMES: dict[object, tuple[tuple[object, str, str], dict[str, bytes]]] = {}
"""What commands left, with the files that they wrote, by their words, standard input and the files that they name."""


def outcome(words: list[str], piped: str) -> tuple[object, str, str]:
    """The exit code and what a command prints, which several pages show and one run proves for all of them."""
    line, before = " ".join(words), present()
    asked = (*words, piped, *((name, content) for name, content in before.items() if name in line))
    if asked not in OUTCOMES:
        left = executed(words, piped)
        OUTCOMES[asked] = left, {name: value for name, value in present().items() if before.get(name) != value}
    left, files = OUTCOMES[asked]
    for name, content in files.items():
        Path(name).write_bytes(content)
    return left


def present() -> dict[str, bytes]:
    """The files of the current folder."""
    return {path.name: path.read_bytes() for path in Path().iterdir() if path.is_file()}


def executed(words: list[str], piped: str) -> tuple[object, str, str]:
    """The same, by running it in this process."""
    out, err, before = io.StringIO(), io.StringIO(), sys.stdin
    sys.stdin = io.TextIOWrapper(io.BytesIO(piped.encode()), encoding="utf-8")
    try:
        with redirect_stdout(out), redirect_stderr(err):
            code: object = main(words)
    except SystemExit as ended:
        code = ended.code
    finally:
        sys.stdin = before
    return code, out.getvalue(), err.getvalue()


def tokens(line: str) -> Iterator[str]:
    """The words and signs of a line, without its comment."""
    reader = shlex.shlex(line, posix=True, punctuation_chars="|&>")
    reader.whitespace_split = True
    return iter(reader)


def divided(words: list[str], sign: str) -> Iterator[list[str]]:
    """The words between signs."""
    group: list[str] = []
    for word in [*words, sign]:
        if word != sign:
            group.append(word)
        elif group:
            yield group
            group = []


def agrees(shown: str, printed: str) -> bool:
    """Whether a page shows what was printed, but for trailing blanks and what `…` omits."""
    lines = [line.rstrip() for line in shown.strip("\n").splitlines()]
    pattern = "".join(
        r"(?:.*\n)*" if line.strip() == "…" else re.escape(line).replace("…", ".*") + r"\n" for line in lines
    )
    return bool(re.fullmatch(pattern, "".join(f"{line.rstrip()}\n" for line in printed.strip("\n").splitlines())))


def fragment(text: str) -> None:
    """Part of a scene."""
    scene_from(MINIMAL | tomllib.loads(text))


def formula(text: str) -> None:
    """Nothing that a computer could do."""
    if text.split(maxsplit=1)[0] in {"multipendula", "python", "python3", "pip", "uv", "$", ">>>"}:
        raise WrongPageError("commands stand in a fenced block")
    for language, reader in (("Python", lambda: ast.parse(text)), ("TOML", lambda: tomllib.loads(text))):
        try:
            reader()
        except (SyntaxError, tomllib.TOMLDecodeError):
            continue
        raise WrongPageError(f"{language} stands in a fenced block")


def extras(line: str) -> bool:
    """Whether a line installs extras that there are."""
    match = re.fullmatch(r"pip install \.\[([\w,]+)\]", line)
    there = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    return bool(match) and there.keys() >= set(match[1].split(","))


def benchmark(script: Path, flags: list[str]) -> None:
    """A benchmark that exists, with flags that it has."""
    source = (ROOT / script).read_text(encoding="utf-8")
    known = set(re.findall(r"add_argument\(\s*\"(--[\w-]+)\"", source))
    if strange := {flag for flag in flags if flag.startswith("-")} - known:
        raise WrongPageError(f"{script} has no {', '.join(sorted(strange))}")
