"""A Chromium without a window, driven through a pipe by the DevTools protocol.

    with Chromium() as browser:
        browser.open(Path("page.html"))
        browser.run("document.title")

Nothing but the browser is needed.
"""

from __future__ import annotations

import fcntl
import json
import os
import shutil
import signal
import time
from base64 import b64decode
from pathlib import Path
from tempfile import TemporaryDirectory
from types import TracebackType
from typing import Any, Self

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
FLAGS = ("--headless=new", "--no-sandbox", "--disable-gpu", "--remote-debugging-pipe")
CLOCKWORK = """(() => {
  const queue = [];
  let now = 0;
  window.requestAnimationFrame = (frame) => queue.push(frame);
  performance.now = () => now;
  window.tick = (count) => {
    for (let i = 0; i < count; i++) {
      now += 1000 / 60;
      for (const frame of queue.splice(0)) frame(now);
    }
  };
})()"""
"""A clock of 60 frames a second that goes on by `tick`."""
PATIENCE = 5.0  # s that a browser has to end
TOUCHED = 3  # the descriptors on which the browser reads, and one further on which it writes


def executable() -> str | None:
    """The path of a browser; None where none is installed."""
    return next(filter(None, map(shutil.which, NAMES)), None)


class Chromium:
    """A browser with one page; `errors` are the exceptions and complaints that the page has not caught.

    With `clockwork` no time passes in its pages but by `frames`, so that the same calls show the same picture.
    """

    def __init__(self, *, clockwork: bool = True) -> None:
        self.errors: list[str] = []
        self._folder = TemporaryDirectory(ignore_cleanup_errors=True)
        (theirs_in, self._out), (self._in, theirs_out) = os.pipe(), os.pipe()
        theirs = [fcntl.fcntl(end, fcntl.F_DUPFD_CLOEXEC, 10) for end in (theirs_in, theirs_out)]
        arranged = [(os.POSIX_SPAWN_DUP2, end, TOUCHED + place) for place, end in enumerate(theirs)]
        quiet = (os.POSIX_SPAWN_OPEN, 2, os.devnull, os.O_WRONLY, 0)
        command = [executable() or NAMES[0], *FLAGS, f"--user-data-dir={self._folder.name}", "about:blank"]
        self._process = os.posix_spawnp(command[0], command, os.environ, file_actions=[*arranged, quiet])
        for end in (theirs_in, theirs_out, *theirs):
            os.close(end)
        self._left, self._count, self._session, self._loaded = b"", 0, "", False
        target = next(info for info in self.call("Target.getTargets")["targetInfos"] if info["type"] == "page")
        self._session = self.call("Target.attachToTarget", targetId=target["targetId"], flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log"):
            self.call(f"{domain}.enable")
        if clockwork:
            self.call("Page.addScriptToEvaluateOnNewDocument", source=CLOCKWORK)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """End the browser and remove what it wrote."""
        os.close(self._out)
        begun = time.monotonic()
        while os.waitpid(self._process, os.WNOHANG) == (0, 0):
            if time.monotonic() - begun > PATIENCE:
                os.kill(self._process, signal.SIGKILL)
            time.sleep(0.01)
        os.close(self._in)
        self._folder.cleanup()

    def call(self, method: str, **parameters: Any) -> Any:
        """The answer to a command of the protocol; RuntimeError where it is refused."""
        self._count += 1
        message = {"id": self._count, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        left = json.dumps(message).encode() + b"\0"
        while left:
            left = left[os.write(self._out, left) :]
        while (answer := self._read()).get("id") != self._count:
            self._note(answer)
        if "error" in answer:
            raise RuntimeError(f"{method}: {answer['error']['message']}")
        return answer["result"]

    def _read(self) -> dict[str, Any]:
        while b"\0" not in self._left:
            piece = os.read(self._in, 1 << 20)
            if not piece:
                raise RuntimeError("the browser has ended")
            self._left += piece
        line, _, self._left = self._left.partition(b"\0")
        message: dict[str, Any] = json.loads(line)
        return message

    def _note(self, event: dict[str, Any]) -> None:
        parameters = event.get("params", {})
        self._loaded |= event.get("method") == "Page.loadEventFired"
        if event.get("method") == "Runtime.exceptionThrown":
            details = parameters["exceptionDetails"]
            self.errors.append(details.get("exception", {}).get("description") or details["text"])
        if event.get("method") == "Log.entryAdded" and parameters["entry"]["level"] == "error":
            self.errors.append(parameters["entry"]["text"])

    def open(self, page: Path, fragment: str = "") -> None:
        """Show a file, and wait until it is loaded."""
        for url in ("about:blank", page.absolute().as_uri() + fragment):
            self._loaded = False
            self.call("Page.navigate", url=url)
            while not self._loaded:
                self._note(self._read())

    def run(self, code: str) -> Any:
        """The value of an expression in the page, awaited where it is a promise; RuntimeError with its exception."""
        answer = self.call("Runtime.evaluate", expression=code, awaitPromise=True, returnByValue=True)
        if "exceptionDetails" in answer:
            details = answer["exceptionDetails"]
            raise RuntimeError(details.get("exception", {}).get("description") or details["text"])
        return answer["result"].get("value")

    def frames(self, count: int) -> None:
        """Let that many sixtieths of a second pass in a page with clockwork."""
        self.run(f"tick({count})")

    def click(self, name: str) -> None:
        """Press the element with this id."""
        self.run(f"document.getElementById({json.dumps(name)}).click()")

    def size(self, width: int, height: int, *, dark: bool = False, still: bool = False, scale: float = 1) -> None:
        """The size of the window, and what its user prefers; scrollbars take no room."""
        mobile = width < 600
        self.call(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=scale, mobile=mobile
        )
        self.call("Emulation.setScrollbarsHidden", hidden=True)
        wishes = {
            "prefers-color-scheme": "dark" if dark else "light",
            "prefers-reduced-motion": "reduce" if still else "no-preference",
        }
        self.call(
            "Emulation.setEmulatedMedia", features=[{"name": name, "value": value} for name, value in wishes.items()]
        )

    def show_scrollbars(self) -> None:
        """Scrollbars take room from the page, as on most desktops, until the next `size`."""
        self.call("Emulation.setScrollbarsHidden", hidden=False)

    def picture(self, *, whole: bool = False) -> bytes:
        """What is seen as PNG, or the whole page however long."""
        answer = self.call("Page.captureScreenshot", format="png", captureBeyondViewport=whole)
        return b64decode(answer["data"])

    def press(self, key: str, code: str = "", text: str = "") -> None:
        """A key, down and up."""
        for kind in ("keyDown", "keyUp"):
            typed = {"text": text} if text and kind == "keyDown" else {}
            self.call("Input.dispatchKeyEvent", type=kind, key=key, code=code or key, **typed)

    def drag(self, *points: tuple[float, float]) -> None:
        """The mouse from the first point to the others with its button down, and up at the last."""
        (x, y), *_ = points
        self.call("Input.dispatchMouseEvent", type="mousePressed", x=x, y=y, button="left", clickCount=1)
        for x, y in points[1:]:
            self.call("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y, button="left", buttons=1)
        self.call("Input.dispatchMouseEvent", type="mouseReleased", x=x, y=y, button="left", clickCount=1)

    def swipe(self, *points: tuple[float, float]) -> None:
        """A finger from the first point to the others, lifted at the last."""
        for place, (x, y) in enumerate(points):
            self.call(
                "Input.dispatchTouchEvent", type="touchMove" if place else "touchStart", touchPoints=[{"x": x, "y": y}]
            )
        self.call("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])
