"""Compilation of functions by numba (extra `fast`), and the files in which it keeps what it has compiled.

What is kept saves time and nothing else: a file that is cut, damaged, or that others could have written is dropped, and
the function is compiled anew; where nothing can be written it is compiled in every process.
"""

from __future__ import annotations

import inspect
import os
import pickle
import stat
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path
from textwrap import dedent
from typing import Any

from modal.scene.contents import private

DIGEST = sha256().digest_size
OTHERS_WRITE = 0o022
"""Permissions of others to change a file."""
ANY_ORDER = frozenset({"contract", "nsz", "reassoc"})
"""Of products and sums: contracted, and added up in any order, as vector instructions want it."""


def available() -> bool:
    """Whether numba is installed."""
    return find_spec("numba") is not None


def compiled(function: Any, **options: Any) -> Any:
    """The compiled function, cached on disk where there is a folder for it; the function itself without numba."""
    try:
        from numba import njit
    except ImportError:
        return function
    if _has_place(function):
        with suppress(RuntimeError):
            return _kept(njit(cache=True, error_model="numpy", **options)(function))
    return njit(error_model="numpy", **options)(function)


def _has_place(function: Any) -> bool:
    """Whether numba would keep it beside its source or under an absolute path, not in the folder of the moment."""
    if os.environ.get("NUMBA_CACHE_DIR"):
        return True
    beside = Path(inspect.getfile(function)).parent
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~")
    return os.path.isabs(home) or os.access(beside, os.W_OK)


def _kept(dispatcher: Any) -> Any:
    """A compiled function whose files heal, are private, and are read only if no one else can have written them."""
    file = getattr(getattr(dispatcher, "_cache", None), "_cache_file", None)
    if file is not None:
        file.__class__ = type("KeptFile", (KeptFile, type(file)), {})
    return dispatcher


class KeptFile:
    """What differs from numba's own files of one function, an index and one of data for each of its signatures.

    Both begin with their SHA-256.  A file is opened once, through no link, and what is unpickled are the bytes of that
    descriptor, after its owner and those of the folders above it have been looked at.
    """

    _cache_path: str
    _index_name: str
    _index_path: str
    _source_stamp: Any
    _version: str
    _data_path: Callable[[str], str]
    _dump: Callable[[Any], bytes]

    def load(self, key: Any) -> Any:
        """What is kept under a key, or None; files that cannot be used are removed."""
        try:
            _refuse_open_folders(Path(self._cache_path))
            return super().load(key)  # type: ignore[misc]
        except Exception:
            self._drop()
            return None

    def save(self, key: Any, data: Any) -> None:
        """Keep what was compiled, where that is possible, in a folder that its owner alone writes."""
        try:
            close_to_others(Path(self._cache_path))
            super().save(key, data)  # type: ignore[misc]
        except Exception:
            self._drop()

    def _drop(self) -> None:
        """Remove the files of the function as far as that is possible, and what a killed process left of them."""
        base = self._index_name.removesuffix(".nbi")
        with suppress(OSError):
            for entry in list(os.scandir(self._cache_path)):
                if entry.name.startswith(f"{base}."):
                    with suppress(OSError):
                        os.unlink(entry.path)

    def _load_index(self) -> dict[Any, str]:
        try:
            version, stamp, overloads = pickle.loads(_trusted(self._index_path))
        except FileNotFoundError:
            return {}
        return overloads if (version, stamp) == (self._version, self._source_stamp) else {}

    def _save_index(self, overloads: dict[Any, str]) -> None:
        _write(self._index_path, self._dump((self._version, self._source_stamp, overloads)))

    def _load_data(self, name: str) -> Any:
        return pickle.loads(_trusted(self._data_path(name)))

    def _save_data(self, name: str, data: Any) -> None:
        _write(self._data_path(name), self._dump(data))


