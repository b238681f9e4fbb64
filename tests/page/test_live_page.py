"""The page in Chromium as its user meets it: by mouse, keys and links, at every width, light and dark."""

from __future__ import annotations

import json
from base64 import b64encode
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from amounts import usually
from chromium import Chromium
from live import BROWSER, axe, written
from scipy.optimize import brentq

from modal import Bob, Cart, Pendulum, Scene, natural_modes
from modal.scene import Moved, SineMotion, load, parse, scene_from
from multipendula.page import recording_of, scene_data
from nonlinear import simulate
from nonlinear.system import initial_state

pytestmark = BROWSER

WIDTHS = (360, 768, 1280)


@pytest.fixture
def shown(browser: Chromium, tmp_path: Path) -> Chromium:
    """Two double pendula on a cart, hanging still."""
    browser.errors.clear()
    browser.size(1280, 900, still=True)
    browser.open(written(load("paper-cart-2"), tmp_path))
    return browser


def text(browser: Chromium, name: str) -> str:
    return str(browser.run(f"document.getElementById({json.dumps(name)}).textContent"))


def cells(browser: Chromium) -> list[list[str]]:
    texts: list[list[str]] = browser.run(
        "[...document.querySelectorAll('#rows tr')].map((row) => [...row.cells].map((cell) => cell.textContent))"
    )
    return texts


def file_of(browser: Chromium) -> str:
    """The scene file that the page offers to copy."""
    browser.run("navigator.clipboard.writeText = () => Promise.reject(new Error('none'))")
    browser.click("file")
    toml = str(browser.run("document.getElementById('paper').value"))
    browser.run("document.getElementById('sheet').close()")
    return toml


def enter(browser: Chromium, label: str, value: float) -> None:
    """A number typed next to a slider."""
    browser.run(
        f"""(() => {{ const box = document.querySelector('input[aria-label^={json.dumps(label)}]');
        box.value = {value!r}; box.dispatchEvent(new Event('change')); }})()"""
    )


def test_the_table_shows_the_modes(shown: Chromium) -> None:
    modes, rows = natural_modes(load("paper-cart-2")), cells(shown)
    assert len(rows) == len(modes)
    for row, mode in zip(rows[1:], list(modes)[1:], strict=True):
        assert float(row[1]) == pytest.approx(mode.frequency, rel=1e-4)
        assert float(row[2]) == pytest.approx(mode.period, rel=1e-4)
        assert float(row[4]) == pytest.approx(mode.linear_to_1_percent_deg, rel=1e-2)
        assert row[0].startswith(f"{mode.number}{'*' * bool(mode.resonances)}{mode.family}")
    assert float(rows[1][3]) == pytest.approx(2 * np.pi / (modes.omega[2] - modes.omega[1]), rel=1e-3)
    assert [row[3] for row in rows] == ["–", rows[1][3], "–", rows[3][3], "–"]
    assert shown.errors == []


LIGHT_CART = """gravity = 9.81
[support]
kind = "cart"
mass = 2
[[pendulum]]
links = [{ kind = "bob", mass = 1, length = 1 }]
[[pendulum]]
links = [{ kind = "bob", mass = 1, length = 1.5 }]
"""


def test_a_motion_too_fast_to_follow_does_not_freeze_the_page(browser: Chromium, tmp_path: Path) -> None:
    """A bob of 1e12 kg shakes its cart a million times a second: a frame ends with its milliseconds."""
    browser.errors.clear()
    browser.size(1280, 900, still=True)
    browser.open(written(parse(LIGHT_CART.encode()), tmp_path))
    browser.run("(() => { let asked = 0; performance.now = () => ++asked; })()")
    enter(browser, "Mass", 1e12)
    browser.click("kick")
    browser.frames(10)
    assert text(browser, "time") == "0.00 s"
    assert not browser.run("document.getElementById('behind').hidden")
    assert browser.errors == []


