"""What cannot be done is refused soon, in few words, with the place where it stands."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from amounts import usually

from modal import Bob, Body, Cart, ComputationError, Fixed, Pendulum, Rod, Scene, SceneError, natural_modes
from modal.coupling import coupling_report, explain
from modal.errors import MISTAKES_LISTED_MAX, MissingExtraError, MultipendulaError
from modal.modes.tables import table
from modal.scene import parse
from modal.scene.files import KEY_PARTS_MAX
from modal.statespace import state_space
from multipendula.cli import main

GOOD = 'gravity = 9.81\n[[pendulum]]\nlinks = [{ kind = "bob", mass = 1.0, length = 1.0 }]\n'


def problems(text: str) -> list[str]:
    with pytest.raises(SceneError) as caught:
        parse(text.encode())
    return str(caught.value).splitlines()


def refused(capsys: pytest.CaptureFixture[str], code: int, *words: str) -> list[str]:
    try:
        left = main(words)
    except SystemExit as leaving:
        left = leaving.code
    assert left == code
    streams = capsys.readouterr()
    assert streams.out == ""
    return streams.err.splitlines()


# ------------------------------------------------------------------------------------------------------ many mistakes


@pytest.mark.parametrize("key", ["a." * 20_000 + "a", "['a' ." + "a." * 20_000 + "a]\nx", '"a" . ' * 20_000 + "a"])
def test_a_key_without_end_is_not_followed(key: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its parts cost time and memory by their square, 40 s and 1.6 GB for these: the parser never sees it."""
    monkeypatch.setattr("modal.scene.files.tomllib.loads", lambda text: pytest.fail("parsed"))
    assert problems(f"{GOOD}{key} = 1") == [f"line 4: a key of over {KEY_PARTS_MAX} parts"]
    assert problems(f"x = {{ {key.splitlines()[0].strip('[]')} = 1 }}")[0].startswith("line 1: a key")


def test_what_only_looks_like_a_deep_key_is_none() -> None:
    dots = ".".join("a" * 90)
    for title in (f'"{dots}"', f"'{dots}'", f"'''{dots}'''", f'"""{dots}"""', f'"\\"{dots}"', f"'\"{dots}'"):
        assert dots in parse(f"# {dots} = 1\ntitle = {title} # {dots}\n{GOOD}".encode()).title


def test_the_first_mistakes_are_named_and_the_rest_is_counted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "many.toml"
    for count in (
        MISTAKES_LISTED_MAX - 1,
        MISTAKES_LISTED_MAX,
        MISTAKES_LISTED_MAX + 1,
        MISTAKES_LISTED_MAX + 2,
        2_000,
    ):
        path.write_text("".join(f"k{k} = 1\n" for k in range(count)) + GOOD)
        told = refused(capsys, 2, "table", str(path))
        assert told[0] == f"multipendula: {path}: k0: is not a known key"
        assert len(told) == min(count, MISTAKES_LISTED_MAX + 1)
        if count > MISTAKES_LISTED_MAX + 1:
            assert told[-1] == f"multipendula: {path}: and {count - MISTAKES_LISTED_MAX} more mistakes"
    links = ", ".join('{ kind = "bob", mass = -1.0, length = 1.0 }' for _ in range(200))
    assert problems(f"gravity = 9.81\n[[pendulum]]\nlinks = [{links}]")[-1] == "and 150 more mistakes"


def test_mistakes_that_come_together_are_counted_each() -> None:
    links = "[[pendulum]]\nlinks = [{ kind = 'bob', mass = 1.0, length = 1.0 }]\n"
    starts = f"{links}start = {{ angles_deg = [1], azimuths_deg = [1] }}\n"
    told = problems("gravity = 9.81\n" + 70 * starts)
    assert len(told) == MISTAKES_LISTED_MAX + 1
    assert told[-1] == "and 20 more mistakes"


# --------------------------------------------------------------------------------------------------------- arguments


