"""The manual: `sphinx-build -n -W --keep-going -b html docs docs/_build/html`.

Lessons are copied from `notebooks/` to `docs/tutorial/lessons/` and run, once for as long as they do not change, or
they are copied as they are from the folder that LESSONS names, where they were run before.
"""

from __future__ import annotations

import os
import sys
from importlib.metadata import version as version_of
from pathlib import Path

from sphinx.application import Sphinx

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE.parent), str(HERE)]

import browser  # noqa: E402
import docstrings  # noqa: E402
import generated  # noqa: E402
import mathematics  # noqa: E402
import playing  # noqa: E402

project = "multipendula"
author = copyright = "The multipendula authors"
version = release = version_of(project)

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx_copybutton", "sphinx_design", "sphinxcontrib.bibtex"]
bibtex_bibfiles = ["references.bib"]
bibtex_reference_style = "author_year"
bibtex_default_style = "plain"
exclude_patterns = ["_build", "**/.ipynb_checkpoints"]
myst_enable_extensions = ["amsmath", "attrs_inline", "colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3
nb_execution_mode = "off" if os.environ.get("LESSONS") else "cache"
nb_execution_raise_on_error = True
nb_execution_timeout = 180
nb_merge_streams = True

autodoc_default_options = {"members": True, "member-order": "bysource"}
autodoc_class_signature = "mixed"
autodoc_preserve_defaults = True
add_module_names = False
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 80
# Types in signatures: others' (no inventory is fetched), or machinery; and an error that only extensions raise.
nitpick_ignore_regex = [("py:class", ".*"), ("py:exc", "ExtensionError")]
suppress_warnings = ["ref.python"]  # types that are imported for the type checker alone, by names that stand twice

html_theme = "furo"
html_title = "multipendula"
templates_path = ["_templates"]
html_static_path = ["_static"]
html_css_files = ["manual.css"]
html_js_files = [("manual.js", {"defer": "defer"})]
html_copy_source = False
html_theme_options = {
    "top_of_page_buttons": [],
    "light_css_variables": {"color-brand-primary": "#0067a0", "color-brand-content": "#0067a0"},
    "dark_css_variables": {"color-brand-primary": "#56b4e9", "color-brand-content": "#56b4e9"},
}
pygments_style, pygments_dark_style = "a11y-high-contrast-light", "a11y-high-contrast-dark"
highlight_language = "none"
smartquotes = False
copybutton_prompt_text = "$ "


def copy_lessons(*_: object) -> None:
    """Bring the lessons into the manual; one that has not changed keeps its time, so that it is not run again.

    What leads from `notebooks/` to a page of the manual leads there from `docs/tutorial/lessons/` too.
    """
    source = Path(os.environ.get("LESSONS") or HERE.parent / "notebooks")
    target = HERE / "tutorial" / "lessons"
    target.mkdir(parents=True, exist_ok=True)
    notebooks = sorted(source.glob("[0-9][0-9]_*.ipynb"))
    lessons = {lesson.name: lesson.read_bytes().replace(b"](../docs/", b"](../../") for lesson in notebooks}
    for stale in target.glob("*.ipynb"):
        if stale.name not in lessons:
            stale.unlink()
    for name, content in lessons.items():
        if not (copy := target / name).exists() or copy.read_bytes() != content:
            copy.write_bytes(content)


def expand(app: Sphinx, docname: str, source: list[str]) -> None:
    """Put what is made from the code in its place on a page."""
    page = Path(app.env.doc2path(docname))
    if page.suffix == ".md":
        for maker in (generated, playing) if generated.PLACE.search(source[0]) else ():
            app.env.note_dependency(maker.__file__, docname=docname)
        source[0] = generated.expanded(source[0], page.parent)


def add_browser(app: Sphinx, failure: Exception | None) -> None:
    """Put the live pages next to the pages, and, but for a part (`-t part`), the lessons that run in a browser."""
    if failure is None and app.builder.name == "html":
        playing.build(Path(app.outdir) / "play")
        if not app.tags.has("part"):
            browser.build(Path(app.outdir) / "browser")


def setup(app: Sphinx) -> None:
    """What Sphinx calls."""
    app.connect("config-inited", copy_lessons)
    app.connect("source-read", expand)
    app.connect("build-finished", add_browser)
    docstrings.setup(app)
    mathematics.setup(app)