def test_a_link_to_a_scene_beyond_double_precision_shows_the_page_s_own(shown: Chromium, tmp_path: Path) -> None:
    scene = {"gravity": 9.81, "support": {"kind": "cart", "mass": 1e-300, "stiffness": 1e300}}
    scene |= {"pendulum": [{"links": [{"kind": "bob", "mass": 1.0, "length": 1.0}]}]}
    state = b64encode(json.dumps({"scene": scene}).encode()).decode().rstrip("=")
    shown.open(written(load("paper-cart-2"), tmp_path), f"#{state}")
    assert len(cells(shown)) == 5
    assert "holds no scene" in text(shown, "status")
    assert shown.errors == []


def test_a_drive_that_nothing_can_follow_stops_the_motion(shown: Chromium, tmp_path: Path) -> None:
    scene = {"gravity": 9.81, "support": {"kind": "cart", "mass": 2.0}}
    scene |= {"pendulum": [{"links": [{"kind": "bob", "mass": 1.0, "length": 1.0}]}]}
    scene = scene_data(scene_from(scene))
    state = {"scene": scene, "drive": {"on": True, "amount": 1e300, "frequency": 1e300}}
    packed = b64encode(json.dumps(state).encode()).decode().rstrip("=")
    shown.open(written(scene_from(scene), tmp_path), f"#{packed}")
    shown.click("play")
    shown.frames(20)
    assert "too fast" in text(shown, "status")
    assert shown.errors == []


def test_numbers_follow_a_change_at_once(shown: Chromium) -> None:
    scene = load("paper-cart-2")
    enter(shown, "Cart mass", 5.0)
    enter(shown, "Length", 0.7)
    support = scene.support.replace(mass=5.0)
    first = scene.pendulum[0].replace(
        links=(scene.pendulum[0].links[0].replace(length=0.7, count=1), scene.pendulum[0].links[0].replace(count=1))
    )
    modes = natural_modes(scene.replace(support=support, pendulum=(first, scene.pendulum[1])))
    assert [float(row[1]) for row in cells(shown)] == pytest.approx([mode.frequency for mode in modes], rel=1e-4)
    slider = "document.querySelector('#of-cart input[type=range]')"
    shown.run(f"{slider}.value = 0, {slider}.dispatchEvent(new Event('input'))")
    assert parse(file_of(shown).encode()).support.mass == 1.0
    assert shown.errors == []


def test_a_refused_number_is_said_beside_it_and_the_old_one_stays(shown: Chromium) -> None:
    told = "document.querySelector('input[aria-label^=\"Cart mass\"] + .refused')"
    assert shown.run(f"{told}.hidden")
    before = cells(shown)
    for value, why in (("-1", "it must be above 0"), ("", "a number is needed"), ("0", "it must be above 0")):
        shown.run(
            f"""(() => {{ const box = document.querySelector('input[aria-label^="Cart mass"]');
            box.focus(); box.value = {value!r}; box.dispatchEvent(new Event('change')); }})()"""
        )
        assert shown.run(f"{told}.textContent") == f"Cart mass: {why}. It stays 100 kg."
        assert shown.run(f"[{told}.getAttribute('role'), {told}.previousSibling.getAttribute('aria-invalid')]") == [
            "alert",
            "true",
        ]
        assert shown.run(f"[{told}.previousSibling.value, {told}.hidden]") == ["100", False]
    assert cells(shown) == before
    enter(shown, "Cart mass", 50.0)
    assert shown.run(f"{told}.hidden")
    assert cells(shown) != before
    assert shown.errors == []


@pytest.mark.parametrize(("width", "height"), [(390, 844), (360, 640)])
def test_on_a_phone_the_scene_stays_in_sight_when_a_mode_is_tapped(
    browser: Chromium, tmp_path: Path, width: int, height: int
) -> None:
    browser.size(width, height, still=True)
    browser.open(
        written(Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=1.0, length=0.2, count=9)])]), tmp_path)
    )
    browser.run("document.querySelectorAll('#rows tr')[6].scrollIntoView({ block: 'end' })")
    browser.run("document.querySelectorAll('#rows tr')[6].click()")
    browser.frames(4)
    box = "(({ top, bottom }) => [top, bottom])(%s.getBoundingClientRect())"
    top, bottom = browser.run(box % "document.getElementById('scene')")
    assert (top, browser.run("scrollY") > 100) == (0, True)
    row_top, row_bottom = browser.run(box % "document.querySelectorAll('#rows tr')[6]")
    assert bottom <= row_top < row_bottom <= height + 1
    assert browser.errors == []


