"""Mistakes in TOML: the line, a caret below the place, and a suggested correction.

    line 6: a number has a decimal point, not a comma
        length = 1,5
                  ^
        perhaps: length = 1.5

The parser reports where it stopped.  Every usual mistake is a function that looks at that place and offers a corrected
document; the first by which the parser comes further is the guess.  Then the corrected document is read on, so that one
message has all mistakes.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property

from modal.report.escaping import visible
from modal.report.fitting import breadth

GUESSED_LETTERS_MAX = 50_000
"""Limit: letters of a document from which on a message says what is wrong, and guesses nothing."""
BROKEN_LINES_MAX = 5
"""Limit: broken lines of a document that a message names."""
LINE_LETTERS_MAX = 100
"""Format: letters of a line that are shown."""
SPACE = "    "
PLACE = re.compile(r" \(at (?:line (\d+), column (\d+)|end of document)\)$")
TOKEN = re.compile(
    r"""(?P<text> \"{3}(?s:\\.|[^\\])*?\"{3} | '{3}(?s:.)*?'{3} | "(?:\\.|[^"\\\n])*" | '[^'\n]*' | \#[^\n]* )"""
    r"""| (?P<open> [\[{]) | (?P<close> [\]}]) | (?s:.)""",
    re.VERBOSE,
)
QUOTES = {**dict.fromkeys("“”„‟«»″＂", '"'), **dict.fromkeys("‘’‚‛′‹›", "'")}
LETTERS = {
    **dict.fromkeys("−–—‐‑﹣－", "-"),
    **dict.fromkeys("\xa0\u2007\u202f\u3000", " "),
    "＝": "=",
    "，": ",",
    "．": ".",
}
HEADER = re.compile(r"[ \t]*\[\[?[ \t]*([\w.-]+)[ \t]*\]\]?[ \t]*(#.*)?")
"""The line that begins a table."""
TRUTHS = {
    **dict.fromkeys(("True", "TRUE", "yes", "Yes", "YES", "on", "On", "ON"), "true"),
    **dict.fromkeys(("False", "FALSE", "no", "No", "NO", "off", "Off", "OFF"), "false"),
}
NUMBER = r"[-+]?\d[\d_]*(?:\.\d+)?(?:[eE][-+]?\d+)?"
ENDS = r"(?=[ \t]*(?:$|[,}\]#]))"
"""Lookahead for the end of a value."""


def mistakes_in(document: str, error: Exception) -> list[str]:
    """Return what is wrong with a document that the parser refused with this error."""
    broken: Broken | None = Broken.of(document, error)
    lines: list[str] = []
    for _ in range(BROKEN_LINES_MAX):
        if broken is None:
            break
        guess = broken.guess()
        lines += broken.description(guess)
        broken = guess.broken if guess else None
    return lines


@dataclass(frozen=True)
class Broken:
    """A document, where (from 0) the parser stopped, and why."""

    document: str
    at: int
    why: str

    @classmethod
    def of(cls, document: str, error: Exception) -> Broken:
        """That of an error of the parser."""
        words = str(error)
        place = PLACE.search(words)
        at = len(document)
        if place and place[1]:
            starts = [0, *(newline.end() for newline in re.finditer("\n", document))]
            at = min(starts[int(place[1]) - 1] + int(place[2]) - 1, len(document))
        return cls(document, at, PLACE.sub("", words))

    @cached_property
    def start(self) -> int:
        """Where the line begins in which the parser stopped, or the last one with any text before its end."""
        end = self.at if self.document[self.at :].strip() else len(self.document.rstrip())
        return self.document.rfind("\n", 0, end) + 1

    @cached_property
    def line(self) -> str:
        """That line."""
        return self.document[self.start :].partition("\n")[0]

    @property
    def left(self) -> int:
        """How much of the document is left unread."""
        return len(self.document) - self.at

    @cached_property
    def open_brackets(self) -> list[int]:
        """Where the brackets stand that are open where the parser stopped."""
        stack: list[int] = []
        for token in TOKEN.finditer(self.document, 0, self.at):
            if token["open"]:
                stack.append(token.start())
            elif token["close"] and stack:
                stack.pop()
        return stack

    def with_line(self, line: str) -> str:
        """Return the document with another line in place of this one."""
        return self.document[: self.start] + line + self.document[self.start + len(self.line) :]

    def guess(self) -> Guess | None:
        """Return the first correction that lets the parser continue; None if there is none, or the text is too long."""
        if len(self.document) > GUESSED_LETTERS_MAX:
            return None
        for mistake in MISTAKES:
            for guess in mistake(self):
                if guess.document != self.document and guess.helps(self):
                    return guess
        return None

    def description(self, guess: Guess | None) -> list[str]:
        """The number of the line and what is wrong with it, the line with a caret below, the line as perhaps meant."""
        at = guess.at if guess else self.at
        start = self.document.rfind("\n", 0, at) + 1
        line = self.document[start:].partition("\n")[0]
        number = self.document.count("\n", 0, start) + 1
        words = guess.words if guess else f"broken TOML: {self.why[:1].lower()}{self.why[1:]}"
        first = max(0, min(at - start - LINE_LETTERS_MAX // 2, len(line) - LINE_LETTERS_MAX))
        visible_line, caret = (
            visible(line[first : first + LINE_LETTERS_MAX]),
            breadth(visible(line[first : at - start])),
        )
        lines = [f"line {number}: {words}", f"{SPACE}{visible_line}", f"{SPACE}{' ' * caret}^"]
        corrected_line = guess.line(number) if guess and guess.is_meant else ""
        return (
            [*lines, f"{SPACE}perhaps: {visible(corrected_line)}"]
            if corrected_line and len(corrected_line) <= LINE_LETTERS_MAX
            else lines
        )


@dataclass(frozen=True)
class Guess:
    """A mistake, its description, and the document without it, unless that only skips it."""

    at: int
    words: str
    document: str
    is_meant: bool = True

    @cached_property
    def broken(self) -> Broken | None:
        """Where the parser stops in the corrected document, None if it reads it all."""
        try:
            tomllib.loads(self.document)
        except (ValueError, RecursionError) as error:
            return Broken.of(self.document, error)
        return None

    def helps(self, before: Broken) -> bool:
        """Whether the parser comes further than before."""
        result = self.broken
        if result is None:
            return True
        return result.left < before.left or (before.left == 0 < result.left and result.at > self.at)

    def line(self, number: int) -> str:
        """A line of the corrected document, by its number from 1."""
        return [*self.document.split("\n"), ""][number - 1].strip()


# ---------------------------------------------------------------------------------------------- the usual mistakes


def _replacement(pattern: str, by: str | Callable[[re.Match[str]], str], words: str, mark: int = 0) -> Mistake:
    """The mistake that a pattern finds in the line: the caret stands below the group `mark`.

    All that is found is replaced at first, then each of the first ones alone.
    """

    def mistake(broken: Broken) -> Iterator[Guess]:
        matches = [] if HEADER.fullmatch(broken.line) else list(re.finditer(pattern, broken.line))
        for number, match in enumerate([*matches[:1], *matches[:3]]):
            line = re.sub(pattern, by, broken.line)
            if number:
                replacement = match.expand(by) if isinstance(by, str) else by(match)
                line = broken.line[: match.start()] + replacement + broken.line[match.end() :]
            sentence = words.format(match[0], *match.groups(""))
            yield Guess(broken.start + match.start(mark), sentence, broken.with_line(line))

    return mistake


def _letters(table: dict[str, str], words: str) -> Mistake:
    """The mistake of letters that look like others."""

    def mistake(broken: Broken) -> Iterator[Guess]:
        at = next((k for k, letter in enumerate(broken.line) if letter in table), None)
        if at is not None:
            letter = broken.line[at]
            sentence = words.format(letter.strip() or "a special space", table[letter].strip() or "a plain one")
            line = broken.line.translate({ord(old): new for old, new in table.items()})
            yield Guess(broken.start + at, sentence, broken.with_line(line))

    return mistake


def _repeated_key(broken: Broken) -> Iterator[Guess]:
    """A key that stands twice in its table."""
    if not broken.why.startswith(("Cannot overwrite", "Duplicate")):
        return
    keys = re.findall(r'(?:^|[{,])[ \t]*([\w."-]+)[ \t]*=', broken.line)
    table = broken.document.rfind("\n[", 0, broken.start) + 1
    for key in keys:
        pattern = re.compile(rf"^[ \t]*{re.escape(key)}[ \t]*=", re.MULTILINE)
        earlier = pattern.search(broken.document, table, broken.start)
        if earlier or keys.count(key) > 1:
            number = broken.document.count("\n", 0, earlier.start()) + 1 if earlier else 0
            where = f" in this table, first in line {number}" if earlier else " in this table"
            at = broken.line.rfind(key)
            yield Guess(broken.start + at, f"{key} stands twice{where}", broken.with_line(""))


def _repeated_table(broken: Broken) -> Iterator[Guess]:
    """[pendulum] twice, or next to [[pendulum]]: each of several has two brackets."""
    header = HEADER.fullmatch(broken.line)
    if header is None or not broken.why.startswith(("Cannot declare", "Cannot overwrite", "Cannot mutate")):
        return
    name = re.escape(header[1])
    single = re.compile(rf"^([ \t]*)\[[ \t]*{name}[ \t]*\](?!\])", re.MULTILINE)
    first = single.search(broken.document)
    if first is not None:
        words = f"each of several tables has two brackets: [[{header[1]}]]"
        yield Guess(first.end(1), words, single.sub(rf"\1[[{header[1]}]]", broken.document))
    key = header[1].rpartition(".")[2]
    words = f"{key} is given a second time by this table"
    yield Guess(broken.start, words, broken.with_line(f"[unread-{key}]"), is_meant=False)


def _two_keys(broken: Broken) -> Iterator[Guess]:
    """Two keys in one line outside of braces."""
    if broken.why.startswith("Expected newline") and re.match(r"[\w.-]+[ \t]*=", broken.document[broken.at :]):
        document = broken.document[: broken.at] + "#" + broken.document[broken.at :]
        yield Guess(
            broken.at, "each key has a line of its own, but for those in braces { … }", document, is_meant=False
        )


def _open_header(broken: Broken) -> Iterator[Guess]:
    """[support or [[pendulum] without its end."""
    header = re.match(r"([ \t]*)(\[\[?)[ \t]*([\w.-]+)[ \t]*(\]?\]?)[ \t]*(#.*)?$", broken.line)
    if header and len(header[2]) != len(header[4]):
        for brackets in {header[2]: 0, "[[": 1}:
            line = f"{header[1]}{brackets}{header[3]}{brackets.replace('[', ']')}"
            yield Guess(broken.start + header.end(4), "the brackets of a table come in pairs", broken.with_line(line))


def _lines_in_table(broken: Broken) -> Iterator[Guess]:
    """An inline table over several lines: joined, with the lines that it no longer takes behind it."""
    if not broken.open_brackets or broken.document[broken.open_brackets[-1]] != "{":
        return
    first = broken.open_brackets[0] if broken.document[broken.open_brackets[0]] == "{" else broken.open_brackets[-1]
    end = _closing(broken.document, first)
    inner = broken.document[first:end]
    if not end or "\n" not in inner:
        return
    tokens = (token[0] for token in TOKEN.finditer(inner))
    bare = "".join({"\n": " ", "#": ""}.get(token[:1], token) for token in tokens)
    one_line = re.sub(r",?[ \t]*\}$", " }", re.sub(r"[ \t]{2,}", " ", bare))
    rest, newline, following = broken.document[end:].partition("\n")
    new_document = broken.document[:first] + one_line + rest + newline * (1 + inner.count("\n")) + following
    at = broken.document.find("\n", first)
    yield Guess(at, "a table in braces { … } is written on one line", new_document)


def _closing(document: str, start: int) -> int:
    """The end of the part that a bracket opens, 0 if it is not closed."""
    depth = 0
    for token in TOKEN.finditer(document, start):
        depth += bool(token["open"]) - bool(token["close"])
        if not depth:
            return token.end()
    return 0


def _missing_comma(broken: Broken) -> Iterator[Guess]:
    """No comma between two values."""
    if broken.why.startswith("Unclosed") and broken.open_brackets:
        position = len(broken.document[: broken.at].rstrip())
        if "\n" in broken.document[position : broken.at] and not re.match(r"[{\"'\d+-]", broken.document[broken.at :]):
            return
        new_document = broken.document[:position] + "," + broken.document[position:]
        yield Guess(broken.at, "a comma is missing before this", new_document)


def _open_bracket(broken: Broken) -> Iterator[Guess]:
    """A bracket that is not closed, at the end of whose line it should be."""
    for at in reversed(broken.open_brackets):
        bracket = broken.document[at]
        end = broken.document.find("\n", at) % (len(broken.document) + 1)
        text = re.sub(r"[ \t,]*(#.*)?$", "", broken.document[at:end])
        closing = {"[": "]", "{": " }"}[bracket]
        end_of_text = len(broken.document[: broken.at].rstrip())
        for new_document in (
            broken.document[:at] + text + closing + broken.document[end:],
            broken.document[:end_of_text] + closing + broken.document[end_of_text:],
        ):
            yield Guess(at, f"this {bracket} is not closed", new_document)


def _closing_nothing(broken: Broken) -> Iterator[Guess]:
    """A closing bracket without an opening one."""
    depth = 0
    for token in TOKEN.finditer(broken.document, 0, broken.start + len(broken.line)):
        depth += bool(token["open"]) - bool(token["close"])
        if depth < 0:
            at = token.start()
            yield Guess(at, "this bracket closes nothing", broken.document[:at] + broken.document[at + 1 :])
            return


def _open_string(broken: Broken) -> Iterator[Guess]:
    """A quotation mark that is not closed, after the word or at the end of its line."""
    lines = broken.line
    for mark in ('"', "'"):
        if lines.count(mark) % 2:
            at = lines.rfind(mark)
            for pattern in (r"[\w .()\[\]-]*?(?=[ \t]*(?:$|[,}\]#]))", r"[^#]*?(?=[ \t]*(?:#|$))"):
                if value := re.match(pattern, lines[at + 1 :]):
                    end = at + 1 + value.end()
                    line = lines[:end] + mark + lines[end:]
                    yield Guess(broken.start + at, "this quotation mark is not closed", broken.with_line(line))


def _bare_word(match: re.Match[str]) -> str:
    word = match[2].strip()
    return f'{match[1]}"{word}"' if word not in {"true", "false", "inf", "nan"} else match[0]


def _fraction(match: re.Match[str]) -> str:
    top, bottom = float(match[2]), float(match[3])
    return f"{match[1]}{top / bottom:.15g}" if bottom else match[0]


Mistake = Callable[[Broken], Iterator[Guess]]
VALUE = r"(=[ \t]*|[\[,][ \t]*)"
"""The text before a value."""
KEY = r"(^[ \t]*|[{,][ \t]*)"
"""The text before a key."""
PATH = r"[A-Za-z_][\w.-]*(?:\[\d+\][\w.]*)*"
UNIT = r"(?![eE](?:[-+\d]|$))([A-Za-zµμΩ°%][\w°%/·*^²³ ]*?)"
IN_SI = "a number is written without its unit: all are in SI units, angles in degrees"
SIGNS: tuple[Mistake, ...] = (
    _letters(QUOTES, "{0} is a curly quotation mark: write {1}"),
    _letters(LETTERS, "{0} is not plain text: write {1}"),
    _replacement(rf"(=[ \t]*[-+]?\d+)(,)(\d+){ENDS}", r"\1.\3", "a number has a decimal point, not a comma", 2),
    _replacement(KEY + r'"?([\w-]+)"?[ \t]*(:)(?!=)[ \t]*', r"\1\2 = ", "a key has an equals sign, not a colon", 3),
    _replacement(r"[ \t]*(:=|==)[ \t]*", " = ", "a key has one equals sign", 1),
)
VALUES: tuple[Mistake, ...] = (
    _replacement(
        rf"{VALUE}({'|'.join(TRUTHS)}){ENDS}",
        lambda match: match[1] + TRUTHS[match[2]],
        "truth values are true and false, in small letters",
        2,
    ),
    _replacement(rf"([\w-]+[ \t]*=[ \t]*)(None|none|null|NULL|nil){ENDS}", "", "TOML has no {2}: leave the key out", 2),
    _replacement(
        rf"{VALUE}({NUMBER})[ \t]*/[ \t]*({NUMBER}){ENDS}", _fraction, "a value is a number, not a formula", 2
    ),
    _replacement(r"(?<![\w.])(\.)(\d)", r"0.\2", "a number has a digit before its point", 1),
    _replacement(r"(?<![\w.])(\d+)(\.)(?![\d.\w])", r"\1.0", "a number has a digit after its point", 2),
    _replacement(r"(?<![\w.])(0+)(\d+)", r"\2", "a number begins with no zero", 1),
    _replacement(rf"(=[ \t]*{NUMBER})[ \t]*{UNIT}{ENDS}", r"\1", IN_SI, 2),
)
ENDINGS: tuple[Mistake, ...] = (
    _replacement(r"(;)(?=[ \t]*(?:#|$))", "", "a line ends without a semicolon", 1),
    _replacement(r"(,)(?=[ \t]*(?:#|$))", "", "a line ends without a comma", 1),
    _replacement(r"(?:^|(?<=[ \t]))(//+|--+|/\*|%|;)(?=[^\n]*$)", "#", "a comment begins with #", 1),
)
TEXTS: tuple[Mistake, ...] = (
    _replacement(rf"{VALUE}({PATH})[\"']?{ENDS}", _bare_word, 'text is written in quotation marks: "{2}"', 2),
    _open_string,
    _replacement(r'"((?:[^"\\]|\\.)*\\[^"]*)"', r"'\1'", "a backslash is written between single quotation marks"),
)
BRACKETS: tuple[Mistake, ...] = (
    _lines_in_table,
    _replacement(r"(,)([ \t]*\})", r"\2", "a table in braces ends without a comma", 1),
    _replacement(r"\((.*)\)", r"[\1]", "a list is written in square brackets"),
    _missing_comma,
    _open_bracket,
    _closing_nothing,
)
EQUALS: tuple[Mistake, ...] = (
    _replacement(KEY + r"([\w-]+)[ \t]+(?!=)(\S)", r"\1\2 = \3", "an equals sign is missing", 3),
    _replacement(r"^([ \t]*[\w.-]+[ \t]*=[ \t]*)()(?=#|$)", "", "a value is missing here", 2),
)
TABLES: tuple[Mistake, ...] = (_two_keys, _repeated_table, _repeated_key, _open_header)
MISTAKES = (*SIGNS, *VALUES, *ENDINGS, *TABLES, *TEXTS, *BRACKETS, *EQUALS)
"""The guesses, in the order in which they are tried."""
