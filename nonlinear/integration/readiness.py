"""Compiled code: whether it is loaded in this process or cached on disk, its remaining cost, and when that pays off.

Compiled code runs many times as fast as interpreted code, once it is loaded, which takes fractions of a second, or
compiled, which takes seconds where nothing is cached.  Future demand is unknown: so a process rents until
the lost savings equal the price, and then buys, at a cost of at most twice that with foresight
[Karlin1988].  Code that is ready is simply used where it is faster.
"""

from __future__ import annotations

import atexit
import json
import os
import sys
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from contextvars import ContextVar
from dataclasses import astuple, dataclass, field
from errno import EPERM
from functools import cache, partial
from hashlib import sha256
from importlib.util import find_spec
from math import inf, isfinite
from pathlib import Path
from shutil import rmtree
from stat import S_IRWXG, S_IRWXO, S_IRWXU
from tempfile import mkdtemp
from threading import Event, Thread
from time import perf_counter, thread_time
from typing import Any

from modal.scene import whole_file
from modal.scene.contents import private
from nonlinear.dynamics import without_interrupts
from nonlinear.dynamics.compiling import watching

LOADING = {"numba": 0.15, "heyoka": 0.4}
"""Seconds to load a package."""
LINKING = {"numba": 0.2, "heyoka": 0.1}
"""And code that is cached on disk."""
PROGRESS_DELAY = 0.5
"""Cost: seconds until compiling is shown on a terminal, and between two updates."""
Forgone = tuple[tuple[str, float], ...]
"""Names of codes, and the share of a run's time that each would have saved."""
_reproducible_share = ContextVar("_same", default=0.0)
_ready: set[str] = set()
_compile_seconds: defaultdict[str, float] = defaultdict(float)
_saved_seconds: defaultdict[str, float] = defaultdict(float)


@contextmanager
def reproducible(runs: int = 0) -> Iterator[None]:
    """Make choices, and so results to the bit, independent of the process within the block.

    Single runs take nothing compiled, or pay one part of this many `runs` of its cost where nothing is ready.
    """
    token = _reproducible_share.set(max(_reproducible_share.get(), 1 / runs if runs else inf))
    try:
        yield
    finally:
        _reproducible_share.reset(token)


@cache
def has_package(package: str) -> bool:
    """Whether a package is installed."""
    return find_spec(package) is not None


@dataclass(frozen=True)
class Code:
    """Compiled code of a package under its own name; its compile time (s) and state.

    `function` gives numba's, once its module is imported; `expected` are the seconds before anything was measured,
    `words` its name.
    """

    package: str
    name: str
    compiling: float
    is_ready: bool = False
    kept: bool = False
    function: Callable[[], Any] = field(default=lambda: None, compare=False, repr=False)
    expected_seconds: float = 0.0
    words: str = "code"

    @property
    def owed(self) -> float:
        """Seconds until it runs in this process; inf if its package is not installed, or runs are reproducible."""
        if share := _reproducible_share.get():
            return self.anew * share
        if not (self.is_ready or has_package(self.package)):
            return inf
        if self.is_ready:
            return 0.0
        loading = 0.0 if self.package in sys.modules else LOADING[self.package]
        return loading + LINKING[self.package] + (0.0 if self.kept else self.compiling)

    @property
    def anew(self) -> float:
        """The same in a process that has loaded nothing, on a machine that keeps nothing and has measured nothing."""
        return LOADING[self.package] + self.expected_seconds if has_package(self.package) else inf

    @property
    def saved_seconds(self) -> float:
        """Seconds that this process would have saved so far, had this been there from the beginning."""
        return _saved_seconds[self.name]


@dataclass(frozen=True)
class Offer:
    """A way to run: the seconds that it takes once it is ready, and the code that it needs, if any."""

    running: float
    code: Code | None = None

    @property
    def seconds(self) -> float:
        """The total time."""
        return self.running + (self.code.owed if self.code else 0.0)

    def price(self, *, anew: bool = False) -> float:
        """The cost of using it: its price less the savings lost so far; `anew` as in `Code`."""
        if self.code is None:
            return self.running
        return self.running + (self.code.anew if anew else max(self.code.owed - self.code.saved_seconds, 0.0))


def best_of(offers: Mapping[str, Offer], *, anew: bool = False) -> str:
    """Return the name of the best offer."""
    return min(offers, key=lambda name: offers[name].price(anew=anew))


def forgone_by(offers: Mapping[str, Offer], way: str) -> Forgone:
    """The saving that a run by one way forgoes, by the code of each that would have been faster."""
    shortest = inf if _reproducible_share.get() else offers[way].running
    faster = {offer.code: offer.running for offer in offers.values() if offer.running < shortest and isfinite(shortest)}
    return tuple((code.name, 1 - running / shortest) for code, running in faster.items() if code and not code.is_ready)


@contextmanager
def rent(forgone: Forgone) -> Iterator[None]:
    """A block that runs without these codes: its time is added to the savings they would have made."""
    start = thread_time()
    try:
        yield
    finally:
        lose(forgone, thread_time() - start)


def lose(forgone: Forgone, seconds: float) -> None:
    """Add the saving that a run of this length without these codes has forgone."""
    for name, share in forgone:
        _saved_seconds[name] += share * seconds


# ----------------------------------------------------------------------------------------------------- kept on disk