def test_friction_is_shown_and_changed(browser: Chromium, tmp_path: Path) -> None:
    link = Bob(mass=1.0, length=1.0, friction=0.2)
    cart = Cart(mass=2.0, friction=50.0)
    browser.errors.clear()
    browser.size(1280, 900, still=True)
    browser.open(written(Scene(gravity=9.81, support=cart, pendulum=[Pendulum(links=[link])]), tmp_path))
    browser.click("kick")
    browser.frames(6)
    assert text(browser, "stuck") == "rail"
    enter(browser, "Cart friction", 0.1)
    browser.frames(12)
    assert text(browser, "stuck") == "nothing"
    enter(browser, "Friction", 30.0)
    browser.frames(200)
    assert "link 1" in text(browser, "stuck")
    scene = parse(file_of(browser).encode())
    assert (scene.support.friction, scene.pendulum[0].links[0].friction) == (0.1, 30.0)
    assert "Dry friction" in text(browser, "left-out")
    browser.click("link")
    browser.open(tmp_path / "page.html", browser.run("location.hash"))
    assert "friction = 30.0" in file_of(browser)
    assert browser.errors == []


def test_a_row_sets_its_mode_swinging(shown: Chromium) -> None:
    shown.run("document.querySelectorAll('#rows tr')[2].click()")
    shown.frames(30)
    assert shown.run("document.querySelectorAll('#rows button')[2].getAttribute('aria-pressed')") == "true"
    assert text(shown, "status") == "Mode 3 swings."
    assert float(text(shown, "time").split()[0]) > 0.1
    shown.click("play")
    state = initial_state(parse(file_of(shown).encode()))
    shape = natural_modes(load("paper-cart-2")).shape(2).angles
    across = state.links - shape * (state.links @ shape) / (shape @ shape)
    assert np.abs(across).max() < 0.02 * np.radians(10)


@pytest.mark.parametrize(
    ("scene", "number", "frequency", "said"),
    [
        (load("paper-cart-2"), 1, "0", "Mode 1 shifts everything alike."),
        (load("cart-upright"), None, "grows", "grows."),
        (
            Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0, damping=10.0)])]),
            1,
            "decays",
            "Mode 1 decays without a swing.",
        ),
        (
            Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0, damping=1.0)])]),
            1,
            f"{np.sqrt(9.81) / (2 * np.pi):.5g}",
            "Mode 1 swings.",
        ),
    ],
    ids=["translation", "unstable", "overdamped", "damped"],
)
def test_a_mode_that_does_not_swing_is_not_said_to(
    browser: Chromium, tmp_path: Path, scene: Scene, number: int | None, frequency: str, said: str
) -> None:
    """Overdamped from d = 2 m l² √(g/l) on: 6.26 N m s for 1 kg at 1 m."""
    browser.size(1280, 900, still=True)
    browser.open(written(scene, tmp_path))
    rows = cells(browser)
    row = next(k for k, texts in enumerate(rows) if texts[1] == frequency) if number is None else number - 1
    assert rows[row][1] == frequency
    browser.run(f"document.querySelectorAll('#rows tr')[{row}].click()")
    browser.frames(2)
    assert text(browser, "status").endswith(said)
    assert browser.errors == []


def centre(browser: Chromium) -> tuple[float, float]:
    """The middle of the scene."""
    left, top, width, height = browser.run(
        "(({ x, y, width, height }) => [x, y, width, height])(window.scene.getBoundingClientRect())"
    )
    return left + width / 2, top + height / 2


