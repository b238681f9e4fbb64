"""Screenshots by Chromium: live pages and pages of the manual at three widths, light and dark, and the landing picture.

    python docs/screenshots.py FOLDER [--manual BUILT]    live pages, or pages of the built manual, to be looked at
    python docs/screenshots.py                            docs/pictures/play.png, play-phone.png, dark twins: made anew

Time passes frame by frame (`chromium`), so that the same page gives the same picture.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from tempfile import TemporaryDirectory

from chromium import Chromium
from pictures import HERE, reduce
from playing import build

WIDTHS = {360: 780, 768: 1024, 1280: 900}
"""Heights of the windows by their widths."""
THEMES = {"light": "", "dark": "-dark"}
LANDING, TAPPED = "paper-cart-3", "huygens"
SCENES = (LANDING, "huygens", "clocks-double", "crane-two-loads", "cart-upright", "chain-unequal", "tower")
PAGES = ("index", "tutorial/index", "tutorial/lessons/01_first_table", "play", "explanation/comparison")
"""Of the manual."""
FRAMES = 280
SETTLED = "new Promise((done) => setTimeout(done, 1000))"
"""Frames are loaded, and the live scene has swung for a second."""


def swinging(browser: Chromium, page: Path) -> None:
    """A page some five seconds after its start."""
    browser.open(page)
    browser.frames(FRAMES)


def examined(browser: Chromium, folder: Path, pages: Path) -> None:
    """Every page at every width in both themes, the whole length of it."""
    for width, height in WIDTHS.items():
        for theme, end in THEMES.items():
            browser.size(width, height, dark=theme == "dark")
            for name in SCENES:
                swinging(browser, pages / f"{name}.html")
                (folder / f"{name}-{width}{end}.png").write_bytes(browser.picture(whole=True))


def read(browser: Chromium, folder: Path, manual: Path) -> None:
    """Pages of the built manual, the whole length of them, with their formulas drawn."""
    for width, height in WIDTHS.items():
        for theme, end in THEMES.items():
            browser.size(width, height, dark=theme == "dark")
            for name in PAGES:
                browser.open(manual / f"{name}.html")
                browser.run(f"(window.MathJax?.startup?.promise ?? Promise.resolve()).then(() => {SETTLED})")
                (folder / f"manual-{name.replace('/', '-')}-{width}{end}.png").write_bytes(browser.picture(whole=True))


def landing(browser: Chromium, pages: Path) -> None:
    """The picture on the first page of the manual, and that of a phone on which a mode was tapped."""
    for theme, end in THEMES.items():
        browser.size(1280, 850, dark=theme == "dark", scale=1.15)
        browser.open(pages / f"{LANDING}.html")
        for button in ("hang", "play"):  # from the start of the scene
            browser.click(button)
        browser.run("document.getElementById('status').textContent = ''")
        browser.frames(FRAMES)
        saved(browser, f"play{end}")
        browser.size(390, 844, dark=theme == "dark", scale=1.5)
        browser.open(pages / f"{TAPPED}.html")
        browser.run("document.getElementById('modes-title').scrollIntoView()")
        browser.run("document.querySelectorAll('#rows tr')[2].click()")
        browser.frames(FRAMES)
        saved(browser, f"play-phone{end}")


def saved(browser: Chromium, name: str) -> None:
    """What is seen, as a picture of the manual."""
    path = HERE / "pictures" / f"{name}.png"
    path.write_bytes(browser.picture())
    reduce(path)


def main() -> None:
    """What the arguments ask for."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folder", nargs="?", type=Path, help="for screenshots to look at")
    parser.add_argument(
        "--manual", metavar="BUILT", type=Path, help="the built manual, of which pages are taken instead"
    )
    asked = parser.parse_args()
    if asked.folder:
        asked.folder.mkdir(parents=True, exist_ok=True)
    if asked.folder and asked.manual:
        with Chromium(clockwork=False) as browser:
            read(browser, asked.folder, asked.manual)
        return
    with Chromium() as browser, TemporaryDirectory() as name:
        build(Path(name))
        if asked.folder:
            examined(browser, asked.folder, Path(name))
        else:
            landing(browser, Path(name))


if __name__ == "__main__":
    main()
