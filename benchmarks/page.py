"""The live page at work in Chromium: frames a second, and what a frame costs, equations and drawing.

    python benchmarks/page.py [--quick]

N double pendula of rods of 1 m and 1 kg on a cart of 100 kg, released with level links.  The browser draws at most 60
frames a second; the time of a frame says how much faster it could.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

sys.path.insert(0, str(Path(__file__).parent.parent / "docs"))

import chromium

from modal.scene import Scene, load
from multipendula.page import page, scene_data

NUMBERS, QUICK_NUMBERS = (1, 2, 5, 10, 30), (5,)
SECONDS, QUICK_SECONDS = 5.0, 1.0
MEASURE = """(seconds) => new Promise((done) => {
  const times = [], begun = performance.now(), usual = window.requestAnimationFrame;
  let spent = [];
  window.requestAnimationFrame = (frame) => usual((now) => {
    const before = performance.now();
    frame(now);
    spent.push(performance.now() - before);
    times.push(now);
    if (now - times[0] < 1000 * seconds) return;
    window.requestAnimationFrame = () => 0;
    spent.sort((one, other) => one - other);
    const rate = (times.length - 1) / (times.at(-1) - times[0]) * 1000;
    done([rate, spent[spent.length >> 1], spent[Math.floor(0.99 * spent.length)]]);
  });
})"""


def on_cart(number: int) -> Scene:
    """That many double pendula."""
    pair = load("paper-cart-2")
    return pair.replace(pendulum=(pair.pendulum[0].replace(count=number),))


def main() -> None:
    """Print a line for each number of pendula."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--quick", action="store_true", help="five pendula, one second")
    quick = parser.parse_args().quick
    if chromium.executable() is None:
        print("no Chromium is installed here")
        return
    print("pendula  links  frames/s  frame, median (ms)  99 % below (ms)  without the display's limit (frames/s)")
    with chromium.Chromium(clockwork=False) as browser, TemporaryDirectory() as folder:
        browser.size(1280, 900)
        for number in QUICK_NUMBERS if quick else NUMBERS:
            path = Path(folder) / "page.html"
            path.write_text(page(scene_data(on_cart(number))), encoding="utf-8")
            browser.open(path)
            browser.click("play")
            rate, median, most = browser.run(f"({MEASURE})({QUICK_SECONDS if quick else SECONDS})")
            print(f"{number:7d}  {2 * number:5d}  {rate:8.1f}  {median:18.2f}  {most:15.2f}  {1000 / median:.0f}")


if __name__ == "__main__":
    main()
