"""Every command and every block of code in the README, in the manual and on the help pages, done."""

from __future__ import annotations

import re
from itertools import count
from pathlib import Path

import pytest
from amounts import usually
from documents import KNOWN, ROOT, Page, WrongPageError, agrees, blocks, divided, tokens

from multipendula.commands import COMMANDS, FIRST
from nonlinear.accuracy import work_precision


def lesson(text: str) -> bool:
    """Whether a page is a notebook's twin, which is executed as a notebook."""
    return text.startswith("---\n") and "jupytext:" in text.partition("\n---\n")[0]


def pages() -> dict[str, str]:
    """Texts by name: the README, the manual, and the examples of every help page."""
    files = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
    written = {str(path.relative_to(ROOT)): path.read_text(encoding="utf-8") for path in files}
    helps = {
        f"multipendula {name} --help": "```sh\n" + "".join(f"multipendula {line}\n" for line, _ in examples) + "```\n"
        for name, examples in (("", FIRST), *((command.name, command.examples) for command in COMMANDS))
    }
    return {name: text for name, text in written.items() if not lesson(text)} | helps


PAGES = pages()


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A fresh folder, which is also home; what is timed runs once."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setattr(work_precision, "perf_counter", count().__next__)
    return tmp_path


LONG = ("docs/howto/", "docs/tutorial/", "docs/explanation/")
USUAL = [name for name in PAGES if not name.startswith(LONG)]
"""The README, the help pages, the papers and the reference; the others where everything is asked for, as in CI."""


@pytest.mark.parametrize("name", usually(USUAL, [*PAGES]))
def test_a_page_does_what_it_says(name: str) -> None:
    Page(name).done(PAGES[name])


def wrong(*lines: str) -> str:
    with pytest.raises(WrongPageError) as caught:
        Page("made-up").done("\n".join(lines) + "\n")
    return str(caught.value)


def sh(*lines: str) -> tuple[str, ...]:
    return ("```sh", *lines, "```")


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        (("Words.", "", *sh("multipendula tabel chain-1")), "made-up:3: "),
        (sh("multipendula table chain-1 --modes 7"), "leaves with 2"),
        (sh("multipendula table chain-1 || true"), "leaves with 0"),
        (sh("multipendula response crane-hook --output cart_position"), "leaves with 2"),
        (sh("multipendula scenes nosuch | multipendula table -"), "no such shipped scene"),
        (("```text", "$ multipendula matrices chain-1", "M = 2", "```"), "this was printed instead"),
        (("```console", "multipendula scenes", "```"), "begins with a command"),
        (sh("pip install '.[nosuch]'"), "nobody knows how to do"),
        (sh("curl example.org"), "nobody knows how to do `curl example.org`"),
        (sh("python benchmarks/modes.py --wrong"), "has no --wrong"),
        (sh("python benchmarks/nosuch.py"), "No such file"),
        ((*sh("multipendula matrices chain-1"), "", "```", "M = 2", "```"), "this was printed instead"),
        (("```", "M = 2", "```"), "nothing before it that prints"),
        (("```rust", "fn main() {}", "```"), "nobody knows how to do 'rust'"),
        (("```{code-block} sh", "multipendula scenes", "```"), "nobody knows"),
        (("````{note}", *sh("multipendula nosuch"), "````"), "made-up:2: "),
        (("```python", "assert False", "```"), "AssertionError"),
        (("```toml", "gravity = -1.0", "```"), "gravity = -1.0: must be positive"),
        (("```toml", "[support]", 'kind = "fixed"', "```"), "gravity: is required"),
        (("```toml fragment", "[support]", 'kind = "rope"', "```"), "support"),
        (("```json", "{1: 2}", "```"), "JSONDecodeError"),
        (("Words.", "", "    multipendula scenes"), "commands stand in a fenced block"),
        (("Words.", "", "    import modal"), "Python stands in a fenced block"),
        (("Words.", "", "    [[pendulum]]", '    links = [{ kind = "bob" }]'), "TOML stands in a fenced block"),
        (("Type `multipendula table nosuch`.",), "no such shipped scene"),
        (("Type `multipendula tabel SCENE`.",), "there is no command tabel"),
        (("| a |", "|---|", "| `multipendula table SCENE --wrong` |"), "table has no --wrong"),
    ],
)
def test_a_wrong_page_is_found_out(lines: tuple[str, ...], said: str) -> None:
    assert said in wrong(*lines)


def test_a_right_page_passes(folder: Path) -> None:
    text = """
```sh
multipendula scenes chain-2 > two.toml            # a file
sed -i.bak "s/bobs/pearls/" two.toml
multipendula scenes chain-1 | multipendula matrices - \\
  --format text
multipendula table two.toml --modes 9 || true
```

```text
coordinates (1): θ₁₁
…
D …
multipendula: --modes 9: …
multipendula: see `multipendula table --help`
```

```toml fragment
[support]
kind = "cart"
mass = 1.0
```

```python
x = 1
```

```python
print(x + 1)
```

```
2
```

```console
$ multipendula shaper chain-9 --count 1
multipendula: chain-9: no such …
$ multipendula scenes --schema -o schema.json
```

With `pip install ".[fast]"` and `multipendula table SCENE --modes 1:3`, ω² = g/l:

    ω² = g/l
"""
    Page("right").done(text)
    assert (folder / "two.toml").is_file()


@pytest.mark.parametrize(
    ("shown", "printed", "same"),
    [
        ("a\nb\n", "a  \nb\n\n", True),
        ("a\nb\n", "a\nb\nc\n", False),
        ("a\n…\nc\n", "a\nb\nb\nc\n", True),
        ("a\n…\nc\n", "a\nb\nd\n", False),
        ("took … s\n", "took 3.1 s\n", True),
        ("took … s\n", "took 3.1 h\n", False),
    ],
)
def test_outputs_are_compared(shown: str, printed: str, same: bool) -> None:
    assert agrees(shown, printed) == same


def told(line: str) -> list[str]:
    """The words of a command, its programs without their folders and its environments without their names."""
    words = [word.rpartition("/")[2] if "bin/" in word else word for word in line.replace('"', "").split()]
    return [word for word in words if not word.endswith("venv") or word == "venv"]


def within(words: list[str], line: list[str]) -> bool:
    """Whether words stand in a line in their order, others between them."""
    rest = iter(line)
    return all(word in rest for word in words)


def test_what_is_not_run_here_is_run_in_ci() -> None:
    steps = [told(line) for line in (ROOT / ".ci" / "run").read_text(encoding="utf-8").splitlines()]
    (tests,) = (text for text in shell_lines("README.md") if text.endswith("/pytest"))
    pieces = [" ".join(piece) for piece in divided(list(tokens(tests)), "&&")]
    assert len(pieces) == 3
    for piece in (*pieces, ".venv/bin/pip install .", ".venv/bin/multipendula table paper-cart-2"):
        words = told(piece)
        assert any(within(words, step) for step in steps), piece
    assert set(pieces) <= KNOWN


def shell_lines(name: str) -> list[str]:
    return [line for block in blocks(PAGES[name]) if block.language == "sh" for line in block.text.splitlines()]


def test_the_search_in_ci_bites() -> None:
    assert not within(["pip", "install", "x"], ["pip", "x", "install"])
    assert told('"$work/venv/bin/pip" install .') == ["pip", "install", "."]


def test_every_page_of_the_manual_is_there() -> None:
    assert "README.md" in PAGES
    assert sum(name.startswith("docs") for name in PAGES) >= 10
    assert all(re.search(r"multipendula .*--help", name) for name in PAGES if not name.endswith(".md"))
