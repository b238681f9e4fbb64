"""Compiled code: whether it is loaded in this process or kept on disk, what it still costs, and when that pays.

Compiled code runs many times as fast as what is always there, once it is loaded, which takes fractions of a second, or
compiled, which takes seconds where nothing is kept.  How much is still to come nobody knows: so a process rents until
what it would have saved has paid the price, and then buys, which costs at most twice what foresight would have (Karlin,
Manasse, Rudolph and Sleator, Algorithmica 3, 1988).  What is there already is simply taken where it is faster.
"""

from __future__ import annotations

import atexit
import os
import sys
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field, replace
from errno import EPERM
from functools import cache
from hashlib import sha256
from importlib import metadata
from importlib.util import find_spec
from math import inf, isfinite
from pathlib import Path
from shutil import rmtree
from tempfile import mkdtemp
from time import thread_time
from typing import Any

LOADING = {"numba": 0.15, "heyoka": 0.4}
"""Seconds to load a package."""
LINKING = {"numba": 0.2, "heyoka": 0.1}
"""And code that is kept on disk."""
OWN, OTHERS = 0o700, 0o077
"""Permissions of a folder for its owner alone, and all those of others."""
Forgone = tuple[tuple[str, float], ...]
"""Names of codes, and the share of a run's time that each would have saved."""
_same = ContextVar("_same", default=False)
_made: set[str] = set()
_saved: defaultdict[str, float] = defaultdict(float)


@contextmanager
def reproducible() -> Iterator[None]:
    """A block in which single runs take nothing compiled: choices, and so results to the bit, depend on no process."""
    token = _same.set(True)
    try:
        yield
    finally:
        _same.reset(token)


@cache
def installed(package: str) -> bool:
    """Whether a package is installed."""
    return find_spec(package) is not None


@dataclass(frozen=True)
class Code:
    """What a package compiles, under a name of its own; the seconds that this takes, and how far it is.

    `function` gives numba's, once its module is imported.
    """

    package: str
    name: str
    compiling: float
    loaded: bool = False
    kept: bool = False
    function: Callable[[], Any] = field(default=lambda: None, compare=False, repr=False)

    @property
    def owed(self) -> float:
        """Seconds until it runs in this process; inf where its package is not installed, or runs are reproducible."""
        if _same.get() or not (self.loaded or installed(self.package)):
            return inf
        if self.loaded:
            return 0.0
        return LOADING[self.package] * (self.package not in sys.modules) + self._made

    @property
    def anew(self) -> float:
        """The same in a process that has loaded nothing, on a machine that keeps nothing."""
        return LOADING[self.package] + self.compiling if installed(self.package) else inf

    @property
    def _made(self) -> float:
        return LINKING[self.package] + (0.0 if self.kept else self.compiling)

    @property
    def saved(self) -> float:
        """Seconds that this process would have saved so far, had this been there from the beginning."""
        return _saved[self.name]


@dataclass(frozen=True)
class Offer:
    """A way to run: the seconds that it takes once it is ready, and the code that it needs, if any."""

    running: float
    code: Code | None = None

    @property
    def seconds(self) -> float:
        """What it takes in all."""
        return self.running + (self.code.owed if self.code else 0.0)

    def price(self, *, anew: bool = False) -> float:
        """What it costs to take it: what is owed and not yet paid by what it would have saved; `anew` as in `Code`."""
        if self.code is None:
            return self.running
        return self.running + (self.code.anew if anew else max(self.code.owed - self.code.saved, 0.0))


def best_of(offers: Mapping[str, Offer], *, anew: bool = False) -> str:
    """The name of the way to take."""
    return min(offers, key=lambda name: offers[name].price(anew=anew))


def forgone_by(offers: Mapping[str, Offer], taken: str) -> Forgone:
    """What a run by one way forgoes, by the code of each that would have been faster."""
    least = inf if _same.get() else offers[taken].running
    faster = {each.code: each.running for each in offers.values() if each.running < least and isfinite(least)}
    return tuple((code.name, 1 - running / least) for code, running in faster.items() if code and not code.loaded)


