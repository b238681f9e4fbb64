"""Commands in processes of their own, stopped by Ctrl-C, SIGTERM or SIGKILL at any moment."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

from hostility.judge import TEMPORARY, contents, wrong_words

COMMANDS = (
    "sweep paper-cart-2 --vary support.mass=1:1000:3000log --workers 2 -o sweep.csv",
    "sweep paper-cart-2 --vary support.mass=1:1000:3000log --workers 2 -o sweep.csv",
    "sweep chain-2 --vary gravity=1:10:40 --measure largest_angle -o sweep.npz",
    "simulate paper-cart-3 --duration 2000 -o run.npz",
    "simulate chain-3 --duration 500 --form maximal -o run.csv",
    "animate paper-cart-2 --duration 3 -o film.gif",
    "animate paper-cart-2 --duration 3 -o film.mp4",
    "animate chain-2 --duration 2 -o film.html",
    "shapes paper-cart-2 -o shapes.pdf",
    "plot chain-2 --duration 5 -o run.svg",
    "chaos chain-2 --duration 20 --members 4 -o chaos.png",
    "tradeoff chain-1 --duration 1",
    "check chain-2 --modes 1 --amplitudes 10,20,30",
    "table rope --format json -o table.json",
    "table thousand-pendula",
    "export paper-cart-3 --to fmu -o model.fmu",
    "derive chain:3",
    "sync huygens --duration 30 -o sync.png",
)
SIGNALS = (*(signal.SIGINT,) * 3, signal.SIGTERM, *([signal.SIGKILL] if hasattr(signal, "SIGKILL") else []))
START = (
    "import os, sys, _signal; _signal.signal(2, _signal.default_int_handler); "
    "from multipendula.__main__ import main; os.write({}, b'!'); sys.exit(main())"
)
"""The installed command, with a sign when the interpreter is up and this project's code begins.

A shell's background jobs ignore Ctrl-C, and so would what they start.
"""
LATEST, PATIENCE, GRACE = 5.0, 60.0, 5.0  # s


def case(number: int, folder: Path) -> tuple[str, list[str]]:
    """Start a command, stop it in way `number`, and inspect the remains: what was done, and its faults."""
    rng = random.Random(number)
    words, sign = rng.choice(COMMANDS).split(), rng.choice(SIGNALS)
    delay = LATEST * rng.random() ** 2
    before = contents(folder)
    code, out, err, session = _stopped(words, folder, sign, delay)
    done = f"{' '.join(words)}: {sign.name} after {delay:.2f} s"
    faults = list(_wrong_end(code, sign))
    if code is not None and code >= 0:
        faults += wrong_words(code, out, err)
    elif "Traceback" in err:
        faults.append("a traceback")
    if orphans := _left(session):
        faults.append(f"orphans {orphans}")
        for orphan in orphans:
            os.kill(orphan, signal.SIGKILL)
    if sign is not getattr(signal, "SIGKILL", None):
        faults += [f"left {name}" for name in contents(folder) if TEMPORARY in name and name not in before]
    if words[0] == "sweep" and (folder / f"{words[-1]}.journal").exists():
        faults += _resumed(words, folder)
    for path in folder.iterdir():
        path.unlink()
    return done, [f"{fault}: {err.strip()[-200:]!r}" for fault in faults]


def _stopped(words: list[str], folder: Path, sign: signal.Signals, delay: float) -> tuple[int | None, str, str, int]:
    sees, says = os.pipe()
    process = subprocess.Popen(
        [sys.executable, "-c", START.format(says), *words],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        stdin=subprocess.DEVNULL,
        pass_fds=[says],
        start_new_session=True,
    )
    os.close(says)
    os.read(sees, 1)
    os.close(sees)
    time.sleep(delay)
    if process.poll() is None:
        process.send_signal(sign)
    try:
        out, err = process.communicate(timeout=PATIENCE)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        out, err = process.communicate()
        return None, out.decode(errors="replace"), err.decode(errors="replace"), process.pid
    return process.returncode, out.decode(errors="replace"), err.decode(errors="replace"), process.pid


def _wrong_end(code: int | None, sign: signal.Signals) -> Iterator[str]:
    """A process ended by its signal has no exit code; one ended by Ctrl-C has 130."""
    if code is None:
        yield f"does not end within {PATIENCE:g} s"
    elif code not in ({0, 130} if sign is signal.SIGINT else {0, 130, 128 + sign, -sign}):
        yield f"exit code {code}"


def _left(session: int) -> list[int]:
    """Processes of a session that still exist some seconds after its first one has ended; Linux only."""
    until = time.monotonic() + GRACE
    while (processes := _of_session(session)) and time.monotonic() < until:
        time.sleep(0.1)
    return processes


def _of_session(session: int) -> list[int]:
    processes = []
    for entry in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, _, _, leader = entry.read_text(encoding="utf-8").rpartition(")")[2].split()[:4]
        except OSError:
            continue
        if int(leader) == session and state != "Z":
            processes.append(int(entry.parent.name))
    return processes


def _resumed(words: list[str], folder: Path) -> Iterator[str]:
    """Faults of the resumed sweep: it must give the same as one that was never stopped."""
    command = [sys.executable, "-m", "multipendula"]
    again = subprocess.run([*command, *words], cwd=folder, capture_output=True, check=False)
    clean = folder / f"clean{Path(words[-1]).suffix}"
    subprocess.run([*command, *words[:-1], clean.name], cwd=folder, capture_output=True, check=False)
    if again.returncode:
        yield f"cannot be taken up again: {again.stderr.decode(errors='replace')[-200:]}"
    elif (folder / words[-1]).read_bytes() != clean.read_bytes():
        yield "taken up again it gives other numbers"