def test_a_bob_is_pulled_and_let_go(browser: Chromium, tmp_path: Path) -> None:
    browser.size(1280, 900, still=True)
    browser.open(written(load("chain-1"), tmp_path))
    browser.frames(1)
    x, y = centre(browser)
    browser.run("(({ speed }) => { speed.value = '0.1'; speed.dispatchEvent(new Event('change')); })(window)")
    bob = next(y + step for step in range(-40, 240, 4) if browser.run(cursor(x, y + step)) == "grab")
    browser.drag((x, bob + 16), (x + 60, bob), (x + 120, bob - 30))
    browser.frames(6)
    angle = initial_state(parse(file_of(browser).encode())).links[0]
    assert 0.3 < angle < 0.9
    assert text(browser, "play") == "Pause"
    assert browser.errors == []


def test_a_finger_pulls_a_bob_and_scrolls_beside_it(browser: Chromium, tmp_path: Path) -> None:
    browser.size(360, 640, still=True)
    browser.call("Emulation.setTouchEmulationEnabled", enabled=True)
    browser.open(written(load("chain-1"), tmp_path))
    browser.frames(1)
    x, y = centre(browser)
    bob = next(y + step for step in range(-40, 240, 4) if browser.run(cursor(x, y + step)) == "grab") + 34
    browser.swipe((x, bob), (x + 40, bob - 60), (x + 80, bob - 90), (x + 80, bob - 100))
    browser.call("Emulation.setTouchEmulationEnabled", enabled=False)
    assert browser.run("scrollY") == 0
    assert initial_state(parse(file_of(browser).encode())).links[0] > 0.4
    assert text(browser, "play") == "Pause"


def cursor(x: float, y: float) -> str:
    return f"""(() => {{ const scene = document.getElementById('scene');
      scene.dispatchEvent(new PointerEvent('pointermove', {{ clientX: {x}, clientY: {y} }}));
      return scene.style.cursor; }})()"""


@pytest.mark.parametrize(("tool", "key"), [("length", "length"), ("mass", "mass")])
def test_handles_change_lengths_and_masses(browser: Chromium, tmp_path: Path, tool: str, key: str) -> None:
    browser.size(1280, 900, still=True)
    browser.open(written(load("chain-1"), tmp_path))
    browser.frames(1)
    x, y = centre(browser)
    bob = next(y + step for step in range(-40, 240, 4) if browser.run(cursor(x, y + step)) == "grab") + 34
    browser.run(f"document.querySelector('input[value={tool}]').click()")
    browser.drag((x, bob), (x, bob - 40), (x, bob - 80))
    link = parse(file_of(browser).encode()).pendulum[0].links[0]
    changed = getattr(link, key)
    assert (0.5 < changed < 0.9) if tool == "length" else changed == pytest.approx(10**0.5, rel=0.01)


def test_keys_do_what_the_hand_does(shown: Chromium) -> None:
    shown.run("document.getElementById('scene').focus()")
    shown.press("ArrowDown")
    for _ in range(5):
        shown.press("ArrowRight")
    state = initial_state(parse(file_of(shown).encode()))
    assert np.degrees(state.links) == pytest.approx([0, 10, 0, 0])
    shown.run("document.getElementById('scene').focus()")
    shown.press("Enter")
    shown.frames(10)
    assert text(shown, "play") == "Pause"
    shown.press("r")
    shown.frames(6)
    assert text(shown, "play") == "Play"
    assert parse(file_of(shown).encode()).pendulum[0].start == load("paper-cart-2").pendulum[0].start
    shown.press("k")
    shown.frames(6)
    assert text(shown, "energy") != "0 J"


def test_a_link_holds_the_state(shown: Chromium, tmp_path: Path) -> None:
    enter(shown, "Gravity", 1.62)
    shown.run("document.getElementById('scene').focus()")
    shown.press("ArrowRight")
    shown.click("link")
    before, fragment = file_of(shown), shown.run("location.hash")
    assert "gravity = 1.62" in before
    shown.open(tmp_path / "page.html", fragment)
    assert file_of(shown) == before
    shown.open(tmp_path / "page.html", "#bm9uc2Vuc2U")
    assert "holds no scene" in text(shown, "status")
    assert cells(shown)[1][1] == "0.42655"