@contextmanager
def rented(forgone: Forgone) -> Iterator[None]:
    """A block that runs without these codes: what it takes is added to what they would have saved."""
    begun = thread_time()
    try:
        yield
    finally:
        lose(forgone, thread_time() - begun)


def lose(forgone: Forgone, seconds: float) -> None:
    """Add what so long a run without these codes has forgone."""
    for name, share in forgone:
        _saved[name] += share * seconds


# ----------------------------------------------------------------------------------------------------- kept on disk


def folder() -> Path:
    """Where kernels, and notes of what heyoka keeps, are kept: a temporary folder where no home is known.

    Relative names in the environment are ignored, as the XDG Base Directory Specification has it.
    """
    homes = [os.environ.get(name, "") for name in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME")]
    homes.append(os.path.join(os.path.expanduser("~"), ".cache"))
    home = next((home for home in homes if os.path.isabs(home)), None)
    return Path(home) / "multipendula" if home else temporary()


def made_private(path: Path) -> Path:
    """A folder that is there and its owner's alone; OSError where it cannot be, or is somebody else's."""
    path.mkdir(mode=OWN, parents=True, exist_ok=True)
    if os.name == "posix":
        status = path.stat()
        if status.st_uid != os.geteuid():
            raise PermissionError(EPERM, "the folder is somebody else's", str(path))
        if status.st_mode & OTHERS:
            path.chmod(OWN)
    return path


@cache
def temporary() -> Path:
    """The one temporary folder of this process, removed when it ends; OSError where there is none."""
    path, process = Path(mkdtemp(prefix="multipendula-")), os.getpid()

    def remove() -> None:
        if os.getpid() == process:
            rmtree(path, ignore_errors=True)

    atexit.register(remove)
    return path


def cached(module: Path, function: str) -> bool:
    """Whether the present version of a compiled function of a module is in numba's cache on disk."""
    home = os.environ.get("NUMBA_CACHE_DIR")
    folder, name = f"{module.parent.name}_*", f"{module.stem}.{function}-*.nbi"
    users = os.path.join(os.path.expanduser("~"), ".cache", "numba")
    places: list[tuple[str | Path, str]] = (
        [(home, folder)] if home else [(module.parent, "__pycache__"), (users, folder)]
    )
    try:
        written = module.stat().st_mtime
        return any(file.stat().st_mtime >= written for at, below in places for file in Path(at).glob(f"{below}/{name}"))
    except OSError:
        return False


def series(name: str, compiling: float) -> Code:
    """Heyoka's code of this name, which heyoka itself keeps on disk; that it does is noted beside the kernels."""
    try:
        kept = _note(name).exists()
    except OSError:
        kept = False
    return Code("heyoka", name, compiling, name in _made, kept)


def made(code: Code) -> Code:
    """The same code, which has just been loaded; it is noted that heyoka keeps it."""
    _made.add(code.name)
    if not code.kept and _keeps():
        try:
            made_private(folder())
            _note(code.name).touch()
        except OSError:
            pass
    return replace(code, loaded=True)


def kept_in(code: Code) -> str:
    """The folder where a code that has run is kept, "" where there is none."""
    if code.package == "heyoka":
        return str(_states().get_diskcache_path()) if _keeps() else ""
    return str(getattr(code.function(), "stats", [""])[0] or "")


def _keeps() -> bool:
    return bool(getattr(_states(), "get_diskcache_enabled", bool)())


def _states() -> Any:
    return getattr(sys.modules.get("heyoka"), "llvm_state", None)


def _note(name: str) -> Path:
    return folder() / f"series_{sha256(f'{_version()} {name}'.encode()).hexdigest()[:20]}.txt"


@cache
def _version() -> str:
    try:
        return metadata.version("heyoka")
    except metadata.PackageNotFoundError:
        return ""
