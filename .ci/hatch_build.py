"""What hatch asks while it builds: whether the Modal cloud client is in the way, and the README for a package index."""

import re
from pathlib import Path
from sysconfig import get_path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface
from hatchling.metadata.plugin.interface import MetadataHookInterface

REFUSAL = """\
The distribution 'modal' (the Modal cloud client) is installed in
{place}.
Its package and one of multipendula's are both called 'modal' and would overwrite each other's files, so nothing was
installed. Install multipendula in a virtual environment of its own:

    python3 -m venv pendula
    pendula/bin/pip install .
"""


def namesake(*places: str) -> str | None:
    """The first of these folders of packages in which the Modal cloud client is installed."""
    return next((place for place in places if any(Path(place).glob("modal-*.dist-info"))), None)


class NamesakeHook(BuildHookInterface[Any]):
    """Looks where pip is going to install: it builds with the interpreter of that environment."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Stop a build of a wheel."""
        if place := namesake(get_path("purelib"), get_path("platlib")):
            self.app.abort(REFUSAL.format(place=place))


def for_index(readme: str) -> str:
    """The README without its pictures and without what leads to files: an index of packages has neither."""
    pictures = r"<picture>.*?</picture>\n*|!\[[^\]]*\]\((?!https?:)[^)]*\)\n*"
    return re.sub(r"\[([^\]]*)\]\((?!https?:)[^)]*\)", r"\1", re.sub(pictures, "", readme, flags=re.DOTALL))


class ReadmeHook(MetadataHookInterface):
    """The description of the package."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Set what `pyproject.toml` calls dynamic."""
        text = for_index((Path(self.root) / "README.md").read_text(encoding="utf-8"))
        metadata["readme"] = {"content-type": "text/markdown", "text": text}
