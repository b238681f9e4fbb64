"""Reading of complete files: regular files of limited size only.

A device may have no end, and a pipe may have no writer. So a file is checked before it is opened, is opened without
blocking, and is checked again while it is open; no more than the limit is read.

If a file of another kind is given, such as a run for a scene, the message says what it is:

    run.npz: is a run, not a scene: plot and animate take it; a scene is the TOML file that was simulated

The kind is recognized from the first bytes, for an archive from the names of its members; only its header is unpacked.
"""

from __future__ import annotations

import codecs
import os
import re
import sys
from io import BytesIO
from os import PathLike
from stat import S_ISREG
from typing import IO, NamedTuple

from modal.errors import SceneError

MARKS = {
    **{codecs.BOM_UTF32_LE: "utf-32", codecs.BOM_UTF32_BE: "utf-32"},
    **{codecs.BOM_UTF16_LE: "utf-16", codecs.BOM_UTF16_BE: "utf-16"},
}
"""Byte-order marks of encodings, the longer before the shorter that begin alike."""
SHIPPED = os.path.join(os.path.dirname(__file__), "shipped")
BEGINNING_BYTES = 20_000
"""Format: bytes of a text by which its kind is recognized."""
SIGNATURES = (
    (b"\x89PNG", "picture", "a PNG picture"),
    (b"GIF8", "picture", "a GIF picture"),
    (b"\xff\xd8\xff", "picture", "a JPEG picture"),
    (b"%PDF", "picture", "a PDF document"),
    (b"MATLAB 5.0", "model", "a MATLAB file"),
    (b"\x93NUMPY", "arrays", "an array of NumPy"),
)
"""How binary files begin, their kinds, and what they are."""
TEXTS = (
    (r'\A\s*# \{"sha256": "\w*", "multipendula_trajectory"', "run table", "a run"),
    (r'\A\s*# \{"sha256": "\w*", "multipendula_', "run table", "a result saved by multipendula"),
    (r"\A\s*time_s,(theta|ux)_\d+_\d+(_rad)?,([^\n]*,)?(theta|uz)_dot_\d+_\d+_(rad_)?per_s\b", "run table", "a run"),
    (r"(?s)\A\s*(<\?xml.{0,2000}?)?<svg", "picture", "an SVG picture"),
    (r"(?s)\A\s*(<[?!].{0,2000}?)?<robot\b", "robot", "a robot description (URDF)"),
    (r"(?s)\A\s*(<[?!].{0,2000}?)?<mujoco\b", "robot", "a MuJoCo model (MJCF)"),
    (r"(?s)\A\s*(<[?!].{0,2000}?)?<sdf\b", "robot", "a Gazebo model (SDF)"),
    (r"\A\s*<\?xml\b", "xml", "an XML file"),
    (r"(?m)\A([ \t]*(#[^\n]*)?\r?\n)*(import|from) [\w.]+( import .*| as \w+)?$", "script", "a Python script"),
    (r"(?i)\A\s*<(!doctype )?html", "page", "a web page"),
    (r"\A\s*\{\s*[\"}]|\A\s*\[\s*\{\s*\"", "json", "JSON"),
    (r"(?m)^[ \t]*(\[\[?(pendulum|support|force|spring|ground)\]\]?|gravity[ \t]*=)", "scene", "a scene"),
    (r"\A([ \t]*(#[^\n]*)?\r?\n)*[^\n=,;\t]+([,;\t][^\n=,;\t]*)+\n[-+\"\d.]", "table", "a CSV table"),
)
"""How texts begin, their kinds, and what they are; the first that fits."""


class Expected(NamedTuple):
    """The expected content in words, and the kinds of files that may hold it."""

    words: str
    kinds: frozenset[str]
    text: str = ""


