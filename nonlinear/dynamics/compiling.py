"""Compilation of functions by numba (extra `fast`), and the files in which it caches compiled code.

The cache saves time and nothing else: a file that is cut, damaged, or that others could have written is dropped, and
the function is recompiled, as it is where its code or that of anything it calls is another than then; where nothing
can be written it is compiled in every process.  While foreign code is loaded and compiled, Ctrl-C is deferred.
"""

from __future__ import annotations

import inspect
import os
import pickle
import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from contextvars import ContextVar
from errno import EPERM
from functools import cache, cached_property, partial
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path
from stat import S_IMODE, S_ISREG, S_ISVTX, S_IWGRP, S_IWOTH
from textwrap import dedent
from time import monotonic, sleep
from types import CodeType, FunctionType, ModuleType
from typing import IO, Any

from modal.scene.contents import lock, private

DIGEST = sha256().digest_size
OTHERS_WRITE = S_IWGRP | S_IWOTH
"""Permissions of others to change a file."""
LOCK_SECONDS = 120.0
"""Limit: wait for another process to compile, several times the longest compilation; then it compiles itself."""
ANY_ORDER = frozenset({"contract", "nsz", "reassoc"})
"""Of products and sums: contracted, and added up in any order, as vector instructions want it."""
watching: ContextVar[Callable[[], AbstractContextManager[object]]] = ContextVar("watching", default=nullcontext)
"""A block in which numba compiles one function, not one in which it loads from the cache."""
ENDING = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]


def available() -> bool:
    """Whether numba is installed."""
    return find_spec("numba") is not None


def compiled(function: Any) -> Any:
    """The compiled function, cached on disk where there is a folder for it; the function itself without numba."""
    try:
        from numba import njit
    except ImportError:
        return function
    options: dict[str, Any] = {"error_model": "numpy"}
    if _has_place(function):
        with suppress(RuntimeError):
            return _keep_on_disk(_watch_compiler(njit(cache=True, **options)(function)))
    return _watch_compiler(njit(**options)(function))


def _watch_compiler(dispatcher: Any) -> Any:
    """A compiled function, watched while numba compiles it."""
    compiler = dispatcher._compiler
    compiler.compile = partial(_watch, compiler.compile)
    return dispatcher


def _watch(compilation: Callable[..., Any], *signature: Any) -> Any:
    with watching.get()():
        return compilation(*signature)


def _has_place(function: Any) -> bool:
    """Whether numba would keep it next to its source or under an absolute path, not in the folder of the moment."""
    if os.environ.get("NUMBA_CACHE_DIR"):
        return True
    folder = Path(inspect.getfile(function)).parent
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~")
    return os.path.isabs(home) or os.access(folder, os.W_OK)


def _keep_on_disk(dispatcher: Any) -> Any:
    """A compiled function whose files heal, are private, and are read only if no one else can have written them."""
    file = getattr(getattr(dispatcher, "_cache", None), "_cache_file", None)
    if file is not None:
        file.__class__ = type("KeptFile", (KeptFile, type(file)), {})
        file.function = dispatcher
        dispatcher.compile = partial(_compiled_once, dispatcher._cache, file, dispatcher.compile)
    return dispatcher


def _compiled_once(cache: Any, file: Any, compilation: Callable[[Any], Any], signature: Any) -> Any:
    """Compile for a signature, or load what another process is compiling right now."""
    from numba.core.compiler_lock import global_compiler_lock

    with global_compiler_lock:
        with suppress(OSError):
            cache._impl.locator.ensure_cache_path()
        with file.turn():
            return compilation(signature)


def _refuse_foreign(status: os.stat_result, path: str) -> None:
    """PermissionError for a file or folder that somebody else owns or may change.

    A group that has the name of its only member, which many systems give to every user, is nobody else.
    """
    if os.name != "posix":
        return
    loose = status.st_mode & OTHERS_WRITE
    if loose == S_IWGRP and _is_own_group(status.st_gid):
        loose = 0
    if status.st_uid not in {0, os.geteuid()} or loose:
        raise PermissionError(EPERM, "other users can write to this folder", path)


