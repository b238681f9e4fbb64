"""Formulas drawn in the browser without a network: MathJax next to the pages, where npm or a folder has it.

It is looked for in the folder that MATHJAX names (`node_modules/mathjax`), in `node_modules` of this project, and among
what was fetched before; then npm's registry is asked for the version below, held to its digest.  Where none of that
helps the pages refer to the usual network of copies, so that formulas need a connection.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tarfile
from base64 import b64encode
from hashlib import sha512
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sphinx.application import Sphinx
    from sphinx.config import Config

ROOT = Path(__file__).parent.parent
VERSION = "4.1.3"
FONT = "@mathjax/mathjax-newcm-font"
DIGESTS = {
    "mathjax": "BN/8Pkgn7G1pIDYJqd9md+JHsE/jydSYbyOZnSdSA0WziuVO8mRxdYiWFumkVVly/8U+hm9DpIIoWuvySverzw==",
    FONT: "gzAB3dFHilHX1l5x2xUqRL+1jDQt3Fyza1DkEMVXWC4E8SvsGdlgEza47HYi2WhVcgfkvf4zgUGzuhbq3Pjlew==",
}
"""SHA-512 of npm's archives of this version."""
PARTS = {
    "mathjax": ("LICENSE", "tex-svg.js", "a11y/assistive-mml.js", "input/tex/extensions"),
    FONT: ("svg/dynamic",),
}
"""What a page may load of each package: the rest of the font is in `tex-svg.js`."""
FETCHED = ROOT / "docs" / "_build" / f"mathjax-{VERSION}"
ELSEWHERE = f"https://cdn.jsdelivr.net/npm/mathjax@{VERSION}/tex-svg.js"
PATIENCE = 120.0  # s that npm has for a package

OPTIONS = {
    "loader": {"load": ["a11y/assistive-mml"]},
    "options": {
        "enableMenu": False,
        "menuOptions": {"settings": {"enrich": False, "speech": False, "braille": False, "assistiveMml": True}},
        **{f"enable{what}": False for what in ("Speech", "Braille", "Explorer", "Enrichment", "Complexity")},
        "enableAssistiveMml": True,
    },
    "output": {"displayOverflow": "linebreak"},
    "tex": {"macros": {"qquad": r"\hskip 2em\goodbreak"}},
}
"""Screen readers get MathML; speech and its explorer, which need workers and a server, are omitted.  A display that is
wider than its place is broken into lines, between two equations where it has several."""
SERVED = {**OPTIONS, "loader": {**OPTIONS["loader"], "paths": {"fonts": "[mathjax]"}}}
"""With the font next to MathJax."""


def packages_of() -> dict[str, Path] | None:
    """The folder of each package; None where they are not to be had."""
    named = os.environ.get("MATHJAX")
    for folder in [Path(named)] if named else [ROOT / "node_modules" / "mathjax", FETCHED / "mathjax"]:
        packages = {"mathjax": folder, FONT: folder.parent / FONT}
        if all((packages[name] / part).exists() for name, parts in PARTS.items() for part in parts):
            return packages
    return None if named else fetched()


def fetched() -> dict[str, Path] | None:
    """The packages from npm's registry; None where there is no npm, no network, or another archive."""
    npm = shutil.which("npm")
    if npm is None:
        return None
    with TemporaryDirectory() as name:
        for package, digest in DIGESTS.items():
            folder = Path(name) / package
            folder.mkdir(parents=True)
            if not unpacked(npm, package, digest, folder):
                return None
        shutil.rmtree(FETCHED, ignore_errors=True)
        FETCHED.parent.mkdir(exist_ok=True)
        shutil.copytree(name, FETCHED)
    return {package: FETCHED / package for package in DIGESTS}


def unpacked(npm: str, package: str, digest: str, folder: Path) -> bool:
    """Fetch a package and put its parts into the folder; False where that fails or the archive is another one."""
    try:
        subprocess.run(
            [npm, "pack", "--silent", "--fetch-retries=1", f"{package}@{VERSION}"],
            cwd=folder, capture_output=True, check=True, timeout=PATIENCE,
        )  # fmt: skip
    except (subprocess.SubprocessError, OSError):
        return False
    (archive,) = folder.glob("*.tgz")
    if b64encode(sha512(archive.read_bytes()).digest()).decode() != digest:
        print(f"mathematics: npm's {package} {VERSION} is not the known archive and is not used", file=sys.stderr)
        return False
    with tarfile.open(archive) as opened:
        for member in opened.getmembers():
            member.name = member.name.removeprefix("package/")
            if member.name.startswith(PARTS[package]):
                opened.extract(member, folder, filter="data")
    archive.unlink()
    return True


def choose(app: Sphinx, config: Config) -> None:
    """Where the pages load MathJax from."""
    packages = packages_of()
    config.mathjax_path = "mathjax/tex-svg.js" if packages else ELSEWHERE
    config.mathjax4_config = SERVED if packages else OPTIONS
    if packages is None:
        wanted = "the folder in MATHJAX has not all of it" if os.environ.get("MATHJAX") else "npm cannot fetch it"
        print(f"mathematics: no MathJax beside the pages ({wanted}): formulas need a network", file=sys.stderr)
    app.connect("builder-inited", lambda app: serve(packages, Path(app.outdir) / "_static" / "mathjax"))


def serve(packages: dict[str, Path] | None, folder: Path) -> None:
    """Copy what pages load into a folder, replacing what was there."""
    shutil.rmtree(folder, ignore_errors=True)
    for name, parts in PARTS.items() if packages else ():
        target = folder / (FONT.rpartition("/")[2] if name == FONT else "")
        for part in parts:
            source = packages[name] / part
            (target / part).parent.mkdir(parents=True, exist_ok=True)
            (shutil.copytree if source.is_dir() else shutil.copy)(source, target / part)


def setup(app: Sphinx) -> None:
    """What Sphinx calls."""
    app.connect("config-inited", choose)
