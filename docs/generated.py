"""Parts of the manual that are made from what they describe, so that neither can forget the other.

A page holds a comment where a part belongs; what stands there is Markdown:

    <!-- commands: table shapes -->             help of commands, from the parser
    <!-- groups -->                             the pages of commands, with what each command does
    <!-- names: modal load Scene -->            names of a package, from their docstrings
    <!-- namespace: 1 3 -->                     the first third of the functions that are commands
    <!-- modules: modal.loci modal.gains -->    whole modules
    <!-- shipped -->                            the scenes that come with the package
    <!-- formats -->                            what a model can be written as
    <!-- measures -->                           what can be measured, and by whom
    <!-- options -->                            every option with its metavar and its one meaning
    <!-- constants -->                          every number of a module with its kind and reason
    <!-- functions -->                          every command with its functions in Python
    <!-- combinations -->                       what a scene has by what takes it
    <!-- gallery -->                            every figure of docs/pictures.toml
    <!-- play -->                               sketches of all shipped scenes, linked to their live pages
    <!-- live: paper-cart-3 -->                the live page of one

Pictures that have a dark twin, NAME-dark.png next to NAME.png, are followed by it.
"""

from __future__ import annotations

import inspect
import re
import tomllib
from argparse import SUPPRESS, Action, HelpFormatter, _SubParsersAction
from collections.abc import Iterable
from functools import cache, partial
from html import escape as html
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from typing import TYPE_CHECKING, Any

import multipendula

if TYPE_CHECKING:
    from modal.scene.capabilities import Capability
    from multipendula.command import Command
    from multipendula.parser import Page

ROOT = Path(__file__).parent.parent
REFERENCE = ROOT / "docs" / "reference"
PLACE = re.compile(
    r"^<!-- (commands|groups|namespace|names|modules|shipped|formats|measures|options|functions|combinations"
    r"|constants|gallery|play|live):?([^>]*) -->$",
    flags=re.MULTILINE,
)
PICTURE = re.compile(r"^!\[([^\]]*)\]\(([^)]+)\.(png|gif)\)$", flags=re.MULTILINE)


def expanded(page: str, folder: Path) -> str:
    """The page with every part made, its pictures paired with their dark twins."""
    made = PLACE.sub(lambda place: globals()[place[1]](*place[2].split()), page)
    return PICTURE.sub(lambda shown: _paired(*shown.groups(), folder=folder), made)


def _paired(alt: str, name: str, form: str, folder: Path) -> str:
    if not (folder / f"{name}-dark.{form}").exists():
        return f"![{alt}]({name}.{form})"
    shown = ((name, "only-light"), (f"{name}-dark", "only-dark"))
    return "\n\n".join(f"```{{image}} {file}.{form}\n:alt: {alt}\n:class: {where}\n```" for file, where in shown)


# ------------------------------------------------------------------------------------------------ commands


@cache
def parsers() -> dict[str, Page]:
    """The parser of every command."""
    from multipendula.cli import _parser

    return dict(next(a for a in _parser()._actions if isinstance(a, _SubParsersAction)).choices)


def commands(*names: str) -> str:
    """A section for each command: what it does, its usage, its arguments, examples."""
    return "\n\n".join(_command(name, parsers()[name]) for name in names)


