"""Files that are read back: a checksum over the whole file, and arrays that are unpacked only if their sizes fit.

The checksum is the SHA-256 of all other bytes of the file.  Text has it as the first key of its initial JSON, an
archive as its last bytes, in the ZIP comment.  Other programs can read both.
"""

from __future__ import annotations

import os
import re
import zlib
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from hashlib import sha256
from io import BytesIO
from math import prod
from typing import IO, Any
from zipfile import BadZipFile, ZipFile, ZipInfo

import numpy as np

from modal.errors import SceneError
from modal.scene.contents import content_of, recognize
from modal.types import Floats

SEALED_BYTES_MAX = 1_500_000_000
"""Limit: bytes of a file, and of its unpacked contents; a larger one is refused."""
KEY = b'"sha256": "'
CHECKSUM_DIGITS = 64
"""Format: hexadecimal digits of SHA-256."""
NPY = re.compile(
    rb"\x93NUMPY\x01\x00.{2}\{'descr': '([<>|][fiU]\d{1,9})', 'fortran_order': (True|False), "
    rb"'shape': \(([\d, ]*)\), \} *\n",
    re.DOTALL,
)
"""The header of an array as written by NumPy; no other is read."""
Source = bytes | str | os.PathLike[str]
"""A file: its bytes, or the path at which it is."""
KINDS = {
    "trajectory": ("run",),
    "sweep": ("sweep", "run"),
    "model": ("model", "json", "arrays"),
    "NPZ file of M, K and points": ("arrays",),
}
"""The kinds of files (`modal.scene.contents`) that a damaged one of these may be taken for."""
UNREADABLE = (
    *(ValueError, KeyError, TypeError, AttributeError, IndexError, EOFError, RecursionError, OverflowError),
    *(NotImplementedError, RuntimeError, BadZipFile, zlib.error),
)


@contextmanager
def reading(source: Source, what: str) -> Iterator[None]:
    """Turn any failure within the block into a SceneError about the file, expected to be a `what` of multipendula."""
    name = f"the {what}" if isinstance(source, bytes) else os.fspath(source)
    try:
        yield
    except SceneError as error:
        raise SceneError([f"{name}: {problem}" for problem in error.problems]) from None
    except UNREADABLE:
        kind = None if isinstance(source, bytes) else recognize(content_of(source))
        if kind and kind.kind.partition(" ")[0] not in (*KINDS.get(what, ()), "damaged"):
            raise SceneError([f"{name}: {kind.problem(f'a {what} saved by multipendula')}"]) from None
        raise SceneError([f"{name}: is incomplete, or is not a {what} saved by this version of multipendula"]) from None


def content(source: Source) -> bytes:
    """Return the bytes of a file; raise SceneError if it is too large or not a regular file."""
    if isinstance(source, bytes):
        return source
    return content_of(source, SEALED_BYTES_MAX)


def _limit_size(size: int) -> None:
    if size > SEALED_BYTES_MAX:
        raise SceneError([f"is larger than {SEALED_BYTES_MAX} bytes"])


def seal(head: bytes, tail: bytes = b"") -> bytes:
    """Return both parts with their checksum between them."""
    checksum = sha256(head)
    checksum.update(tail)
    return b"".join((head, checksum.hexdigest().encode(), tail))


def verify_whole(content: bytes, head_length: int) -> None:
    """Raise ValueError if no checksum follows these bytes, and SceneError if it does not match."""
    checksum_there, others = content[head_length : head_length + CHECKSUM_DIGITS], memoryview(content)
    if not re.fullmatch(rb"[0-9a-f]{%d}" % CHECKSUM_DIGITS, checksum_there):
        raise ValueError
    checksum = sha256(others[:head_length])
    checksum.update(others[head_length + CHECKSUM_DIGITS :])
    if checksum.hexdigest().encode() != checksum_there:
        raise SceneError(["is damaged: its checksum does not match"])


# ----------------------------------------------------------------------------------------------------------- text