def folder() -> Path:
    """Where kernels, and notes on heyoka's cache, are stored: a temporary folder where no home is known.

    Relative names in the environment are ignored, as the XDG Base Directory Specification has it.
    """
    homes = [os.environ.get(name, "") for name in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME")]
    homes.append(os.path.join(os.path.expanduser("~"), ".cache"))
    home = next((home for home in homes if os.path.isabs(home)), None)
    return Path(home) / "multipendula" if home else temporary()


def made_private(path: Path) -> Path:
    """A folder that is there and its owner's alone; raise OSError if it cannot be, or is somebody else's."""
    path.mkdir(mode=S_IRWXU, parents=True, exist_ok=True)
    if os.name == "posix":
        status = path.stat()
        if status.st_uid != os.geteuid():
            raise PermissionError(EPERM, "the folder belongs to another user", str(path))
        if status.st_mode & (S_IRWXG | S_IRWXO):
            path.chmod(S_IRWXU)
    return path


@cache
def temporary() -> Path:
    """The one temporary folder of this process, removed when it ends; raise OSError if there is none."""
    path, process = Path(mkdtemp(prefix="multipendula-")), os.getpid()

    def remove() -> None:
        if os.getpid() == process:
            rmtree(path, ignore_errors=True)

    atexit.register(remove)
    return path


@dataclass(frozen=True)
class Note:
    """The note on code once it has run: the seconds that it took to compile, over those expected at first.

    `kept` is the file or the folder in which its package keeps it, "" where it does not.
    """

    seconds: float = 0.0
    share: float = 1.0
    kept: str = ""

    @classmethod
    def of(cls, name: str) -> Note | None:
        """The note under a name, if it can be read."""
        try:
            seconds, share, kept = json.loads(_path_of(name).read_bytes())
            return cls(float(seconds), float(share), str(kept))
        except (OSError, ValueError, TypeError):
            return None

    def write(self, name: str) -> None:
        """Note it where that is possible."""
        with suppress(OSError):
            made_private(folder())
            with whole_file(_path_of(name), opener=private) as stream:
                stream.write(json.dumps(astuple(self)).encode())


def _path_of(name: str) -> Path:
    return folder() / f"note_{sha256(name.encode()).hexdigest()[:20]}.json"


def _note_name(package: str, name: str) -> str:
    """The name of a note on the code compiled by this version of a package."""
    return f"{package} {_version(package)} {name}"


@cache
def _version(package: str) -> str:
    if not has_package(package):
        return ""
    from importlib import metadata

    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return ""


def look_up(
    package: str, name: str, expected_seconds: float, words: str, function: Callable[[], Any] = lambda: None
) -> Code:
    """Code of this name, as far as this process knows it, or the notes next to the kernels.

    Compiling takes as long as it took here last; where it never did, as much longer than `expected_seconds` (s) as what
    the package compiled last.
    """
    if name in _ready:
        return Code(package, name, expected_seconds, True, False, function, expected_seconds, words)
    note, last = Note.of(_note_name(package, name)), Note.of(package)
    seconds = note.seconds if note and note.seconds else expected_seconds * (last.share if last else 1.0)
    is_kept = bool(note and note.kept and os.path.exists(note.kept))
    return Code(package, name, seconds, False, is_kept, function, expected_seconds, words)


@contextmanager
def make_ready(code: Code) -> Iterator[Callable[[], AbstractContextManager[object]]]:
    """A block in which code is loaded or compiled, which Ctrl-C ends only afterwards, and the note on it.

    It gets a block to compile in, which a terminal sees; numba takes that itself.
    """
    if code.name in _ready:
        yield nullcontext
        return
    compiles = partial(_compiles, code)
    token = watching.set(compiles)
    try:
        with without_interrupts():
            yield compiles
    finally:
        watching.reset(token)
    if code.name in _ready:
        return
    _ready.add(code.name)
    took, path = compiled_in(code), _kept_at(code)
    if took or (path and not code.kept):
        Note(took, took / code.expected_seconds if took else 1.0, path).write(_note_name(code.package, code.name))
    if took:
        Note(took, took / code.expected_seconds).write(code.package)


def compiled_in(code: Code) -> float:
    """The seconds in which this process has compiled it, 0 if it was loaded or not needed."""
    return _compile_seconds[code.name]


@contextmanager
def _compiles(code: Code) -> Iterator[None]:
    """A block that compiles a part of it."""
    start = perf_counter()
    with progress(f"compiling {code.words}", code.compiling, _compile_seconds[code.name]):
        yield
    _compile_seconds[code.name] += perf_counter() - start


@contextmanager
def progress(title: str, seconds: float, seconds_before: float = 0.0) -> Iterator[None]:
    """A block that takes about this many seconds, as a terminal sees."""
    if not sys.stderr.isatty():
        yield
        return
    from tqdm import tqdm

    start, end = perf_counter() - seconds_before, Event()
    form = f"{title}, about {seconds:.0f} s |{{bar:24}}| {{elapsed}} passed"
    with tqdm(total=seconds, delay=PROGRESS_DELAY, leave=False, bar_format=form) as bar:
        bar.start_t -= seconds_before

        def tick() -> None:
            while not end.wait(PROGRESS_DELAY):
                bar.n = min(perf_counter() - start, seconds)
                bar.refresh()

        clock = Thread(target=tick, daemon=True)
        clock.start()
        try:
            yield
        finally:
            end.set()
            clock.join()


def kept_in(code: Code) -> str:
    """The folder where code that has run is cached, "" where there is none."""
    if code.package == "heyoka":
        state: Any = getattr(sys.modules.get("heyoka"), "llvm_state", None)
        return str(state.get_diskcache_path()) if getattr(state, "get_diskcache_enabled", bool)() else ""
    return str(getattr(code.function(), "stats", [""])[0] or "")


def _kept_at(code: Code) -> str:
    """The file in that folder, where its package has one for each code."""
    file = getattr(getattr(code.function(), "_cache", None), "_cache_file", None)
    folder = kept_in(code)
    return os.path.join(folder, file._index_name) if folder and file else folder
