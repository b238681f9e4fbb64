"""What a stranger relies on: versions and requirements that stand in several files, examples, proofs of claims."""

from __future__ import annotations

import inspect
import re
import tomllib
from importlib import import_module
from pathlib import Path
from types import FunctionType
from typing import get_args

import pytest
import yaml

import modal
import nonlinear
from modal.exports import FORMATS
from modal.statespace.shapers import Kind

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
METADATA = PROJECT["project"]
CITATION = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
RECIPE = yaml.safe_load((ROOT / ".ci" / "conda" / "recipe.yaml").read_text(encoding="utf-8"))
WORKFLOWS = {path.name: path.read_text(encoding="utf-8") for path in (ROOT / ".github" / "workflows").glob("*.yml")}
WITHOUT_EXAMPLE: dict[str, str] = {}
"""Public names whose docstrings need no example, and why; none so far."""


def group(name: str) -> set[str]:
    """The requirements of a dependency group, with those of the groups that it includes."""
    requirements: set[str] = set()
    for requirement in PROJECT["dependency-groups"][name]:
        requirements |= {requirement} if isinstance(requirement, str) else group(requirement["include-group"])
    return requirements


def test_one_version_and_the_same_authors_everywhere() -> None:
    assert {CITATION["version"], RECIPE["context"]["version"]} == {METADATA["version"]}
    assert [author["name"] for author in CITATION["authors"]] == [author["name"] for author in METADATA["authors"]]


def test_the_group_dev_is_the_extra() -> None:
    assert group("dev") == set(METADATA["optional-dependencies"]["dev"])
    assert len(METADATA["optional-dependencies"]["dev"]) == len(group("dev"))


def test_every_extra_is_tested() -> None:
    extras = METADATA["optional-dependencies"]
    needed = {
        re.split(r"[><=;\[]", requirement)[0]
        for name in extras.keys() - {"dev", "docs"}
        for requirement in extras[name]
    }
    assert needed <= {re.split(r"[><=;\[]", requirement)[0] for requirement in extras["dev"]}


def test_every_requirement_has_a_lowest_version() -> None:
    listed = [
        *METADATA["dependencies"],
        *(requirement for extra in METADATA["optional-dependencies"].values() for requirement in extra),
    ]
    assert [requirement for requirement in listed if ">=" not in requirement] == []


def test_conda_asks_for_what_the_wheel_asks_for() -> None:
    wheel = {"python" + METADATA["requires-python"], *METADATA["dependencies"]}
    conda = {
        requirement.replace(" ", "").replace("matplotlib-base", "matplotlib")
        for requirement in RECIPE["requirements"]["run"]
    }
    assert conda == wheel
    assert {f"{name} = {door}" for name, door in METADATA["scripts"].items()} == set(
        RECIPE["build"]["python"]["entry_points"]
    )


def test_workflows_test_the_lowest_and_the_newest_python_on_every_system() -> None:
    jobs = yaml.safe_load(WORKFLOWS["ci.yml"])["jobs"]
    named = {line.rsplit(" ", 1)[1] for line in METADATA["classifiers"] if re.search(r":: 3\.\d+$", line)}
    matrix = jobs["locked"]["strategy"]["matrix"]
    newest = max(named, key=lambda version: int(version[2:]))
    assert matrix["python"] == [METADATA["requires-python"].removeprefix(">="), newest]
    assert {"macos-latest", "windows-latest"} == set(matrix["os"])
    assert {job["python"] for job in matrix["include"]} | set(matrix["python"]) == named
    assert ".ci/run" in [step.get("run") for step in jobs["everything"]["steps"]]


@pytest.mark.parametrize("name", WORKFLOWS)
def test_actions_are_those_that_were_read(name: str) -> None:
    """By their hash: a tag can be moved."""
    used = re.findall(r"uses: (\S+)", WORKFLOWS[name])
    assert used
    assert [action for action in used if not re.fullmatch(r"[\w/-]+@[0-9a-f]{40}", action)] == []


def test_every_exception_from_the_review_has_its_reason() -> None:
    assert all(len(reason) > 30 for reason in PROJECT["tool"]["repo-review"]["ignore"].values())


def test_a_bug_report_asks_for_a_scene() -> None:
    form = yaml.safe_load((ROOT / ".github" / "ISSUE_TEMPLATE" / "bug.yml").read_text(encoding="utf-8"))
    required = {part["id"] for part in form["body"] if part.get("validations", {}).get("required")}
    assert {"scene", "command", "seen"} <= required