@pytest.mark.parametrize("still", [False, True], ids=["moving", "still"])
def test_it_starts_slowly_from_the_scene_s_start_unless_less_motion_is_asked_for(
    shown: Chromium, tmp_path: Path, still: bool
) -> None:
    scene = load("paper-cart-2")
    tilted = scene.pendulum[0].replace(start=scene.pendulum[0].start.replace(angles_deg=(40.0, 40.0)))
    shown.size(800, 800, still=still)
    shown.open(written(scene.replace(pendulum=[tilted]), tmp_path))
    shown.frames(30)
    assert text(shown, "play") == ("Play" if still else "Pause")
    assert (text(shown, "time") == "0.00 s") == still
    if not still:  # half a second: an eighth of it at the beginning
        assert 0.03 < float(text(shown, "time").split()[0]) < 0.1
        start = np.degrees(initial_state(parse(file_of(shown).encode())).links)
        assert np.abs(start - 40).max() < 5


def test_pendula_that_would_start_on_each_other_start_in_a_mode(shown: Chromium, tmp_path: Path) -> None:
    """Level links of two pendula on one cart look like one; Play from rest takes the start of the file all the same."""
    shown.size(1280, 800)
    shown.open(written(load("paper-cart-2"), tmp_path))
    shown.frames(2)
    assert shown.run("document.querySelectorAll('#rows button')[1].getAttribute('aria-pressed')") == "true"
    angles = np.degrees(initial_state(parse(file_of(shown).encode())).links)
    assert angles == pytest.approx(10 * natural_modes(load("paper-cart-2")).shape(1).angles, abs=0.1)
    shown.click("hang")
    shown.click("play")
    start = initial_state(parse(file_of(shown).encode())).links
    assert start == pytest.approx(initial_state(load("paper-cart-2")).links, abs=1e-9)
    assert shown.errors == []


def test_angles_of_the_table_stand_as_long_as_they_hold(browser: Chromium, tmp_path: Path) -> None:
    browser.errors.clear()
    browser.size(1280, 800, still=True)
    browser.open(written(load("two-bobs"), tmp_path))
    shown = "[...document.querySelectorAll('td.angle, #outdated')].map((one) => one.offsetParent !== null)"
    angles = [mode.linear_to_1_percent_deg for mode in natural_modes(load("two-bobs"))]
    assert browser.run(shown) == [True, True, False]
    assert [float(row[4]) for row in cells(browser)] == pytest.approx(angles, rel=3e-3)
    enter(browser, "Length", 1.1)
    assert browser.run(shown) == [False, False, True]
    enter(browser, "Length", 1.0)
    assert browser.run(shown) == [True, True, False]
    assert browser.errors == []


def test_the_graph_shows_both_pendula_over_their_beat(browser: Chromium, tmp_path: Path) -> None:
    browser.errors.clear()
    browser.size(1280, 800)
    browser.open(written(load("two-bobs"), tmp_path))
    browser.run(
        """(() => { window.drawn = []; const draw = CanvasRenderingContext2D.prototype;
        const { fillText, stroke } = draw;
        draw.fillText = function (words, ...place) { drawn.push(words); fillText.call(this, words, ...place); };
        draw.stroke = function () { if (this.canvas.id === "strip") drawn.push(this.strokeStyle); stroke.call(this); };
        })()"""
    )
    browser.frames(1600)
    browser.run("drawn.length = 0")
    browser.frames(1)
    drawn = browser.run("drawn")
    begun = float(text(browser, "time").split()[0]) - 2 * np.pi / np.ptp(natural_modes(load("two-bobs")).omega)
    assert min(float(words.split()[0]) for words in drawn if words.endswith(" s")) < begun + 5  # their step
    assert {"#005f9e", "#c48700"} <= set(drawn)
    assert text(browser, "strip-name") == "Pendula 1, 2, link 1"
    assert browser.errors == []


SLIDING = """[...document.querySelectorAll('button, select, input')].filter((one) => one.offsetParent)
  .filter((one) => !one.closest('.scroll') && one.getBoundingClientRect().bottom > innerHeight)
  .map((one) => one.outerHTML)"""