def _is_own_group(number: int) -> bool:
    import grp
    import pwd

    try:
        group, user = grp.getgrgid(number), pwd.getpwuid(os.geteuid()).pw_name
    except KeyError:
        return False
    return group.gr_name == user and set(group.gr_mem) <= {user}


class KeptFile:
    """Differences from numba's own cache files of a function: an index, and one data file for each signature.

    Both begin with the SHA-256 of the rest.
    """

    function: Any
    _has_turn = False
    _cache_path: str
    _index_name: str
    _version: str
    _dump: Callable[[Any], bytes]

    @property
    def _source_stamp(self) -> str:
        """A digest of the source, in place of the date of its file: known only once all that it calls is defined."""
        return self._stamp

    @cached_property
    def _stamp(self) -> str:
        digest = sha256()
        for part in code_of(self.function):
            digest.update(f"{part}\n".encode())
        return digest.hexdigest()

    def load(self, key: Any) -> Any:
        """Return what is cached under a key, or None; unusable files are removed."""
        try:
            return super().load(key)  # type: ignore[misc]
        except Exception:
            self._drop()
            return None

    def save(self, key: Any, data: Any) -> None:
        """Cache compiled code, if possible."""
        try:
            status = os.stat(self._cache_path)
            if os.name == "posix" and status.st_uid == os.geteuid() and status.st_mode & OTHERS_WRITE:
                os.chmod(self._cache_path, S_IMODE(status.st_mode) & ~OTHERS_WRITE)
            super().save(key, data)  # type: ignore[misc]
        except Exception:
            self._drop()

    def _drop(self) -> None:
        """Remove the files of the function as far as that is possible."""
        base = self._index_name.removesuffix(".nbi")
        with suppress(OSError):
            for entry in list(os.scandir(self._folder())):
                if entry.name.startswith(f"{base}."):
                    with suppress(OSError):
                        os.unlink(entry.path)

    @contextmanager
    def turn(self) -> Iterator[None]:
        """A block that one process at a time runs, as far as the platform has locks; none waits longer than that.

        A function that compiles itself for another signature meanwhile has its turn already.
        """
        if self._has_turn:
            yield
            return
        stream = None
        with suppress(OSError):
            flags = os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0)
            path = os.path.join(self._folder(), f"{self._index_name.removesuffix('.nbi')}.lock")
            stream = os.fdopen(os.open(path, flags, 0o600), "rb+")
        end = monotonic() + LOCK_SECONDS
        while stream is not None and monotonic() < end:
            with suppress(OSError):
                lock(stream)
                break
            sleep(0.05)
        self._has_turn = True
        try:
            yield
        finally:
            self._has_turn = False
            if stream is not None:
                stream.close()

    def _folder(self) -> str:
        """The folder without links; PermissionError where somebody else could put another in its place.

        In a folder such as /tmp nobody can move files of others.  Whoever may change the folders of the source has no
        need of this file.
        """
        path = Path(os.path.realpath(self._cache_path))
        trusted_folders = set(Path(os.path.realpath(inspect.getfile(self.function.py_func))).parents)
        for place in [path, *(set(path.parents) - trusted_folders)]:
            status = os.stat(place)
            if place == path or not status.st_mode & S_ISVTX:
                _refuse_foreign(status, str(place))
            elif status.st_uid not in {0, os.geteuid()}:
                raise PermissionError(EPERM, "the folder belongs to another user", str(place))
        return str(path)

    def _content(self, name: str) -> Any:
        """The contents of a file of this folder; the file that is checked is the one that is opened and read."""
        path = os.path.join(self._folder(), name)
        flags = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
        with open(os.open(path, flags), "rb") as stream:
            status = os.fstat(stream.fileno())
            _refuse_foreign(status, path)
            if not S_ISREG(status.st_mode) or status.st_nlink > 1:
                raise PermissionError(EPERM, "not a file of this folder alone", path)
            content = stream.read()
        if sha256(content[DIGEST:]).digest() != content[:DIGEST]:
            raise ValueError
        return pickle.loads(content[DIGEST:])

    def _write(self, name: str, data: Any) -> None:
        content = self._dump(data)
        with self._open_for_write(os.path.join(self._folder(), name)) as stream:
            stream.write(sha256(content).digest() + content)

    def _load_index(self) -> dict[Any, str]:
        try:
            version, stamp, names = self._content(self._index_name)
        except FileNotFoundError:
            return {}
        return names if (version, stamp) == (self._version, self._source_stamp) else {}

    def _save_index(self, names: dict[Any, str]) -> None:
        self._write(self._index_name, (self._version, self._source_stamp, names))

    def _load_data(self, name: str) -> Any:
        return self._content(name)

    def _save_data(self, name: str, data: Any) -> None:
        self._write(name, data)

    @contextmanager
    def _open_for_write(self, path: str) -> Iterator[IO[bytes]]:
        """A file that becomes `path` when the block succeeds, which its owner alone reads and writes."""
        temporary = f"{path}.tmp.{os.urandom(8).hex()}"
        try:
            with open(temporary, "xb", opener=private) as stream:
                yield stream
            os.replace(temporary, path)
        except BaseException:
            with suppress(OSError):
                os.unlink(temporary)
            raise