@pytest.mark.parametrize("name", ["CODE_OF_CONDUCT", "GOVERNANCE", "RELEASING", "SECURITY", "SUPPORT"])
def test_pages_for_the_community_lead_somewhere(name: str) -> None:
    page = ROOT / ".github" / f"{name}.md"
    links = re.findall(r"\]\(([^)\s#]+)", page.read_text(encoding="utf-8"))
    assert [link for link in links if ":" not in link and not (page.parent / link).exists()] == []


# ------------------------------------------------------------------------------------------------ examples


def without_example(package: object) -> set[str]:
    """Functions and classes in `__all__` of a package whose docstrings have no example."""
    public = {name: getattr(package, name) for name in package.__all__}  # type: ignore[attr-defined]
    documented = {name: thing for name, thing in public.items() if isinstance(thing, FunctionType | type)}
    assert documented
    return {name for name, thing in documented.items() if ">>> " not in (thing.__doc__ or "")}


@pytest.mark.parametrize("package", [modal, nonlinear], ids=["modal", "nonlinear"])
def test_every_public_name_has_an_example(package: object) -> None:
    name = package.__name__  # type: ignore[attr-defined]
    assert {f"{name}.{member}" for member in without_example(package)} == {
        member for member in WITHOUT_EXAMPLE if member.startswith(f"{name}.")
    }


def test_the_search_for_examples_bites() -> None:
    assert "Mechanics" in without_example(import_module("nonlinear.dynamics"))


def test_examples_are_in_the_docstring_of_the_thing_itself() -> None:
    """A class without one would show that of its base."""
    for package in (modal, nonlinear):
        classes = [getattr(package, name) for name in package.__all__ if inspect.isclass(getattr(package, name))]
        assert all("__doc__" in vars(kind) and vars(kind)["__doc__"] for kind in classes)


# ------------------------------------------------------------------------------------------------ how we know

KNOWN = ROOT / "docs" / "explanation" / "how-we-know.md"
PROOF = re.compile(r"\[`([\w./-]+)`\]\(([^)#\s]+)\)((?:[:,] `test_\w+`)*)")


def missing(page: str, folder: Path) -> list[str]:
    """Tests and files that a page names and that are not there."""
    wrong: list[str] = []
    for name, target, tests in PROOF.findall(page):
        path = (folder / target).resolve()
        if not path.is_file() or not path.as_posix().endswith(name):
            wrong.append(name)
            continue
        there = set(re.findall(r"^def (test_\w+)\(", path.read_text(encoding="utf-8"), flags=re.MULTILINE))
        wrong += [test for test in re.findall(r"`(test_\w+)`", tests) if test not in there]
    return wrong


def rows(page: str) -> list[list[str]]:
    """The rows of a page's tables of two columns, without heads."""
    claims = re.findall(r"^\| ([^|]+) \| ([^|]+) \|$", page, flags=re.MULTILINE)
    return [[claim.strip(), proof.strip()] for claim, proof in claims if claim != "claim"]


def test_every_claim_has_its_proof_and_the_proof_is_there() -> None:
    page = KNOWN.read_text(encoding="utf-8")
    assert missing(page, KNOWN.parent) == []
    claims = rows(page)
    assert len(claims) >= 25
    assert [claim for claim, proof in claims if "](" not in proof and "no test holds it" not in proof] == []


def test_a_proof_that_is_not_there_is_missed() -> None:
    here, gone = "tests/site/test_project.py", "tests/gone.py"
    page = f"[`{here}`](../../{here}): `test_nothing`, `test_every_extra_is_tested`; [`{gone}`](../../{gone})"
    assert missing(page, KNOWN.parent) == ["test_nothing", "tests/gone.py"]


def test_the_comparison_counts_formats_and_shapers() -> None:
    page = (KNOWN.parent / "comparison.md").read_text(encoding="utf-8")
    assert f"| {len(FORMATS)} formats; {len(get_args(Kind))} kinds of shapers" in page


def test_every_section_of_the_readme_that_promises_is_in_the_list() -> None:
    """Each section of the list is about one of the README, or about a page that continues it, by its title."""
    readme = re.findall(r"^## (.*)$", (ROOT / "README.md").read_text(encoding="utf-8"), flags=re.MULTILINE)
    listed = re.findall(r"^## (.*)$", KNOWN.read_text(encoding="utf-8"), flags=re.MULTILINE)
    pages = [ROOT / "docs" / page for page in ("tutorial/tour.md", "reference/scene.md", "benchmarks/index.md")]
    titles = [page.read_text(encoding="utf-8").partition("\n")[0].removeprefix("# ") for page in pages]
    assert listed == ["The first paragraph", *readme, *titles]


def test_the_readme_is_short() -> None:
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= 120