EXPECTED = {
    "scene": Expected("a scene", frozenset({"scene"})),
    "table": Expected("a CSV table", frozenset({"table", "run table"}), "CSV text"),
    "report": Expected("a JSON report of fit", frozenset({"json"}), "JSON text"),
    "": Expected("a text file", frozenset(), "text"),
}
OF_RUN = "plot and animate take it; a scene is the TOML file that was simulated"
AS_CSV = "numbers are read from CSV text"
INSTEAD = {
    ("scene", "run"): OF_RUN,
    ("scene", "run table"): OF_RUN,
    ("scene", "table"): "measurements follow a scene, as in `fit SCENE DATA.csv`",
    ("scene", "robot"): "twenty lines of Python make a scene of a chain: “A robot description” in the manual",
    ("scene", "json"): 'scenes are TOML, gravity = 9.81 in place of {"gravity": 9.81}',
    ("scene", "picture"): "give the TOML file of the scene that it shows",
    ("scene", "page"): "give the TOML file of the scene that it shows",
    ("scene", "model"): "give the TOML file of the scene that was exported",
    ("scene", "arrays"): 'a support names such a file, in [support] with kind = "modal" and file = "…"',
    ("table", "run"): "save the run under a name that ends in .csv, and give that file",
    ("table", "scene"): "the scene comes first, then files of measurements, as in `fit SCENE DATA.csv`",
    ("table", "excel"): "save the sheet as CSV, and give that file",
    ("table", "model"): AS_CSV,
    ("table", "arrays"): AS_CSV,
    ("table", "json"): AS_CSV,
    ("table", "picture"): AS_CSV,
    ("table", "page"): AS_CSV,
}
"""Advice if a file of the second kind is given where one of the first is needed."""


class FileKind(NamedTuple):
    """A kind of file, its description in words, and whether it is text."""

    kind: str
    words: str
    is_text: bool = False

    def problem(self, purpose: str) -> str:
        """Return why it is not what was expected, a key of `EXPECTED` or words, and what to give instead."""
        instead = INSTEAD.get((purpose, self.kind), "")
        wanted_kind = EXPECTED[purpose].words if purpose in EXPECTED else purpose
        return f"is {self.words}, not {wanted_kind}{': ' if instead else ''}{instead}"


def recognize(content: bytes) -> FileKind | None:
    r"""Return the kind of a file with this content, None if it cannot be recognized.

    >>> recognize(b"\x89PNG...").problem("scene")
    'is a PNG picture, not a scene: give the TOML file of the scene that it shows'
    """
    for beginning, kind, words in SIGNATURES:
        if content.startswith(beginning):
            return FileKind(kind, words)
    if content[4:8] == b"ftyp":
        return FileKind("picture", "a film")
    if content.startswith(b"PK\x03\x04"):
        return _archive(content)
    text = as_text(content[:BEGINNING_BYTES], errors="replace")
    match = next(((kind, words) for pattern, kind, words in TEXTS if re.search(pattern, text)), None)
    return FileKind(match[0], match[1], is_text=True) if match else None


def as_text(content: bytes, errors: str = "strict") -> str:
    """Decode UTF-8, or UTF-16 or UTF-32 with a byte-order mark, as Windows PowerShell writes it.

    Raise UnicodeDecodeError.
    """
    encoding = next((name for mark, name in MARKS.items() if content.startswith(mark)), "utf-8-sig")
    return content.decode(encoding, errors)


def _archive(content: bytes) -> FileKind | None:
    """What a ZIP archive holds, from the names of its members and the beginning of its header."""
    import zlib
    from zipfile import BadZipFile, ZipFile

    try:
        with ZipFile(BytesIO(content)) as zip_file:
            names = set(zip_file.namelist())
            if "header.npy" in names:
                with zip_file.open("header.npy") as header:
                    header_text = header.read(BEGINNING_BYTES).replace(b"\0", b"")
                if b"multipendula_" in header_text:
                    is_run = b"multipendula_trajectory" in header_text
                    return FileKind("run", "a run") if is_run else FileKind("sweep", "a result saved by multipendula")
    except (BadZipFile, zlib.error, NotImplementedError, RuntimeError, EOFError, OSError, ValueError):
        return FileKind("damaged", "a damaged archive")
    if {"A.npy", "B.npy", "C.npy", "D.npy"} <= names:
        return FileKind("model", "a model")
    if any(name.endswith(".npy") for name in names):
        return FileKind("arrays", "an archive of arrays (NPZ)")
    is_workbook = "[Content_Types].xml" in names
    return FileKind("excel", "an Excel workbook") if is_workbook else FileKind("zip", "a ZIP archive")


FILE_BYTES_MAX = 256_000_000
"""Limit: bytes of a scene, of a file of data, and of the arrays of a support; larger files are refused."""
MEASURED_MIN = 1e-50
"""Limit: sizes of measured numbers, and seconds between them, whose ratios have squares in double precision."""
MEASURED_MAX = 1e50
"""Limit: sizes of measured numbers whose ratios have squares in double precision."""
SIZES_READ = f"its size must be from {MEASURED_MIN:g} to {MEASURED_MAX:g}, or 0"
PIECE_BYTES = 1 << 20
"""Limit: bytes that are read at once: no memory is taken for what is not there, and a heading stands in the first."""


