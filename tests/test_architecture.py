"""The house: imports run downhill, heavy packages stay out of the main job."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path

import pytest
from amounts import usually

ROOT = Path(__file__).parent.parent
PACKAGES = ("modal", "nonlinear", "multipendula")
TABLE = ROOT / "docs" / "reference" / "rooms.md"
ROOMS = re.findall(r"^\| `([\w.]+)` \|", TABLE.read_text(encoding="utf-8"), flags=re.MULTILINE)
DOORS = {*PACKAGES, "modal.lazy", "modal.namesake", "multipendula.__main__"}
"""Modules outside subpackages: they only import one."""
HEAVY = {
    "matplotlib": {"modal.plotting", "nonlinear.plotting"},
    "scipy": {
        "modal.eigen.product",
        "modal.scene.tables",
        "modal.statespace.channels",
        "modal.statespace.hoisting",
        "modal.statespace.insensitive",
        "modal.statespace.regulator",
        "modal.statespace.sampled",
        "modal.statespace.travels",
        "modal.statespace.sampling",
        "modal.statespace.transfer",
        "modal.vibration",
        "modal.exports.scripts",
        "modal.identification",
        "modal.tuning",
        "nonlinear",
    },
    "sympy": {"modal.symbolic"},
    "control": {"modal.exports.scripts"},
    "flint": {"modal.exact.assembly"},
    "numba": {"nonlinear.dynamics.compiling"},
    "heyoka": {"nonlinear.integration.taylor"},
    "distributed": {"nonlinear.ensembles.cluster"},
    "xarray": {"nonlinear.postprocessing.datasets"},
    "pandas": set(),
}
MOST_ENTRIES = 21
"""Subpackages that a package shows at a glance."""
FIXTURES = {"__init__.py", "__main__.py", "lazy.py", "namesake.py", "py.typed", "__pycache__"}


def module_name(path: Path) -> str:
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


def room_of(name: str) -> str:
    return ".".join(name.split(".")[:2])


@cache
def sources() -> dict[str, Path]:
    return {module_name(path): path for package in PACKAGES for path in (ROOT / package).rglob("*.py")}


@cache
def parsed(source: str) -> ast.Module:
    """A module, which several claims read; none changes it."""
    return ast.parse(source)


@cache
def nodes(source: str) -> list[ast.AST]:
    """All that stands in a module."""
    return list(ast.walk(parsed(source)))


@cache
def imports(path: Path) -> set[str]:
    modules = set()
    for node in nodes(path.read_text(encoding="utf-8")):
        if isinstance(node, ast.Import):
            modules |= {name.name for name in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            known = sources()
            full = {f"{node.module}.{name.name}" for name in node.names}
            modules |= {name if name in known else node.module for name in full}
    return modules


@cache
def imported_at_run_time(path: Path) -> set[str]:
    """The packages that a module imports for more than the type checker."""
    every = nodes(path.read_text(encoding="utf-8"))
    guards = [node for node in every if isinstance(node, ast.If) and _name(node.test) == "TYPE_CHECKING"]
    told = {id(inner) for guard in guards for part in guard.body for inner in ast.walk(part)}
    done = [node for node in every if isinstance(node, ast.Import | ast.ImportFrom) and id(node) not in told]
    names = [name.name for node in done if isinstance(node, ast.Import) for name in node.names]
    names += [f"{node.module}" for node in done if isinstance(node, ast.ImportFrom)]
    return {name.partition(".")[0] for name in names}


def upward(rooms: list[str], imported: dict[str, set[str]]) -> set[tuple[str, str]]:
    """Imports of a module from a subpackage of the same packages that the list does not name above its own."""
    return {
        (name, target)
        for name, targets in imported.items()
        for target in targets & imported.keys()
        if (here := room_of(name)) in rooms
        and (there := room_of(target)) != here
        and there in rooms
        and rooms.index(there) > rooms.index(here)
    }


def circles(imported: dict[str, set[str]]) -> set[str]:
    """Modules that import each other, in any number of steps."""
    left = {name: targets & imported.keys() - {name} for name, targets in imported.items()}
    while free := {name for name, targets in left.items() if not targets}:
        left = {name: targets - free for name, targets in left.items() if name not in free}
    return set(left)


def imported_by() -> dict[str, set[str]]:
    return {name: imports(path) for name, path in sources().items()}


def test_every_module_stands_in_a_room_of_the_list() -> None:
    assert {room_of(name) for name in sources()} - DOORS == set(ROOMS)
    assert len(set(ROOMS)) == len(ROOMS)


def test_rooms_import_only_from_rooms_above_them() -> None:
    assert upward(ROOMS, imported_by()) == set()


def test_imports_make_no_circle() -> None:
    assert circles(imported_by()) == set()


@pytest.mark.parametrize("package", PACKAGES)
def test_a_package_can_be_taken_in_at_a_glance(package: str) -> None:
    shown = {path.name for path in (ROOT / package).iterdir()} - FIXTURES
    assert len(shown) <= MOST_ENTRIES, shown


def test_every_room_says_what_it_is_for() -> None:
    for room in ROOMS:
        lines = (ast.get_docstring(parsed(sources()[room].read_text(encoding="utf-8"))) or "").splitlines()
        folder = sources()[room].name == "__init__.py"
        assert len(lines) >= (4 if folder else 1), room


def test_rooms_speak_of_what_is_there() -> None:
    """Modules by the name of a file there, classes by that of a class of its package; matplotlib has Figure."""
    classes = {
        node.name
        for path in sources().values()
        for node in parsed(path.read_text(encoding="utf-8")).body
        if isinstance(node, ast.ClassDef)
    } | {"Figure"}
    for room in ROOMS:
        words = ast.get_docstring(parsed(sources()[room].read_text(encoding="utf-8"))) or ""
        assert set(re.findall(r"`([A-Z][A-Za-z]*[a-z][A-Za-z]*)`", words)) <= classes, room
        for start in re.findall(r"Start\s+with\s+`(\w+)`(?:\s+and\s+(?:with\s+)?`(\w+)`)?", words):
            assert {f"{room}.{module}" for module in start if module} <= sources().keys(), room


def test_nobody_imports_the_command_and_modal_nothing_of_nonlinear() -> None:
    for name, path in sources().items():
        package = name.partition(".")[0]
        used = {target.partition(".")[0] for target in imports(path)} & set(PACKAGES)
        assert used <= set(PACKAGES[: PACKAGES.index(package) + 1]), name
        assert "multipendula" not in imports(path), f"{name} imports from the namespace, which is for users"


def test_the_check_of_imports_bites(tmp_path: Path) -> None:
    assert upward(["p.a", "p.b"], {"p.a.x": {"p.b.y"}, "p.b.y": {"numpy"}}) == {("p.a.x", "p.b.y")}
    assert upward(["p.a", "p.b"], {"p.a.x": {"p.a.z"}, "p.a.z": set(), "p.b.y": {"p.a.x"}}) == set()
    assert circles({"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": {"e"}, "e": {"numpy"}}) == {"a", "b", "c"}
    (tmp_path / "a.py").write_text("def f():\n    import matplotlib.pyplot\n")
    assert imports(tmp_path / "a.py") == {"matplotlib.pyplot"}
    assert imported_at_run_time(tmp_path / "a.py") == {"matplotlib"}
    (tmp_path / "b.py").write_text("if TYPE_CHECKING:\n    from matplotlib.figure import Figure\nimport numpy\n")
    assert imported_at_run_time(tmp_path / "b.py") == {"numpy"}


def test_heavy_packages_have_their_homes() -> None:
    strangers = {
        (name, heavy)
        for name, path in sources().items()
        for heavy in HEAVY.keys() & imported_at_run_time(path)
        if not any(f"{name}.".startswith(f"{home}.") for home in HEAVY[heavy])
    }
    assert strangers == set()


def test_the_main_job_loads_no_heavy_package() -> None:
    code = "import sys; from modal import *; list(natural_modes(load('paper-cart-2')))"
    code += "; from multipendula.cli import main; main(['table', 'chain-3']); print(*sys.modules, file=sys.stderr)"
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = {name.partition(".")[0] for name in ran.stderr.split()}
    assert HEAVY.keys() & loaded == set()
    assert {"numpy", "modal"} <= loaded


COSTLY = {f"scipy.{room}" for room in ("integrate", "interpolate", "linalg", "optimize", "signal", "sparse", "stats")}
COSTLY |= {*HEAVY, "modal.identification", "nonlinear.identification"} - {"scipy"}
"""What takes so long to load that only those who need it wait for it."""
NEEDED: dict[str, set[str]] = {
    "table paper-cart-2": set(),
    "import nonlinear; nonlinear.simulate, nonlinear.ensemble, nonlinear.load": set(),
    "simulate paper-cart-2 --duration 0.1": set(),
    "simulate chain-spatial --duration 0.1": set(),
    "check paper-cart-2 --modes 1 --amplitudes 1": set(),
    "basins chain-1 --vary gravity=9:10:2 --vary pendulum[0].links[0].length=1:2:2 --duration 0.1 --workers 1": set(),
    "sync huygens --duration 1": set(),
    "orbits chain-2 --mode 1 --largest-angle 3": set(),
    "import nonlinear.plotting": {"matplotlib"},
    "plot chain-1 --duration 0.1 -o run.svg": {"matplotlib"},
    "tune tower --free pendulum[0].links[0].damping --minimize settling": {
        *("modal.identification", "scipy.linalg", "scipy.optimize", "scipy.sparse")
    },
    "simulate paper-cart-2 --duration 0.1 --method RK45": {
        *("scipy.integrate", "scipy.linalg", "scipy.optimize", "scipy.sparse")
    },
    "import scipy, nonlinear.identification; scipy.signal": {
        *("nonlinear.identification", "scipy.interpolate", "scipy.signal", "scipy.stats")
    },
}
"""What an import or a command may load of it, in addition to those before it; the last one loads it."""


MOST_LOADED = {"table paper-cart-2": (80, 18_500)}
"""Modules of ours, and their lines, that the first of them may load."""

LONGER = ("sync", "tune", "plot", "import scipy")
"""Those that are omitted on most days."""


def test_a_command_loads_what_it_needs(tmp_path: Path) -> None:
    """One after the other in one process, those that need least first."""
    code = ["import contextlib, os, sys", "from multipendula.cli import main"]
    jobs = [job for job in NEEDED if not job.startswith(usually(LONGER, ()))]
    for job in jobs:
        call = job if job.startswith("import") else f"main({job.split()})"
        code += ["with contextlib.redirect_stdout(open(os.devnull, 'w', encoding='utf-8')):", f"    {call}"]
        code += ["print(*sys.modules)"]
    ran = subprocess.run(
        [sys.executable, "-c", "\n".join(code)], capture_output=True, text=True, check=True, cwd=tmp_path
    )
    allowed = set[str]()
    for job, modules in zip(jobs, ran.stdout.splitlines(), strict=True):
        allowed |= NEEDED[job]
        assert COSTLY & set(modules.split()) <= allowed, job
        if job in MOST_LOADED:
            ours = sources().keys() & set(modules.split())
            lines = sum(len(sources()[name].read_text(encoding="utf-8").splitlines()) for name in ours)
            assert len(ours) <= MOST_LOADED[job][0]
            assert lines <= MOST_LOADED[job][1]
    assert NEEDED[job] <= set(modules.split())


def scipy_rooms(path: Path) -> list[str]:
    """The subpackages of SciPy that a module loads on import."""
    body = parsed(path.read_text(encoding="utf-8")).body
    rooms = [f"{node.module}" for node in body if isinstance(node, ast.ImportFrom)]
    rooms += [name.name for node in body if isinstance(node, ast.Import) for name in node.names if "." in name.name]
    return [room for room in rooms if room.startswith("scipy")]


def test_rooms_of_scipy_are_loaded_when_they_are_used() -> None:
    """`import scipy` loads none of them."""
    loaded = {name: rooms for name, path in sources().items() if (rooms := scipy_rooms(path))}
    assert not loaded


OPTION = re.compile(r"(?<![\w-])--[a-z]|(?<![\w-])-[a-z] |--?[a-z]+ FILE")


def spoken(source: str) -> list[str]:
    """All text in a module that is no docstring."""
    homes = (ast.Module, ast.ClassDef, ast.FunctionDef)
    told = {
        id(node.body[0].value) for node in nodes(source) if isinstance(node, homes) and hasattr(node.body[0], "value")
    }
    texts = (node for node in nodes(source) if isinstance(node, ast.Constant) and id(node) not in told)
    return [node.value for node in texts if isinstance(node.value, str)]


def test_the_packages_know_no_option_of_the_command() -> None:
    """But tests of extensions, which call commands as users do."""
    others = ("multipendula", "modal.testing")
    packages = {name: path for name, path in sources().items() if not name.startswith(others)}
    spoken_options = [
        (name, text)
        for name, path in packages.items()
        for text in spoken(path.read_text(encoding="utf-8"))
        if OPTION.search(text)
    ]
    assert spoken_options == []


def test_the_search_for_options_bites() -> None:
    source = '"""About --modes."""\nraise ValueError(f"--to {name}: no", "write -o FILE", "a - b, -1, well-made, a--b")'
    assert [text for text in spoken(source) if OPTION.search(text)] == ["write -o FILE", "--to "]


# ------------------------------------------------------------------------------------------------------ one text

FIRST_MOMENTS, DIRECTIONS = (
    {"b", "mc", "static", "first_moment"},
    {"sin", "cos", "sine", "cosine", "s", "c", "along", "across", "normals"},
)
KEPT = {
    "nonlinear.dynamics.recursion": "the text",
    "nonlinear.dynamics.contacts": "the text of joints that stick",
    "nonlinear.dynamics.elimination": "the text of short chains",
    "nonlinear.reduction.truncation": "the motion in a few modes",
    "nonlinear.postprocessing.frequencies": "the amplitude series of a frequency",
    "nonlinear.chaos.studies": "the energies that a section can have",
}
"""Modules that may multiply first moments by directions of links, and why."""


def _name(node: ast.expr) -> str:
    if isinstance(node, ast.Subscript | ast.Call):
        return _name(node.value if isinstance(node, ast.Subscript) else node.func)
    return node.id if isinstance(node, ast.Name) else node.attr if isinstance(node, ast.Attribute) else ""


def _factors(node: ast.expr) -> list[str]:
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult | ast.MatMult):
        return _factors(node.left) + _factors(node.right)
    return [_name(node.operand if isinstance(node, ast.UnaryOp) else node)]


def turns_first_moments(source: str) -> bool:
    """Whether a product in a source has both a first moment and a sine or cosine for factors."""
    products = (node for node in nodes(source) if isinstance(node, ast.BinOp))
    names = (set(_factors(node)) for node in products if isinstance(node.op, ast.Mult | ast.MatMult))
    return any(group & FIRST_MOMENTS and group & DIRECTIONS for group in names)


def test_the_physics_of_links_is_written_once() -> None:
    places = {
        name
        for name, path in sources().items()
        if name.startswith(("nonlinear", "multipendula")) and turns_first_moments(path.read_text(encoding="utf-8"))
    }
    assert places == set(KEPT)


def test_a_twin_by_hand_would_be_found() -> None:
    assert turns_first_moments("force[0] += (group.block.b * np.cos(q)) @ turned")
    assert turns_first_moments("x = m * mc * c * w * w")
    assert not turns_first_moments("x = group.block.length * np.cos(q)")


TABLEAU = {"A", "B", "C", "D", "E3", "E5", "A_EXTRA", "C_EXTRA", "n_stages"}
NUMBER = re.compile(r"(?<![\w.])\d+\.\d+(?:[eE][-+]?\d+)?")
DIGITS = 10
"""To so many a number is one of the tableau."""


@cache
def tableau() -> set[str]:
    """The numbers of the tableau that nobody writes by chance."""
    from nonlinear.integration import method

    rows = [*method.ROWS, *method.MORE, *method.POWERS, method.FIFTH, method.THIRD, [*enumerate(method.NODES)]]
    return {_rounded(share) for row in rows for _, share in row if len(repr(share)) > 12}


def _rounded(value: float) -> str:
    return f"{abs(value):.{DIGITS - 1}e}"


def coefficients_in(source: str) -> list[str]:
    """What a source in Python has of DOP853's tableau: numbers, also in texts, and what it reads of SciPy's method."""
    numbers = list[float]()
    coefficients = ["dop853_coefficients"] * ("dop853_coefficients" in source)
    for node in nodes(source):
        if isinstance(node, ast.Constant) and isinstance(node.value, float):
            numbers.append(node.value)
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            numbers += map(float, NUMBER.findall(node.value))
        if isinstance(node, ast.Attribute) and node.attr in TABLEAU:
            alone = len(node.attr) > 1 and node.attr != "n_stages"
            coefficients += [node.attr] if alone or _name(node.value).endswith("DOP853") else []
    return coefficients + [repr(value) for value in numbers if _rounded(value) in tableau()]


def test_the_tableau_of_dop853_stands_in_one_module() -> None:
    """Neither read from SciPy's method anywhere else, nor written down."""
    by_module = {name: coefficients_in(path.read_text(encoding="utf-8")) for name, path in sources().items()}
    assert {name for name, literals in by_module.items() if literals} == {"nonlinear.integration.method"}
    for path in (ROOT / "multipendula" / "page" / "modules").glob("*.js"):
        written = map(float, NUMBER.findall(path.read_text(encoding="utf-8")))
        assert [value for value in written if _rounded(value) in tableau()] == [], path.name