def _command(name: str, parser: Page) -> str:
    parser.formatter_class, parser.color = partial(HelpFormatter, width=88), False  # type: ignore[assignment]
    usage = parser.format_usage().removeprefix("usage: ").replace("\n" + " " * 7, "\n").strip()
    shown = [action for action in parser._actions if action.help != SUPPRESS and action.dest != "help"]
    known = _record(name)
    parts = [
        f"(command-{name})=\n## {name}",
        _escaped(known.summary),
        f"```text\n{usage}\n```",
        _escaped(known.details),
    ]
    arguments = [_argument(action, parser) for action in shown if not action.option_strings]
    switches = [_argument(action, parser) for action in shown if action.option_strings]
    parts += [*arguments, *(["**Options**", *switches] if switches else [])]
    examples = "\n".join(f"# {words}\nmultipendula {line}" for line, words in parser.examples)
    parts += ["**Examples**", f"```sh\n{examples}\n```"]
    roles = {"computes": "computed by", "writes": "written and drawn by"}
    used = [
        f"{words} {_linked(_functions()[name][role])}" for role, words in roles.items() if role in _functions()[name]
    ]
    function = [f"{{py:obj}}`multipendula.{name}`"] if name in dir(multipendula) else []
    return "\n\n".join([*parts, *([f"**In Python** {'; '.join([*function, *used])}."] if used else [])])


def groups() -> str:
    """Every page of commands with its commands and what each does."""
    rows = []
    for page, names in sections().items():
        title = (REFERENCE / page).read_text(encoding="utf-8").partition("\n")[0].removeprefix("# ")
        summaries = [f"[`{name}`]({page}#command-{name}) | {_escaped(_record(name).summary)}" for name in names]
        rows += [f"{f'[{title}]({page})' if not at else ''} | {words}" for at, words in enumerate(summaries)]
    return _table("page | command | what it does", rows)


def _record(name: str) -> Command:
    from multipendula.commands import COMMANDS

    return next(command for command in COMMANDS if command.name == name)


@cache
def sections() -> dict[str, list[str]]:
    """Pages of the reference that describe commands, with these, in the order of `multipendula --help`."""
    described = {
        page.relative_to(REFERENCE).as_posix(): words.split()
        for page in sorted(REFERENCE.rglob("*.md"))
        for kind, words in PLACE.findall(page.read_text(encoding="utf-8"))
        if kind == "commands"
    }
    order = list(parsers())
    return dict(sorted(described.items(), key=lambda section: order.index(section[1][0])))


def _argument(action: Action, parser: Page) -> str:
    formatter = parser._get_formatter()
    value = "" if action.nargs == 0 else formatter._format_args(action, action.dest.upper())
    terms = ", ".join(f"`{f'{flag} {value}'.strip()}`" for flag in action.option_strings or [""])
    return f"{terms}\n: {_escaped(formatter._expand_help(action)) if action.help else 'One of these words.'}"


def _escaped(text: str) -> str:
    """Plain words as Markdown: what stands in backticks is code, everything else stands for itself."""
    pieces = re.split(r"(`[^`]+`)", text)
    return "".join(piece if piece[:1] == "`" else re.sub(r"([\\*_<>\[\]|$])", r"\\\1", piece) for piece in pieces)


# ------------------------------------------------------------------------------------------------ Python


def names(package: str, *wanted: str) -> str:
    """Names of a package, each with its docstring."""
    home = import_module(package)
    return "\n\n".join(_documented(_directive(getattr(home, name)), f"{package}.{name}") for name in wanted)