def sealed_text(head: str, tail: str) -> bytes:
    """A text in which JSON begins with `head` and continues with `tail`, which is another key."""
    return seal(head.encode() + KEY, b'",' + tail.encode())


def verify_sealed_text(content: bytes, head_text: str) -> None:
    """Raise ValueError or SceneError if a text was not made by `sealed_text` with the same `head_text`."""
    head = head_text.encode() + KEY
    if not content.startswith(head):
        raise ValueError
    verify_whole(content, len(head))


# --------------------------------------------------------------------------------------------------------- arrays


def archive(arrays: Mapping[str, Any]) -> bytes:
    """Return the bytes of an .npz file; raise SceneError if it would be too large to be read."""
    _limit_size(sum(np.asarray(values).nbytes for values in arrays.values()))
    stream = BytesIO()
    np.savez_compressed(stream, **arrays)
    with ZipFile(stream, "a") as zip_file:
        zip_file.comment = b"0" * CHECKSUM_DIGITS
    return seal(stream.getvalue()[:-CHECKSUM_DIGITS])


def unpack(content: bytes, names: Collection[str] | None = None) -> dict[str, Any]:
    """Return the arrays of an .npz file made by `archive`; exactly those in `names` if given.

    Nothing is unpacked before the checksum, all sizes and all names have been checked.
    """
    verify_whole(content, len(content) - CHECKSUM_DIGITS)
    with ZipFile(BytesIO(content)) as zip_file:
        members = {member.filename.removesuffix(".npy"): member for member in zip_file.infolist()}
        _limit_size(sum(member.file_size for member in members.values()))
        if len(members) != len(zip_file.infolist()) or (names is not None and members.keys() != set(names)):
            raise ValueError
        return {name: _array(zip_file, member) for name, member in members.items()}


def members_of(zip_file: ZipFile, names: Collection[str], largest: int) -> dict[str, Any]:
    """Return those of these arrays that are in an .npz file, up to a total size; nothing is unpickled."""
    members = {member.filename.removesuffix(".npy"): member for member in zip_file.infolist()}
    wanted_members = {name: members[name] for name in names if name in members}
    if sum(member.file_size for member in wanted_members.values()) > largest:
        raise SceneError([f"has arrays of more than {largest} bytes"])
    return {name: _array(zip_file, member) for name, member in wanted_members.items()}


def _array(zip_file: ZipFile, member: ZipInfo) -> Any:
    with zip_file.open(member) as stream:
        head = _head(stream)
        match = NPY.fullmatch(head)
        if not match:
            raise ValueError
        kind, shape = np.dtype(match[1].decode()), tuple(int(size) for size in re.findall(rb"\d+", match[3]))
        if kind.itemsize * prod(shape) != member.file_size - len(head):
            raise ValueError
        return np.ndarray(shape, kind, bytearray(stream.read()), order="F" if match[2] == b"True" else "C")


def _head(stream: IO[bytes]) -> bytes:
    """The length of an array's header is in its bytes 8 and 9."""
    start = stream.read(10)
    return start + stream.read(int.from_bytes(start[8:], "little"))


# ------------------------------------------------------------------------------------------------------- contents


def require_keys(mapping: dict[str, Any], *names: str) -> None:
    """Raise ValueError for a mapping with other keys than these."""
    if mapping.keys() != set(names):
        raise ValueError


def finite_array(numbers: object, *shape: int) -> Floats:
    """Return numbers of this shape; raise ValueError for another shape and for values that are not finite numbers."""
    values = np.asarray(numbers)
    if values.dtype.kind not in "fi" or values.shape != shape or not np.all(np.isfinite(values)):
        raise ValueError
    return values.astype(float, copy=False)


def index(number: object, size: int) -> int:
    """Return an integer from 0 to below `size`; raise ValueError for anything else, including True and False."""
    if type(number) is not int or not 0 <= number < size:
        raise ValueError
    return number