@pytest.mark.parametrize(
    "source",
    [
        "C = [0.0, 5.26001519587677318785587544488e-2]",
        "b1 = 0.05429373411656876",
        "z = y + h * 0.24136513416",
        'text = f"y{i} + h * (5.2600151958e-2 * k0)"',
        "A = DOP853.A",
        "B = integrate.DOP853.B",
        "e = solver.E3 @ K",
        "from scipy.integrate._ivp import dop853_coefficients",
        "from scipy.integrate._ivp.dop853_coefficients import A",
    ],
)
def test_a_second_tableau_would_be_found(source: str) -> None:
    assert len(tableau()) > 100
    assert coefficients_in(source)


def test_other_numbers_are_none_of_the_tableau() -> None:
    assert coefficients_in("x = system.A + 0.2 * block.B - 0.0833333 + DOP853.order") == []


# --------------------------------------------------------------------------------------------------------- names


SAYS_NOTHING = {"found", "one", "own"}
MAY_BE_BOUND = re.compile(rf"\b(?:{'|'.join(SAYS_NOTHING)})\b\s*(?:[-+*/|&^%@]*=|[:,()\]]|in\b)")


def vague_names(source: str) -> Iterator[str]:
    """Bindings, arguments, fields and functions of a text of Python whose names say nothing of what they are."""
    for node in nodes(source) if MAY_BE_BOUND.search(source) else ():
        match node:
            case ast.Name(id=name, ctx=ast.Store()) | ast.arg(arg=name) | ast.FunctionDef(name=name):
                if name in SAYS_NOTHING:
                    yield name