@pytest.mark.parametrize("name", ["paper-cart-2", "beam", "tower", "two-bobs", "huygens"])
def test_all_controls_are_in_sight_on_a_laptop(browser: Chromium, tmp_path: Path, name: str) -> None:
    browser.size(1280, 800, still=True)
    browser.show_scrollbars()
    browser.open(written(load(name), tmp_path))
    browser.frames(2)
    assert browser.run(SLIDING) == []
    page, table = ("document.documentElement", "document.querySelector('.scroll')")
    assert 1200 < browser.run(f"{page}.clientWidth") < 1280  # a scrollbar
    for part in (page, table):
        assert browser.run(f"{part}.scrollWidth - {part}.clientWidth") == 0
    if name == "paper-cart-2":
        assert browser.run(f"{table}.scrollHeight - {table}.clientHeight") == 0
        assert browser.run("document.getElementById('tasks-card').getBoundingClientRect().bottom") <= 800
    browser.size(1280, 500, still=True)
    assert browser.run(SLIDING) != []


def tasks(browser: Chromium) -> list[bool]:
    """Which challenges are solved."""
    return list(browser.run("[...document.querySelectorAll('#tasks li')].map((one) => one.className === 'done')"))


def test_three_challenges_check_themselves(shown: Chromium) -> None:
    """ω_in² = ω²/(1 − μ/m): a cart of a sixth of the mass and of 4.1 kg has a beat of 30 s in its slow modes."""
    shown.frames(8)
    assert tasks(shown) == [False, False, False]
    scene = load("paper-cart-2")

    def beat(mass: float) -> float:
        omega = natural_modes(scene.replace(support=scene.support.replace(mass=mass))).omega
        return float(2 * np.pi / (omega[2] - omega[1]))

    mass = float(brentq(lambda mass: beat(mass) - 30, 1.0, 100.0))
    enter(shown, "Cart mass", mass)
    shown.frames(4)
    assert tasks(shown) == [True, False, False]
    enter(shown, "Mode amplitude", 20.0)
    shown.run("document.querySelectorAll('#rows tr')[2].click()")  # the cart moves
    shown.frames(400)
    assert tasks(shown) == [True, False, False]
    shown.run("document.querySelectorAll('#rows tr')[1].click()")
    shown.frames(320)
    assert tasks(shown) == [True, True, False]
    assert text(shown, "status").startswith("Solved: Swing")
    shown.click("hang")
    shown.run("document.querySelectorAll('#rows tr')[2].click()")
    shown.click("tune")
    shown.click("hang")
    enter(shown, "Force", 10.0)
    shown.click("drive")
    shown.frames(1500)
    assert tasks(shown) == [True, True, True]
    assert shown.errors == []


@pytest.mark.parametrize("name", ["chain-1", "cart-upright", "two-bobs"])
def test_every_scene_has_three_challenges(browser: Chromium, tmp_path: Path, name: str) -> None:
    browser.size(1280, 900, still=True)
    browser.open(written(load(name), tmp_path))
    assert len(tasks(browser)) == 3


def test_what_the_page_does_by_itself_solves_nothing(browser: Chromium, tmp_path: Path) -> None:
    """The motion of a pendulum that its shaken support holds up is soon far from the linear one; so is a kicked one."""
    browser.size(1280, 800)
    browser.open(written(load("kapitza"), tmp_path))
    browser.frames(200)
    assert float(text(browser, "apart").rstrip("°")) > 5
    assert tasks(browser) == [False, False]
    assert browser.run("document.querySelector('input[aria-label^=Damping]').hidden")  # no share of critical damping
    assert browser.run(SLIDING) == []
    browser.click("kick")
    browser.frames(200)
    assert tasks(browser)[0]
    assert browser.errors == []


def test_notes_are_of_what_is_there(browser: Chromium, tmp_path: Path) -> None:
    browser.size(1280, 900, still=True)
    seen = []
    for name in ("paper-cart-2", "beam", "chain-1"):
        browser.open(written(load(name), tmp_path))
        browser.frames(1)
        hidden = browser.run("['note-beat', 'note-angle', 'note-star'].map((id) => document.getElementById(id).hidden)")
        seen.append((hidden, browser.run("document.querySelectorAll('td.beat')[0].offsetParent === null")))
        assert (
            browser.run("[...document.querySelectorAll('label')].some((one) => /drag/i.test(one.innerText))") is False
        )
    assert seen == [([False, False, False], False), ([True, False, True], True), ([True, False, True], True)]


