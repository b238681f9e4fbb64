"""True errors of every shipped scene's run, by a tube that provably contains it: docs/benchmarks/proved.md.

    python benchmarks/proved.py [SECONDS [SCENE ...]]

Each scene is simulated from its own start, or its first swinging mode at its usual angle, to an accuracy of 1e-6 rad
and at two tolerances.  What no tube follows, or takes longer than 20 s of processor time, is listed with the reason.
"""

import signal
import sys
from time import process_time

from modal import load
from modal.errors import MultipendulaError
from modal.scene import example_names
from multipendula.commands.runs import start_of
from nonlinear import simulate
from nonlinear.integration import enclose_motion

PATIENCE = 20


def row(name: str, seconds: float) -> str:
    scene = load(name)
    begun = process_time()
    start = start_of(scene, None, told=True)
    tube = enclose_motion(scene, seconds, radius=1e-13, start=start)
    spent = process_time() - begun
    cells = [name, f"{tube.radius:.0e}", str(tube.steps), f"{spent:.1f}"]
    for how in ({"accuracy": 1e-6}, {"tolerance": 1e-9}, {"tolerance": 1e-12}):
        run = simulate(scene, seconds, start=start, output=11, **how)
        estimate = f" ({run.run.error:.0e})" if "accuracy" in how else ""
        cells.append(f"{tube.distance(run).max():.0e}{estimate}")
    return f"| {' | '.join(cells)} |"


def late(*_: object) -> None:
    raise TimeoutError(f"takes more than {PATIENCE} s of processor time")


def main() -> None:
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 10.0
    reasons = []
    print("| scene | radius | steps | time (s) | accuracy 1e-6 (its estimate) | tolerance 1e-9 | tolerance 1e-12 |")
    print("|---|---|---|---|---|---|---|", flush=True)
    signal.signal(signal.SIGPROF, late)
    for name in sys.argv[2:] or example_names():
        signal.setitimer(signal.ITIMER_PROF, PATIENCE)
        try:
            print(row(name, seconds), flush=True)
        except (MultipendulaError, TimeoutError) as error:
            reasons.append(f"- `{name}`: {str(error).removeprefix(f'{name}: ')}")
        finally:
            signal.setitimer(signal.ITIMER_PROF, 0)
    print("\n" + "\n".join(reasons))


if __name__ == "__main__":
    main()