def content_of(path: str | PathLike[str], largest: int = FILE_BYTES_MAX) -> bytes:
    """Return the bytes of a regular file of at most `largest`; raise SceneError, without its name, for any other."""
    return _beginning(path, largest, is_complete=True)


def text_of(path: str | PathLike[str], purpose: str = "") -> str:
    """Return the text of a file; raise SceneError as `content_of` and `decode_text` do."""
    return decode_text(content_of(path), purpose)


def decode_text(content: bytes, purpose: str = "") -> str:
    """Return the text in bytes (`as_text`); raise SceneError if it is not text, or not of the kind `purpose`."""
    kind = recognize(content)
    if kind and (kind.kind not in EXPECTED[purpose].kinds if purpose else not kind.is_text):
        raise SceneError([kind.problem(purpose)])
    try:
        return as_text(content)
    except UnicodeDecodeError as error:
        if purpose == "scene":
            raise SceneError([f"byte {error.start} is not UTF-8 text: save the file as UTF-8"]) from None
        raise SceneError([f"is not a {EXPECTED[purpose].text} file: byte {error.start} is not UTF-8"]) from None


def first_line(path: str | PathLike[str]) -> str:
    """Return the first line of a data file that is not a comment, "" if it cannot be read or has none."""
    try:
        text = as_text(_beginning(path, PIECE_BYTES, is_complete=False), errors="replace")
    except SceneError:
        return ""
    return next((line for line in text.splitlines() if not line.startswith("#")), "")


def read_within_limit(stream: IO[bytes], largest: int = FILE_BYTES_MAX) -> bytes:
    """Return the content of a stream; raise SceneError if it is more than `largest` bytes."""
    pieces, room = [], largest + 1
    while piece := stream.read(min(PIECE_BYTES, room)):
        pieces.append(piece)
        room -= len(piece)
    if not room:
        raise SceneError([f"is larger than {largest} bytes"])
    return b"".join(pieces)


def _beginning(path: str | PathLike[str], largest: int, is_complete: bool) -> bytes:
    if not os.path.exists(path):
        path = _shipped(os.fspath(path)) or path
    try:
        if not S_ISREG(os.stat(path).st_mode):
            raise SceneError(["not a file"])
        with open(path, "rb", opener=_at_once) as stream:
            status = os.fstat(stream.fileno())
            if not S_ISREG(status.st_mode):
                raise SceneError(["not a file"])
            if is_complete and status.st_size > largest:
                raise SceneError([f"is larger than {largest} bytes"])
            return read_within_limit(stream, largest) if is_complete else stream.read(largest)
    except OSError as error:
        if isinstance(error, FileNotFoundError) and _shipped(f"{os.fspath(path)}.toml"):
            raise SceneError(["is a shipped scene, and a data file is needed here"]) from None
        raise SceneError([f"cannot be read: {error.strerror or error}"]) from None
    except ValueError as error:
        if isinstance(error, SceneError):
            raise
        raise SceneError([f"cannot be read: {error}"]) from None


def _shipped(name: str) -> str | None:
    """Where a shipped file of this bare name is."""
    place = os.path.join(SHIPPED, name)
    return place if os.path.basename(name) == name and os.path.isfile(place) else None


def private(path: str, flags: int) -> int:
    """Open a new file that only its owner can read and write, whatever the umask."""
    return os.open(path, flags, 0o600)


def _at_once(path: str, flags: int) -> int:
    """A descriptor, without waiting for the other end if it has become a pipe."""
    return os.open(path, flags | getattr(os, "O_NONBLOCK", 0))


try:
    import fcntl
except ImportError:  # Windows, browsers
    fcntl = None  # type: ignore[assignment]


def lock(stream: IO[bytes]) -> None:
    """Lock an open file for this process until it is closed, if the system supports locks; raise OSError on failure.

    >>> from tempfile import TemporaryFile
    >>> with TemporaryFile() as stream:
    ...     lock(stream)
    """
    if fcntl:
        fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
    elif os.name == "nt":
        import msvcrt

        stream.seek(sys.maxsize // 2)  # a byte that is never read: locked ones cannot be read
        msvcrt.locking(stream.fileno(), msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined]