def test_full_screen_keeps_the_table(shown: Chromium) -> None:
    turned = (
        "once = () => new Promise((done) => addEventListener('fullscreenchange', done, { once: true, capture: true }))"
    )
    small = shown.run("parseFloat(getComputedStyle(rows).fontSize)")
    shown.run(f"{turned}; window.entered = once(); 0")
    shown.call("Runtime.evaluate", expression="wide.click()", userGesture=True)
    shown.run("entered.then(() => 0)")
    assert shown.run("document.fullscreenElement.contains(rows) && document.fullscreenElement.contains(scene)")
    assert text(shown, "wide") == "Leave full screen"
    shown.size(1920, 1080)
    assert shown.run("parseFloat(getComputedStyle(rows).fontSize)") > 1.3 * small
    assert shown.run("theatre.getBoundingClientRect().bottom") < 1080
    shown.size(1280, 900)
    shown.run("window.left = once(); document.exitFullscreen().then(() => left).then(() => 0)")
    assert text(shown, "wide") == "Full screen"


def test_a_hostile_title_is_shown_and_not_run(browser: Chromium, tmp_path: Path) -> None:
    title = "</script><script>window.harm = 1</script><img src=x onerror='window.harm = 2'>{{data}}"
    scene = load("chain-2").replace(title=title)
    browser.errors.clear()
    browser.open(written(scene, tmp_path))
    browser.frames(2)
    harmed = "[window.harm ?? 0, document.images.length, document.scripts.length]"
    assert browser.run(harmed) == [0, 0, 2]
    assert (text(browser, "title"), browser.run("document.title")) == (title, title)
    assert parse(file_of(browser).encode()).title == title
    browser.click("link")
    browser.open(tmp_path / "page.html", browser.run("location.hash"))
    assert browser.run(harmed) == [0, 0, 2]
    assert browser.errors == []


def test_energy_and_the_linear_prediction_stand_beside_the_motion(browser: Chromium, tmp_path: Path) -> None:
    browser.size(1280, 900)
    browser.open(written(load("paper-cart-3"), tmp_path))
    browser.click("hang")
    browser.click("play")
    browser.frames(80)
    assert "10⁻" in text(browser, "drift")
    assert float(text(browser, "apart").rstrip("°")) > 1
    assert text(browser, "time") != "0.00 s"


def test_dampers_and_drives(shown: Chromium) -> None:
    enter(shown, "Damping", 2.0)
    assert text(shown, "head-f") == "|λ|/2π (Hz)"
    assert 0.01 < float(cells(shown)[1][5]) < 0.04
    shown.click("drive")
    shown.frames(12)
    assert text(shown, "play") == "Pause"
    assert text(shown, "energy") != "0 J"
    shown.run("document.querySelectorAll('#rows tr')[2].click()")
    shown.click("tune")
    frequency = shown.run("document.querySelector('input[aria-label^=Frequency]').value")
    assert float(frequency) == pytest.approx(float(cells(shown)[2][1]), rel=1e-4)
    shown.click("sound")
    shown.frames(6)
    shown.click("sound")
    assert shown.errors == []