def namespace(part: str, parts: str) -> str:
    """One of several parts of the functions that are commands, in the order of `--help`, each with its arguments."""
    every = [name for name in parsers() if name in dir(multipendula)]
    size = -(-len(every) // int(parts))
    return names("multipendula", *every[(int(part) - 1) * size : int(part) * size])


def _directive(thing: object) -> str:
    if not isinstance(thing, type):
        return "autofunction"
    return "autoexception" if issubclass(thing, Exception) else "autoclass"


@cache
def documented() -> dict[str, str]:
    """Every name that the reference documents by itself, short and in full, and in full."""
    pages = "\n".join(page.read_text(encoding="utf-8") for page in sorted((ROOT / "docs" / "reference").rglob("*.md")))
    names: dict[str, str] = {}
    for kind, words in PLACE.findall(pages):
        if kind == "names":
            package, *wanted = words.split()
            names |= {short: f"{package}.{name}" for name in wanted for short in (name, f"{package}.{name}")}
        if kind == "modules":
            names |= {name: name for name in words.split()}
    return names


def modules(*wanted: str) -> str:
    """Whole modules, each with its opening words and all that it defines."""
    return "\n\n".join(f"## `{name}`\n\n{_documented('automodule', name)}" for name in wanted)


def _documented(directive: str, name: str) -> str:
    return f"```{{eval-rst}}\n.. {directive}:: {name}\n```"


# ------------------------------------------------------------------------------------------------ tables


def shipped() -> str:
    """The scenes that come with the package."""
    from modal.scene import example_names, load

    return _table("name | what hangs there", [f"`{name}` | {_escaped(load(name).title)}" for name in example_names()])


def formats() -> str:
    """What a state-space model can be written as."""
    from modal.exports import FORMATS

    rows = [f"`{name}` | {_escaped(form.what)} | `{form.extension}`" for name, form in FORMATS.items()]
    return _table("`--to` | what is written | usual ending", rows)


def measures() -> str:
    """All measures: what each is, its columns, what it needs, what N is, who takes it; then why others do not."""
    from modal.extend import registered
    from modal.extend.measures import VERBS

    rows, whys = [], dict[str, dict[str, list[str]]]()
    for measure in registered("measure", discover=False).values():
        usual = f"{measure.counts} ({measure.usual:g})" if measure.usual else measure.counts
        takes = ["" if verb in measure.refused else "yes" for verb in VERBS]
        columns = ", ".join(f"`{column}`" for column in measure.columns)
        told = [f"`{measure.name}`", _escaped(measure.words), columns, measure.needs, usual, *takes]
        rows.append(" | ".join(told))
        for verb, why in measure.refused.items():
            whys.setdefault(why, {}).setdefault(verb, []).append(f"`{measure.name}`")
    head = " | ".join(["measure", "what it is", "columns", "needs", "N (unless told)", *VERBS])
    sentences = []
    for why, verbs in whys.items():
        names = dict.fromkeys(name for each in verbs.values() for name in each)
        where = " and ".join(f"`{verb}`" for verb in verbs)
        sentences.append(f"- {', '.join(names)}, not in {where}: {_escaped(why)}.")
    return "\n\n".join([_table(head, rows), "\n".join(sentences)])


def options() -> str:
    """Every option with its metavar, its meaning and the commands that take it, and what options were called before."""
    from multipendula.flags import FLAGS, FORMER, FORMER_COMMANDS

    takers = {flag: [name for name, page in parsers().items() if flag in page._option_string_actions] for flag in FLAGS}
    rows = [
        f"`{f'{flag} {of.metavar}'.strip()}` | {_escaped(of.words)} | {_in_python(flag)} | {_takers(takers[flag])}"
        for flag, of in FLAGS.items()
    ]
    changed = [
        f"`{command} {f'{flag} {FLAGS[former.now].metavar}' if former.values else flag}` | `{former.now}`"
        for (command, flag), former in FORMER.items()
    ]
    changed += [f"`{command}` | `{now}`" for command, now in FORMER_COMMANDS.items()]
    return "\n\n".join(
        [
            _table("option | meaning | in Python | commands", rows),
            "## Spellings of before",
            "These get an error that names the new one.",
            _table("before | now", changed),
        ]
    )


def constants() -> str:
    """The numeric constants of all modules, by kind."""
    from constants import KINDS, all_numbers

    numbers, parts = all_numbers(), list[str]()
    for kind, meaning in KINDS.items():
        rows = [
            f"`{number.module}` | `{number.name}` | `{number.value}` | {_escaped(number.reason)}"
            for number in numbers
            if number.kind == kind
        ]
        parts.append(f"## {kind}: {meaning}\n\n" + _table("module | name | value | reason", rows))
    return "\n\n".join(parts)


def _in_python(flag: str) -> str:
    """The argument that an option becomes of the functions that are a command in Python."""
    from multipendula.commands import COMMANDS

    used = {(command.name, option.keyword) for command in COMMANDS for option in command.options if option.name == flag}
    return ", ".join(f"`{name}`" for name in sorted({name for command, name in used if name in _arguments(command)}))


@cache
def _arguments(command: str) -> set[str]:
    """The arguments of the functions that are a command in Python."""
    named = [name for names in _functions()[command].values() for name in names]
    return {argument for name in named for argument in inspect.signature(function_named(name)).parameters}


def _takers(commands: list[str]) -> str:
    """The commands, linked to their help, or those that do not take it where these are few."""
    missing = [name for name in parsers() if name not in commands]
    if not missing:
        return "all"
    few = len(missing) < 3
    pages = {name: page for page, names in sections().items() for name in names}
    links = (f"[`{name}`]({pages[name]}#command-{name})" for name in (missing if few else commands))
    return "all but " * few + ", ".join(links)


def functions() -> str:
    """Every command, linked to its section, with the functions that compute and those that write and draw."""
    columns = ("computes", "writes")
    described = {name: page for page, names in sections().items() for name in names}
    rows = [
        " | ".join(
            [
                f"[`{command}`]({described[command]}#command-{command})",
                *(_linked(_functions()[command].get(key, ())) for key in columns),
            ]
        )
        for command in parsers()
    ]
    others = [f"`{room}` | {_linked(names)}" for room, names in functions_by_room().items()]
    told = "Every other public function, by the room from which it is imported."
    return "\n\n".join([_table("command | computes | writes, draws", rows), told, _table("room | functions", others)])


def functions_by_room() -> dict[str, list[str]]:
    """The public functions of both packages that no command names, in full, by package and room."""
    named = {name for entry in _functions().values() for names in entry.values() for name in names}
    told = {function_named(name) for name in named}
    rooms = {}
    for package in ("modal", "nonlinear"):
        inner = sorted(room.name for room in iter_modules(import_module(package).__path__) if room.ispkg)
        for place in (package, *(f"{package}.{room}" for room in inner)):
            home = import_module(place)
            public = {name: getattr(home, name) for name in home.__all__}
            new = [name for name, thing in public.items() if inspect.isfunction(thing) and thing not in told]
            told |= {public[name] for name in new}
            rooms[place] = [f"{place}.{name}" for name in new]
    return {place: names for place, names in rooms.items() if names}


@cache
def _functions() -> dict[str, dict[str, list[str]]]:
    """What each command is in Python."""
    return tomllib.loads((ROOT / "docs" / "functions.toml").read_text(encoding="utf-8"))


def _linked(wanted: Iterable[str]) -> str:
    """Names of functions as code, those that the reference documents as links."""
    known = set(documented().values())
    shown = []
    for name in wanted:
        thing = function_named(name)
        full = f"{thing.__module__}.{thing.__qualname__}"
        target = name if {name, name.rpartition(".")[0]} & known else full
        is_documented = bool({target, target.rpartition(".")[0]} & known)
        shown.append(f"{{py:obj}}`{name} <{target}>`" if is_documented else f"`{name}`")
    return ", ".join(shown)


def function_named(name: str) -> Any:
    """The function or method of a full name; ImportError or AttributeError where there is none."""
    package, _, last = name.rpartition(".")
    home = (
        import_module(package)
        if package[:1].islower() and package.split(".")[-1].islower()
        else function_named(package)
    )
    return getattr(home, last)


MARKS = {"takes": "✓", "leaves": "○", "singly": "1", "unless": "(✓)", "refuses": "✗", "beside": ""}


def combinations() -> str:
    """Two tables, what a scene has by what takes it, and what is said of every pair that is not simply taken."""
    from modal.scene import CAPABILITIES, FEATURES

    numbers = {name: f"[{at}](#combination-{at})" for at, name in enumerate(CAPABILITIES, 1)}
    listed = [f"{numbers[name]} | {_escaped(name)}" for name in CAPABILITIES]
    grid = [
        " | ".join([entry.words, *(MARKS[held.entries(feature)[0][0]] for held in CAPABILITIES.values())])
        for feature, entry in FEATURES.items()
    ]
    heading = " | ".join(["a scene with", *numbers.values()])
    parts = [_table("number | capability", listed), _table(heading, grid)]
    return "\n\n".join([*parts, *(_capability(at, entry) for at, entry in enumerate(CAPABILITIES.values(), 1))])


def _capability(at: int, capability: Capability) -> str:
    from modal.scene import FEATURES

    told: dict[tuple[str, str], list[str]] = {}
    for feature in FEATURES:
        kind, words = capability.entries(feature)[0]
        if words and kind != "beside":
            told.setdefault((kind, words), []).append(FEATURES[feature].words)
    heads = {"leaves": "leaves out", "refuses": "refuses", "singly": "member by member", "unless": "with a condition"}
    lines = [f"- {heads[kind]}: {', '.join(names)}: {_escaped(words)}" for (kind, words), names in told.items()]
    lines += [
        f"- not together: {FEATURES[a].words}, {FEATURES[b].words}: {_escaped(why)}"
        for (a, b), why in capability.conflicts.items()
    ]
    lines += [f"- needs: {_escaped(why)}" for why in capability.needs.values()]
    return "\n\n".join(
        [f"(combination-{at})=\n## {at}. {_escaped(capability.name)}", "\n".join(lines) or "Takes everything."]
    )


def _table(heading: str, rows: list[str]) -> str:
    rule = re.sub(r"[^|]+", "---", heading)
    return "\n".join(f"| {row} |" for row in (heading, rule, *rows))


# ------------------------------------------------------------------------------------------------ gallery


def gallery() -> str:
    """Every figure with its caption and the commands that make it, section by section."""
    pictures = tomllib.loads((ROOT / "docs" / "pictures.toml").read_text(encoding="utf-8"))
    sections = dict.fromkeys(picture["section"] for picture in pictures.values())
    return "\n\n".join(
        f"## {section.capitalize()}\n\n"
        + "\n\n".join(_figure(name, picture) for name, picture in pictures.items() if picture["section"] == section)
        for section in sections
    )


def _figure(name: str, picture: dict[str, str]) -> str:
    file = f"{name}.{picture.get('form', 'png')}"
    lines = [picture[step].format(run="run.npz", out=file) for step in ("before", "command") if step in picture]
    done = "\n".join(f"multipendula {line}" for line in lines)
    image = f"![{picture['alt']}](pictures/{file})"
    return f"### {picture['title']}\n\n{picture['caption']}\n\n{image}\n\n```sh\n{done}\n```"


# ------------------------------------------------------------------------------------------------ live pages


def live(name: str) -> str:
    """The live page of a shipped scene in a frame, which is loaded when it comes into view, and a link to it."""
    from playing import pages

    about = f'title="Live page: {html(pages()[name][0].title)}" loading="lazy" allow="fullscreen; clipboard-write"'
    link = f'<p><a href="play/{name}.html">Open the live page by itself</a></p>'
    return f'<iframe src="play/{name}.html" {about}></iframe>\n{link}'


def play() -> str:
    """Every shipped scene with a sketch and a link to its live page, or why it has none (`docs/playing.py`)."""
    from playing import pages, sketch

    cards = []
    for name, (scene, why) in pages().items():
        words = f"{sketch(scene)}<strong>{html(scene.title)}</strong> <code>{name}</code>"
        link = f"<div>{words} <small>No page: {html(why)}</small></div>"
        cards.append(link if why else f'<a href="play/{name}.html">{words}</a>')
    return '<div class="scenes">\n' + "\n".join(cards) + "\n</div>"