def _trusted(path: str) -> bytes:
    """What stands behind the digest of a file; PermissionError where somebody else owns it or may change it."""
    with open(path, "rb", opener=_without_links) as stream:
        status = os.fstat(stream.fileno())
        if not stat.S_ISREG(status.st_mode) or _is_open(status):
            raise PermissionError
        content = stream.read()
    if sha256(content[DIGEST:]).digest() != content[:DIGEST]:
        raise ValueError
    return content[DIGEST:]


def _without_links(path: str, flags: int) -> int:
    return os.open(path, flags | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0))


def _is_open(status: os.stat_result) -> bool:
    """Whether somebody else owns this or may change it; what root owns is the system's."""
    if os.name != "posix":
        return False
    foreign = status.st_uid not in {0, os.geteuid()}
    shared = bool(status.st_mode & stat.S_IWGRP) and not (stat.S_ISDIR(status.st_mode) and _is_private(status.st_gid))
    return foreign or shared or bool(status.st_mode & stat.S_IWOTH)


@cache
def _is_private(group: int) -> bool:
    """Whether a group is root's, or the user's own without other members."""
    import grp
    import pwd

    try:
        me = pwd.getpwuid(os.geteuid())
        return group == 0 or (group == me.pw_gid and set(grp.getgrgid(group).gr_mem) <= {me.pw_name})
    except KeyError:
        return False


def _refuse_open_folders(folder: Path) -> None:
    """PermissionError where others may put another folder or file in the place of one in or above this folder.

    In folders with the sticky bit, such as /tmp, they cannot.
    """
    whole = Path(os.path.abspath(folder))
    real = Path(os.path.realpath(folder))
    for place in dict.fromkeys([whole, *whole.parents, real, *real.parents]):
        status = os.lstat(place)
        link, sticky = (
            stat.S_ISLNK(status.st_mode),
            status.st_mode & stat.S_ISVTX and status.st_uid in {0, os.geteuid()},
        )
        if not sticky and (status.st_uid not in {0, os.geteuid()} if link else _is_open(status)):
            raise PermissionError


def close_to_others(folder: Path) -> None:
    """Take from others the permission to write in a folder of one's own."""
    if os.name == "posix":
        status = os.lstat(folder)
        if stat.S_ISDIR(status.st_mode) and status.st_uid == os.geteuid() and status.st_mode & OTHERS_WRITE:
            os.chmod(folder, stat.S_IMODE(status.st_mode) & ~OTHERS_WRITE)


def _write(path: str, content: bytes) -> None:
    """A whole file with its digest, which its owner alone reads and writes."""
    temporary = f"{path}.tmp.{os.urandom(8).hex()}"
    try:
        with open(temporary, "xb", opener=private) as stream:
            stream.write(sha256(content).digest() + content)
        os.replace(temporary, path)
    except BaseException:
        with suppress(OSError):
            os.unlink(temporary)
        raise


def vectorized(function: Any, **options: Any) -> Any:
    """As `compiled`, with products and sums in ANY_ORDER."""
    return compiled(function, fastmath=set(ANY_ORDER), **options)


def part(function: Any, **options: Any) -> Any:
    """A function for others that are compiled and hold its code: Python cannot call it, and no file is kept of it."""
    try:
        from numba import njit
    except ImportError:
        return function
    options |= {"error_model": "numpy", "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    return njit(**options)(function)


def vectorized_part(function: Any) -> Any:
    """As `part`, with products and sums in ANY_ORDER."""
    return part(function, fastmath=set(ANY_ORDER))


def in_place(function: Any, **options: Any) -> Any:
    """As `vectorized`, for what makes no array of its own but reads and fills those of its caller.

    Their references are not counted, which in small functions takes longer than what they compute.
    """
    return vectorized(function, _nrt=False, **options)


def inner(function: Callable[..., Any], decorator: str) -> str:
    """The source of the functions that a function defines and returns, as functions of a module, each decorated."""
    lines = inspect.getsource(function).splitlines()
    first = next(k for k, line in enumerate(lines) if line.startswith("    def "))
    body = dedent("\n".join(lines[first : len(lines) - 1])).splitlines()
    return "\n".join(f"@{decorator}\n{line}" if line.startswith("def ") else line for line in body)
