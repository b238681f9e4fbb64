"""Sources: what docstrings and pages cite stands in `docs/references.bib`, and what stands there is cited."""

from __future__ import annotations

import re
from itertools import chain
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ENTRY = re.compile(r"^@(\w+)\{(\w+), (.*)\}$", re.MULTILINE)
IN_CODE = re.compile(r"\[([A-Z][A-Za-z]+(?:1[6-9]|20)\d\d[ab]?)(?:, [^\]]+)?\]")
IN_PAGES = re.compile(r"\{cite:p\}`([^`{]+)[^`]*`")
IN_PAPER = re.compile(r"@([A-Z]\w+)")
IN_WORDS = re.compile(r"\b[A-Z]\w+[^.()\[\]]{0,60}(?:\b[A-Z]\w*\.\s+){1,4}[^()\[\]]{1,30}\((?:1[6-9]|20)\d\d\)")
"""A journal in short words with its year, as it would stand where a key belongs."""
WITHOUT_DOI = {"book", "incollection", "inproceedings", "phdthesis", "techreport"}
TEXT = (ROOT / "docs" / "references.bib").read_text(encoding="utf-8")
ENTRIES = {key: (kind, fields) for kind, key, fields in ENTRY.findall(TEXT)}
CODE = {
    path: path.read_text(encoding="utf-8")
    for room in ("modal", "nonlinear", "multipendula")
    for path in sorted((ROOT / room).rglob("*.py"))
}
PAGES = {
    path: path.read_text(encoding="utf-8")
    for path in sorted((ROOT / "docs").rglob("*.md"))
    if not {"_build", "lessons", "papers"} & set(path.parts)
}
LESSONS = {path: path.read_text(encoding="utf-8") for path in sorted((ROOT / "notebooks").glob("*.md"))}
PAPER = ROOT / "paper" / "paper.md"
CITED = [
    *((PAPER, key) for key in IN_PAPER.findall(PAPER.read_text(encoding="utf-8"))),
    *((path, key) for path, text in CODE.items() for key in IN_CODE.findall(text)),
    *((path, key) for path, text in PAGES.items() for keys in IN_PAGES.findall(text) for key in keys.split(",")),
]


def test_every_citation_has_its_entry() -> None:
    assert len(CITED) > 100
    assert not [(str(path.relative_to(ROOT)), key) for path, key in CITED if key not in ENTRIES]


def test_every_entry_is_cited() -> None:
    lessons = " ".join(LESSONS.values())
    cited = {key for _, key in CITED} | {
        key for key in ENTRIES if re.search(rf"{author(key)}[^()]{{0,80}}\(?{key.strip('ab')[-4:]}", lessons)
    }
    assert sorted(set(ENTRIES) - cited) == []


def author(key: str) -> str:
    """The first author's family name."""
    written = re.search(r"author = \{(?:\{?\\?[^A-Za-z]*)?([^,}]*)", ENTRIES[key][1])
    assert written
    return re.escape(written[1].replace("}", ""))


@pytest.mark.parametrize("key", ENTRIES)
def test_an_entry_can_be_opened(key: str) -> None:
    kind, fields = ENTRIES[key]
    assert {"author", "title", "year"} <= set(re.findall(r"(\w+) = ", fields))
    assert f"year = {{{key.rstrip('ab')[-4:]}}}" in fields
    doi = re.search(r"doi = \{(10\.\d{4,5}/[^}\s]+)\}", fields)
    if kind not in WITHOUT_DOI and not doi and "eprint" not in fields:
        assert "pages = " in fields
        assert "volume = " in fields
        assert re.search(r"journal = \{[^}.]+\}", fields)


def test_no_journal_stands_in_words() -> None:
    """In code and manual; lessons stand alone, in words."""
    left = chain.from_iterable(
        ((str(path.relative_to(ROOT)), match[0]) for match in IN_WORDS.finditer(text))
        for path, text in (CODE | PAGES).items()
    )
    assert list(left) == []