@pytest.mark.parametrize("folder", [*PACKAGES, "benchmarks", "docs", "tests"])
def test_results_are_named_for_what_they_are(folder: str) -> None:
    vague = {
        str(path.relative_to(ROOT)): names
        for path in (ROOT / folder).rglob("*.py")
        if (names := sorted(vague_names(path.read_text(encoding="utf-8"))))
    }
    assert not vague


@pytest.mark.parametrize("source", ["one = 1", "def own(): ...", "f = lambda found: found", "for one in range(3): ..."])
def test_a_vague_name_would_be_seen(source: str) -> None:
    assert [*vague_names(source)]


BARE = re.compile(
    r"_*(?:"
    r"kept|told|asked|gone|done|made|met|found|given|taken|seen|shown|known|drawn|written|run|held|"
    r"left|lost|cut|put|set|bent|begun|built|bound|fallen|felt|fed|hung|led|meant|paid|read|said|"
    r"sent|spent|stood|struck|swept|wound|worn|alone|apart|beside|beyond|together|whole|own|least|"
    r"most|many|few|else|other|more|less|near|far|close|wide|here|there|away|along|across|below|"
    r"above|before|after|ahead|behind|around|still|yet|just|only|even|both|each|every|some|such|same|"
    r"again|soon|long|short"
    r"|(?!speed$|need$)\w{3,}ed)"
)
"""Words that say how a thing is or what was done to it, and not what it is."""
LARGEST_SHARES = (0.03, 0.045)
"""Of all names that are bound and of all functions, those that may be such a word."""