def test_sliders_of_drag_and_of_a_moved_support(shown: Chromium, tmp_path: Path) -> None:
    assert text(shown, "head-f") == "f (Hz)"
    assert float(cells(shown)[1][5]) == 0
    scene = load("paper-cart-2")
    links = [link.replace(drag=0.01, quadratic_drag=0.1) for link in scene.pendulum[0].links]
    shown.open(written(scene.replace(pendulum=[scene.pendulum[0].replace(links=links)]), tmp_path))
    enter(shown, "Drag", 0.3)
    enter(shown, "Quadratic drag", 0.2)
    link = parse(file_of(shown).encode()).pendulum[0].links[0]
    assert (link.drag, link.quadratic_drag) == (0.3, 0.2)
    assert float(cells(shown)[1][5]) > 0.001
    damped = float(cells(shown)[2][5])
    enter(shown, "Drag", 0.0)
    assert float(cells(shown)[2][5]) < damped
    motion = SineMotion(amplitude=0.1, frequency_hz=1.0, direction="vertical")
    shown.open(written(load("chain-2").replace(support=Moved(motion=motion)), tmp_path))
    enter(shown, "Support amplitude", 0.2)
    enter(shown, "Support frequency", 1.25)
    shown.frames(1)
    before = shown.run("document.getElementById('scene').toDataURL()")
    shown.click("play")
    shown.frames(13)
    assert parse(file_of(shown).encode()).support.motion == motion.replace(amplitude=0.2, frequency_hz=1.25)
    assert shown.run("document.getElementById('scene').toDataURL()") != before
    assert "10⁻" in text(shown, "drift")
    shown.click("link")
    fragment = shown.run("location.hash")
    shown.open(tmp_path / "page.html", fragment)
    assert "holds no scene" not in text(shown, "status")
    assert "amplitude = 0.2" in file_of(shown)
    assert shown.errors == []


def test_a_saved_motion_plays_steps_and_scrubs(browser: Chromium, tmp_path: Path) -> None:
    run = simulate(load("paper-cart-2"), 4.0, output=41)
    browser.errors.clear()
    browser.open(written(run.scene, tmp_path, recording_of(run)))
    for _ in range(3):
        browser.click("forth")
    browser.click("back")
    assert initial_state(parse(file_of(browser).encode())).links == pytest.approx(run.motion.links[2], rel=1e-6)
    browser.run("(({ scrub }) => { scrub.value = 500; scrub.dispatchEvent(new Event('input')); })(window)")
    assert initial_state(parse(file_of(browser).encode())).links == pytest.approx(run.motion.links[20], abs=1e-2)
    browser.click("play")
    browser.frames(20)
    assert float(text(browser, "time").split()[0]) > 2.1
    browser.click("hang")
    assert not browser.run("document.getElementById('again').disabled")
    browser.click("again")
    browser.frames(6)
    assert text(browser, "time") == "0.00 s"
    assert browser.errors == []


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
@pytest.mark.parametrize("width", WIDTHS)
def test_nothing_is_wider_than_the_window(browser: Chromium, tmp_path: Path, width: int, dark: bool) -> None:
    browser.size(width, 800, dark=dark)
    browser.open(written(load("clocks-double"), tmp_path))
    assert browser.run("document.documentElement.scrollWidth") == width
    small = """[...document.querySelectorAll('button, select, input:not([type=checkbox], [type=radio])')]
      .filter((one) => one.offsetParent && one.getBoundingClientRect().height < 24).map((one) => one.outerHTML)"""
    assert browser.run(small) == []
    ground = browser.run("getComputedStyle(document.body).backgroundColor")
    assert (sum(map(int, ground[4:-1].split(","))) < 150) == dark
    browser.click("theme")
    assert browser.run("getComputedStyle(document.body).backgroundColor") != ground


@pytest.mark.parametrize(
    ("width", "dark"),
    usually([(360, True), (1280, False)], [(width, dark) for width in WIDTHS for dark in (False, True)]),
)
def test_axe_finds_nothing(browser: Chromium, tmp_path: Path, width: int, dark: bool) -> None:
    if (script := axe()) is None:
        pytest.skip("axe-core is not installed: npm install axe-core, and its folder in AXE_CORE")
    browser.size(width, 800, dark=dark)
    run = simulate(load("clocks-double"), 1.0, output=11)
    browser.open(written(run.scene, tmp_path, recording_of(run)))
    browser.run(script + "\n;0")
    browser.run("document.querySelectorAll('#rows tr')[1].click()")
    browser.run(
        "(() => { const box = document.querySelector('input[type=number]');"
        " box.value = '-1'; box.dispatchEvent(new Event('change')); })()"
    )
    violations: list[dict[str, Any]] = browser.run("axe.run().then((result) => result.violations)")
    assert [(violation["id"], [node["html"] for node in violation["nodes"]]) for violation in violations] == []
    assert browser.run("axe.run().then((result) => result.passes.length)") > 20
