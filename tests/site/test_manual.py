"""The manual hangs together: links, anchors, pictures, tables of contents, and what the reference must not omit.

Nothing is built and Sphinx is not needed; what a page has made from the code is made here too (`docs/generated.py`).
"""

from __future__ import annotations

import json
import re
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import generated
import pytest

import modal
import nonlinear
from modal.scene import (
    Bob,
    Body,
    Cart,
    Escapement,
    Ground,
    Heave,
    InitialCondition,
    LossTable,
    ModalSupport,
    Pendulum,
    Platform,
    Rod,
    Scene,
    Spring,
    Swing,
    Tilt,
    VanDerPol,
)
from multipendula.commands import GROUPS

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PICTURES = DOCS / "pictures"
"""A source distribution is without them."""
BUILT = ("_build", "lessons")
FENCE = re.compile(r"^ *(`{3,})[^\n]*\n.*?^ *\1 *$", re.DOTALL | re.MULTILINE)


def pages() -> list[Path]:
    manual = [page for page in DOCS.rglob("*.md") if not set(BUILT) & set(page.relative_to(DOCS).parts)]
    return sorted([ROOT / "README.md", ROOT / "CONTRIBUTING.md", *manual, *(ROOT / "notebooks").glob("*.md")])


@cache
def text_of(page: Path) -> str:
    """A page with what is included in it and what is made for it."""
    text = page.read_text(encoding="utf-8")
    text = re.sub(r"```\{include\} (\S+)\n.*?```", lambda m: text_of((page.parent / m[1]).resolve()), text, flags=re.S)
    return str(generated.expanded(text, page.parent)) if page.is_relative_to(DOCS) else text


def prose(text: str) -> str:
    """The words of a page, without code."""
    return re.sub(r"(`+)[^`]+\1", "", FENCE.sub("", text))


@cache
def anchors(text: str) -> set[str]:
    text = FENCE.sub("", text)
    slugs = [slug(heading) for heading in re.findall(r"^#+ (.*)$", text, flags=re.MULTILINE)]
    return {*slugs, *re.findall(r"^\((\S+)\)=$", text, flags=re.MULTILINE)}


def slug(heading: str) -> str:
    return re.sub(r"[^\w\- ]", "", heading.strip().lower()).replace(" ", "-")


def broken(text: str, folder: Path) -> list[str]:
    """What is wrong with the links and pictures of a page in this folder."""
    words = prose(text)
    wrong = [
        f"no alt text: {name}" for alt, name in re.findall(r"!\[([^\]]*)\]\(([^)\s]+)\)", words) if not alt.strip()
    ]
    images = re.findall(r"```\{(?:image|figure)\} (\S+)\n(.*?)```", text, flags=re.DOTALL)
    wrong += [f"no alt text: {name}" for name, options in images if not re.search(r"^:alt: \S", options, flags=re.M)]
    wrong += [f"no alt text: {tag}" for tag in re.findall(r"<img[^>]*>", words) if not re.search(r'alt="[^"]', tag)]
    targets = [*re.findall(r"\]\(([^)\s]+)\)", words), *(name for name, _ in images)]
    return wrong + [f"leads nowhere: {target}" for target in targets if not leads_somewhere(target, text, folder)]


def leads_somewhere(target: str, text: str, folder: Path) -> bool:
    path, _, anchor = target.partition("#")
    if re.match(r"[a-z]+:", target):
        return True
    if not path:
        return anchor in anchors(text)
    file = (folder / path).resolve()
    if file.is_relative_to(PICTURES) and not PICTURES.is_dir():
        return True
    return file.exists() and (not anchor or anchor in anchors(text_of(file)))


@pytest.mark.parametrize("page", pages(), ids=lambda page: str(page.relative_to(ROOT)))
def test_every_link_leads_somewhere_and_every_picture_has_words(page: Path) -> None:
    assert broken(text_of(page), page.parent) == []


def test_what_is_broken_is_seen() -> None:
    page = """# Made up
[fine](#made-up), [on another page only](#gallery)
[fine](howto/index.md), [fine too](reference/scene.md#drives), `[code](nowhere.md)`
[gone](howto/nowhere.md), [no such part](reference/scene.md#nowhere), ![](pictures/shapes.png), ![gone](nowhere.png)
```{image} pictures/shapes.png
:class: only-light
```
"""
    flaws = broken(page, DOCS)
    assert len(flaws) == 6
    assert "leads nowhere: #gallery" in flaws
    assert sum("no alt text: pictures/shapes.png" in flaw for flaw in flaws) == 2
    assert sum("leads nowhere" in flaw for flaw in flaws) == 4


def contents(page: Path) -> list[Path]:
    """The pages in the tables of contents of a page."""
    trees = re.findall(r"```\{toctree\}\n(.*?)```", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    names = [
        name for tree in trees for name in tree.split("\n") if name and not name.startswith(":") and "*" not in name
    ]
    return [page.parent / f"{name}.md" for name in names]


def reached(page: Path) -> set[Path]:
    return {page}.union(*(reached(below) for below in contents(page)))


def test_no_page_is_an_orphan() -> None:
    assert reached(DOCS / "index.md") == {page for page in pages() if page.is_relative_to(DOCS)}


@pytest.mark.parametrize("package", [modal, nonlinear], ids=["modal", "nonlinear"])
def test_every_public_name_is_in_the_reference(package: object) -> None:
    name = getattr(package, "__name__", "")
    wanted = {f"{name}.{public}" for public in getattr(package, "__all__", ())}
    assert wanted - set(generated.documented().values()) == set()


def test_what_the_reference_names_is_there() -> None:
    for full in set(generated.documented().values()):
        package, _, name = full.rpartition(".")
        assert hasattr(import_module(package), name) or find_spec(full), full


def test_every_command_is_in_the_reference() -> None:
    """On the page of its group, named after the module."""
    described = {Path(page).stem: names for page, names in generated.sections().items()}
    groups = {group.__name__.rpartition(".")[2]: [command.name for command in group.COMMANDS] for group in GROUPS}
    assert {name: sorted(commands) for name, commands in described.items()} == {
        name: sorted(commands) for name, commands in groups.items()
    }


PARTS = {
    "The scene": [Scene],
    "The support": [Cart],
    "A pendulum": [Pendulum, InitialCondition],
    "A link": [Bob, Rod, Body, LossTable],
    "Structures": [Swing, Tilt, Heave, Platform, ModalSupport],
    "Springs between points": [Spring],
    "The ground": [Ground],
    "A drive": [VanDerPol, Escapement],
}


@pytest.mark.parametrize(("title", "part"), [(title, part) for title, parts in PARTS.items() for part in parts])
def test_every_key_of_a_scene_is_explained(title: str, part: type[Scene]) -> None:
    page = (DOCS / "reference" / "scene.md").read_text(encoding="utf-8")
    section = page.partition(f"## {title}\n")[2].partition("\n## ")[0]
    rows = re.findall(r"^\| `(\w+)` \|[^|]*\| ([^|]*) \|", section, flags=re.MULTILINE)
    for key, field in part.fields.items():
        defaults = " ".join(default for name, default in rows if name == key)
        if field.is_required:
            assert "required" in defaults, key
        elif isinstance(field.default, int | float | str) and key != "kind":
            shown = json.dumps(field.default)
            assert f"`{shown}`" in defaults, key
        else:
            assert defaults, key
