"""One command run in this process, and what is wrong with its end."""

from __future__ import annotations

import contextlib
import io
import os
import re
import signal
import sys
import traceback
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from time import perf_counter
from unicodedata import category

from multipendula.cli import main

CODES = {0, 1, 2, 130}
TEMPORARY, JOURNAL = ".multipendula-", ".journal"
LONGEST_MESSAGE = 120  # lines
REFUSED = 2
LOADED = (
    *("control", "flint", "heyoka", "numba", "sympy", "scipy.signal", "scipy.integrate", "scipy.io", "scipy.optimize"),
    *(
        "matplotlib.figure",
        "matplotlib.animation",
        "mpl_toolkits.mplot3d",
        "imageio_ffmpeg",
        "distributed",
        "PIL.Image",
    ),
    *(f"matplotlib.backends.backend_{name}" for name in ("agg", "svg", "pdf")),
)


class OutOfPatienceError(BaseException):
    """A command that exceeds its time limit; nothing in the program may catch it."""


@dataclass(frozen=True)
class Ended:
    """A command's exit code (None where it was not waited for), its output, and all of its faults."""

    words: tuple[str, ...]
    code: int | None
    out: str
    err: str
    faults: tuple[str, ...]
    seconds: float


def run(words: Sequence[str], folder: Path, *, stdin: bytes = b"", patience: float = 20.0, text: bool = True) -> Ended:
    """Run `multipendula WORDS` in a folder; `text` says that standard output is for a terminal."""
    before, began = contents(folder), perf_counter()
    out, err = _stream(), _stream()
    code: int | None = None
    faults: list[str] = []
    with _standing_in(folder, stdin, out, err), _at_most(patience), warnings.catch_warnings():
        try:
            code = main(list(words))
        except SystemExit as end:
            code = end.code if isinstance(end.code, int) else int(end.code is not None)
        except OutOfPatienceError:
            pass
        except BaseException as error:
            where = traceback.extract_tb(error.__traceback__)[-1]
            faults.append(f"{type(error).__name__} at {Path(where.filename).name}:{where.lineno}: {str(error)[:120]}")
    seconds, said, complaint = perf_counter() - began, _read(out), _read(err)
    if code is not None:
        faults += [*wrong_words(code, said if text else "", complaint), *left_behind(before, folder, code)]
    elif not faults:
        faults += left_behind(before, folder, None)
    return Ended(tuple(words), code, said, complaint, tuple(faults), seconds)


def wrong_words(code: int, out: str, err: str) -> Iterator[str]:
    """Faults of an exit code and of the output."""
    if code not in CODES:
        yield f"exit code {code}"
    if "Traceback" in err:
        yield "a traceback"
    if re.search(r"\w+Warning:", err):
        yield f"a warning of Python's: {err.strip().splitlines()[0][:120]}"
    if code and not err.strip():
        yield f"exit code {code} without a word"
    if err.count("\n") > LONGEST_MESSAGE:
        yield f"{err.count(chr(10))} lines of complaint"
    for name, printed in (("output", out), ("error", err)):
        letters = sorted({f"U+{ord(letter):04X}" for letter in printed if unprintable(letter)})
        if letters:
            yield f"{', '.join(letters)} raw on standard {name}"


def unprintable(letter: str) -> bool:
    """Whether a letter controls a terminal instead of being shown: controls, direction marks, line separators."""
    return letter not in "\n\t" and (category(letter) in {"Cc", "Zl", "Zp", "Cs"} or letter in DIRECTIONS)


DIRECTIONS = frozenset("\u061c\u200e\u200f\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069")


def contents(folder: Path) -> dict[str, tuple[int, int]]:
    """Every file below a folder, with its size and when it was written."""
    files = {}
    for path in folder.rglob("*"):
        with contextlib.suppress(OSError):
            if path.is_file():
                status = path.stat()
                files[str(path.relative_to(folder))] = (status.st_size, status.st_mtime_ns)
    return files


def left_behind(before: dict[str, tuple[int, int]], folder: Path, code: int | None) -> Iterator[str]:
    """Temporary files that remain, and any file that a failed command has made or changed."""
    for name, status in contents(folder).items():
        if TEMPORARY in name and name not in before:
            yield f"left {name}"
        elif code == REFUSED and before.get(name) != status and JOURNAL not in name:
            yield f"refused, and yet wrote {name}"


def _stream() -> io.TextIOWrapper:
    return io.TextIOWrapper(io.BytesIO(), encoding="utf-8", errors="backslashreplace", write_through=True)


def _read(stream: io.TextIOWrapper) -> str:
    buffer = stream.buffer
    return buffer.getvalue().decode("utf-8", "replace") if isinstance(buffer, io.BytesIO) else ""


@contextlib.contextmanager
def _standing_in(folder: Path, stdin: bytes, out: io.TextIOWrapper, err: io.TextIOWrapper) -> Iterator[None]:
    home, before = os.getcwd(), sys.stdin
    os.chdir(folder)
    sys.stdin = io.TextIOWrapper(io.BytesIO(stdin))
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            yield
    finally:
        sys.stdin = before
        os.chdir(home)


@contextlib.contextmanager
def _at_most(seconds: float) -> Iterator[None]:
    """Raise OutOfPatienceError in the block after this many seconds of work or ten times as many of waiting.

    Does nothing where the platform has no such alarm.
    """
    if not hasattr(signal, "setitimer"):
        yield
        return

    def ring(*_: object) -> None:
        raise OutOfPatienceError

    alarms = {signal.SIGPROF: (signal.ITIMER_PROF, seconds), signal.SIGALRM: (signal.ITIMER_REAL, 10 * seconds)}
    before = {sign: signal.signal(sign, ring) for sign in alarms}
    for timer, patience in alarms.values():
        signal.setitimer(timer, patience)
    try:
        yield
    finally:
        for sign, (timer, _) in alarms.items():
            signal.setitimer(timer, 0)
            signal.signal(sign, before[sign])


def warm_up() -> None:
    """Load what commands load on first use, so that no time limit expires during it."""
    for name in LOADED:
        with contextlib.suppress(ImportError):
            import_module(name)