@pytest.mark.parametrize(
    "option", ["table chain-1 --format=--", "sweep chain-1 --vary=--", "shapes chain-1 --output=--"]
)
def test_an_option_with_dashes_for_its_value_has_none(option: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert any("needs a value" in line for line in refused(capsys, 2, *option.split()))


def test_a_name_that_no_file_can_have_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    (told,) = refused(capsys, 2, "table", "chain-1", "-o", "a\0b")
    assert told.endswith("a file's name has no null character")


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no /dev/full")
@pytest.mark.parametrize(
    "arguments",
    usually(["--help", "table chain-1"], ["--help", "table --help", "--version", "table chain-1", "scenes"]),
)
def test_what_cannot_be_printed_is_no_success(arguments: str) -> None:
    with open("/dev/full", "w", encoding="utf-8") as full:
        command = [sys.executable, "-m", "multipendula", *arguments.split()]
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr == "multipendula: cannot write: No space left on device\n"


@pytest.mark.skipif(sys.platform == "win32", reason="no pipes with names, no pseudo-terminals")
@pytest.mark.parametrize("terminal", [True, False])
def test_a_terminal_is_told_what_is_waited_for(terminal: bool, tmp_path: Path) -> None:
    import pty

    pipe, (ours, theirs) = tmp_path / "pipe", pty.openpty()
    os.mkfifo(pipe)
    command = [sys.executable, "-m", "multipendula", "table", str(pipe), "-o", str(tmp_path / "t.txt")]
    with subprocess.Popen(command, stderr=theirs if terminal else subprocess.PIPE) as running:
        if terminal:
            assert os.read(ours, 1000).decode().strip() == f"waiting for a scene from {pipe} …"
        pipe.write_text(GOOD)
        assert running.wait(timeout=600) == 0
        assert terminal or running.stderr.read() == b""
    os.close(ours)
    os.close(theirs)


def test_links_that_one_double_cannot_hold_are_named_with_their_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "far.toml"
    light = '{ kind = "rod", mass = 1e-50, length = 1e-50 }'
    first, second = "{ kind = 'rod', mass = 1.0, length = 1.0 }", "{ kind = 'rod', mass = 2.0, length = 1.0 }"
    path.write_text(
        f"gravity = 9.81\n[[pendulum]]\nlinks = [{first}]\nstart = {{ angles_deg = [1] }}\n"
        f"[[pendulum]]\nlinks = [{second}, {light}]\nstart = {{ angles_deg = [1, 1] }}\n"
    )
    (told,) = refused(capsys, 2, "simulate", str(path), "--duration", "0.01")
    assert told.startswith(f"multipendula: {path}: pendulum[1].links[1]: m l² ranges from 1e-150 kg m² here to 2 kg m²")
    assert "in pendulum[1].links[0]" in told


# ----------------------------------------------------------------------------------------------------------- extremes


def fast() -> Scene:
    """A damper whose rate, 1e165/s, has a square beyond double precision."""
    links = [Rod(mass=1e-85, length=1e-40), Rod(mass=1e-85, length=1e-40, damping=1.0)]
    return Scene(gravity=1.0, pendulum=[Pendulum(links=links)])


def test_a_rate_whose_square_overflows_is_one_of_the_table() -> None:
    """Beyond the joint's own decay d (m₁l₁² m₂l₂²-weighted) the links swing as one rod of twice the length."""
    omega = natural_modes(fast()).omega
    assert np.all(np.isfinite(omega))
    assert omega[-1] > 1e154


def outcome(made: Callable[[], object]) -> str:
    """What a scene beyond all ratios gets: nothing, or the words in which it is refused."""
    try:
        made()
    except (ComputationError, SceneError) as error:
        return str(error)
    return ""


def test_models_at_the_edge_are_right_or_refused() -> None:
    """One bob: θ'' = −(g/l) θ, whatever its mass and length."""
    for mass, length in ((1e-90, 1e-40), (1e90, 1e40), (1e-100, 1e100)):
        model = state_space(Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=mass, length=length)])]))
        assert model.A[1, 0] == pytest.approx(-9.81 / length, rel=1e-14)
    made = 0
    for scene in extremes():
        for inputs in ((), ("cart_velocity",), ("cart_acceleration",)) if isinstance(scene.support, Cart) else ((),):
            words = outcome(partial(state_space, scene, inputs))
            assert "double precision" in words or not words
            made += not words
    assert made > 30


def extremes() -> list[Scene]:
    """A hundred scenes of parameters over two hundred decades, each from its own seed."""
    scenes = []
    for seed in range(100):
        rng = np.random.default_rng(seed)

        def any_size(rng: np.random.Generator = rng) -> float:
            return float(10 ** rng.uniform(-99, 99))

        def link(rng: np.random.Generator = rng) -> Bob | Rod | Body:
            joint = {"damping": rng.choice([0.0, any_size(rng)]), "stiffness": rng.choice([0.0, any_size(rng)])}
            kind = rng.choice([Bob, Rod, Body])
            body_numbers = {"centre": any_size(rng), "inertia": any_size(rng)} if kind is Body else {}
            made: Bob | Rod | Body = kind(mass=any_size(rng), length=any_size(rng), **joint, **body_numbers)
            return made

        pendula = [Pendulum(links=[link() for _ in range(rng.integers(1, 4))]) for _ in range(rng.integers(1, 4))]
        cart = Cart(mass=any_size(), damping=rng.choice([0.0, any_size()]), stiffness=rng.choice([0.0, any_size()]))
        scenes.append(Scene(gravity=any_size(), support=cart if seed % 3 else Fixed(), pendulum=pendula))
    return scenes


def test_extremes_are_told_or_refused_without_a_warning() -> None:
    """Warnings are errors here."""
    told = 0
    scenes = extremes()[:: usually(4, 1)]
    for scene in scenes:
        told += not outcome(lambda scene=scene: table(modes := natural_modes(scene), list(modes), "text"))  # type: ignore[misc]
        told += not outcome(lambda scene=scene: coupling_report(explain(scene), "text"))  # type: ignore[misc]
    assert told > len(scenes) / 5


@pytest.mark.parametrize("error", [SceneError(["a", "b\x1b"]), MissingExtraError("flint", "certified")])
def test_errors_come_whole_from_other_processes(error: MultipendulaError) -> None:
    back = pickle.loads(pickle.dumps(error))
    assert (type(back), str(back), back.args) == (type(error), str(error), error.args)
    assert getattr(back, "problems", None) == getattr(error, "problems", None)


def test_a_message_quotes_at_most_200_letters() -> None:
    for name in ("a b" * 5000, "x" * 5000):
        message = str(SceneError([f'support.name = "{name}": is reserved', "gravity = -1.0: must be positive"]))
        first, second = message.split("\n")
        assert first.startswith(f'support.name = "{name[:150]}')
        assert first.endswith('…": is reserved')
        assert len(first) < 240
        assert second == "gravity = -1.0: must be positive"