def code_of(function: Any) -> Iterable[str]:
    """The code of a compiled function and of all that it calls, with their options and the numbers that they read."""
    visits: dict[int, Any] = {}

    def parts(value: Any) -> Iterator[str]:
        if id(value) in visits:
            return
        visits[id(value)] = value
        if hasattr(value, "py_func"):
            yield repr(sorted((name, _words(option)) for name, option in value.targetoptions.items()))
            yield from parts(value.py_func)
        elif isinstance(value, FunctionType):
            yield repr([_words(default) for default in value.__defaults__ or ()])
            yield from lines(value.__code__, value.__globals__)
        elif isinstance(value, ModuleType | type):
            yield f"{value.__name__} {getattr(value, '_fields', '')}"
        else:
            yield _words(value)

    def lines(code: CodeType, space: dict[str, Any]) -> Iterator[str]:
        yield f"{code.co_name} {code.co_code.hex()} {code.co_names} {code.co_varnames} {code.co_argcount}"
        for constant in code.co_consts:
            yield from lines(constant, space) if isinstance(constant, CodeType) else (_words(constant),)
        for name in code.co_names:
            if name in space:
                yield from parts(space[name])

    return parts(function)


def _words(value: Any) -> str:
    """A value in words that are the same in every process."""
    return str(sorted(map(str, value))) if isinstance(value, set | frozenset) else repr(value)


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
    """As `vectorized_part`, for functions that allocate no array but read and fills those of its caller.

    Their references are not counted, which in small functions takes longer than the computation.
    """
    return part(function, fastmath=set(ANY_ORDER), _nrt=False, **options)


@cache
def source_of(function: Callable[..., Any]) -> str:
    """The source of a function, read once."""
    return inspect.getsource(function)


def inner(function: Callable[..., Any], decorator: str) -> str:
    """The source of the functions that a function defines and returns, as functions of a module, each decorated."""
    lines = source_of(function).splitlines()
    first = next(k for k, line in enumerate(lines) if line.startswith("    def "))
    body = dedent("\n".join(lines[first : len(lines) - 1])).splitlines()
    return "\n".join(f"@{decorator}\n{line}" if line.startswith("def ") else line for line in body)


# ------------------------------------------------------------------------------------------------------- Ctrl-C


@contextmanager
def without_interrupts() -> Iterator[None]:
    """A block that Ctrl-C, or another signal that asks the process to end, interrupts only after it completes."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    caught: list[int] = []
    handlers = {number: handler for number in ENDING if callable(handler := signal.getsignal(number))}
    for number in handlers:
        signal.signal(number, lambda number, frame: caught.append(number))
    try:
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
    for number in caught:
        handlers[signal.Signals(number)](number, None)


@contextmanager
def children_without_interrupts() -> Iterator[None]:
    """Processes started in this block never receive Ctrl-C, where the platform permits; this one gets it later."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
