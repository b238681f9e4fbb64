"""Make the pictures of `pictures.toml` anew, light and dark: `python docs/pictures.py [NAME ...]`."""

from __future__ import annotations

import shlex
import sys
import tomllib
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image

from multipendula.cli import main

HERE = Path(__file__).parent
TABLE = HERE / "pictures.toml"
COLOURS = 256
"""Of a reduced PNG: enough that none is seen to be missing."""


def table() -> dict[str, dict[str, str]]:
    """Every picture by its name."""
    return tomllib.loads(TABLE.read_text(encoding="utf-8"))


def files(name: str, picture: dict[str, str]) -> dict[str, Path]:
    """Where a picture is in each theme."""
    form = picture.get("form", "png")
    return {theme: HERE / "pictures" / f"{name}{end}.{form}" for theme, end in (("light", ""), ("dark", "-dark"))}


def make(name: str, picture: dict[str, str]) -> None:
    """Compute once what is computed before, and draw in both themes."""
    with TemporaryDirectory() as folder:
        run = str(Path(folder) / "run.npz")
        if "before" in picture:
            _do(picture["before"].format(run=run))
        for theme, path in files(name, picture).items():
            _do(f"{picture['command']} --theme {theme}".format(run=run, out=path))
            if path.suffix == ".png":
                reduce(path)


def _do(command: str) -> None:
    print("multipendula", command, file=sys.stderr)
    if main(shlex.split(command)):
        raise SystemExit(f"failed: {command}")


def reduce(path: Path) -> None:
    """Fewer colours, where that makes a smaller file."""
    buffer, whole = BytesIO(), Image.open(path).convert("RGB")
    fewer = whole.quantize(COLOURS, method=Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
    fewer.save(buffer, "PNG", optimize=True)
    if buffer.tell() < path.stat().st_size:
        path.write_bytes(buffer.getvalue())


if __name__ == "__main__":
    known = table()
    asked = sys.argv[1:] or list(known)
    if unknown := [name for name in asked if name not in known]:
        raise SystemExit(f"no picture is called {', '.join(unknown)}: choose from {', '.join(known)}")
    for name in asked:
        make(name, known[name])