def is_bare(name: str) -> bool:
    """Whether a name is a participle or an adverb without its noun."""
    return BARE.fullmatch(name) is not None


def bound_names(source: str) -> tuple[list[str], list[str]]:
    """Names of variables and arguments of more than two letters, and names of functions."""
    bound = [node.id for node in nodes(source) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)]
    bound += [node.arg for node in nodes(source) if isinstance(node, ast.arg)]
    return [name for name in bound if len(name) > 2], [n.name for n in nodes(source) if isinstance(n, ast.FunctionDef)]


def test_names_are_nouns_and_verbs() -> None:
    variables, functions = list[str](), list[str]()
    for path in sources().values():
        names = bound_names(path.read_text(encoding="utf-8"))
        variables += names[0]
        functions += names[1]
    shares = (sum(map(is_bare, names)) / len(names) for names in (variables, functions))
    assert all(share <= largest for share, largest in zip(shares, LARGEST_SHARES, strict=True))


def test_a_bare_participle_is_counted() -> None:
    assert bound_names("kept = 1\nx = 2\ndef sorted_rows(told): ...") == (["kept", "told"], ["sorted_rows"])
    assert [is_bare(name) for name in ("kept", "_counted", "sorted_rows", "speed")] == [True, True, False, False]


def class_names(paths: Iterable[Path]) -> list[str]:
    modules = (nodes(path.read_text(encoding="utf-8")) for path in paths)
    return [node.name for every in modules for node in every if isinstance(node, ast.ClassDef)]


def test_the_name_of_a_class_has_one_meaning(tmp_path: Path) -> None:
    names = class_names(sources().values())
    assert len(names) > 500
    assert not {name for name in names if names.count(name) > 1}
    twice = [tmp_path / "a.py", tmp_path / "b.py"]
    for path in twice:
        path.write_text("class Point: ...", encoding="utf-8")
    assert class_names(twice) == ["Point", "Point"]
