"""Every option of the command line, whatever command takes it, in one table.

A new option stands here first: its metavar and its one meaning, the part of a help page where it stands, how its value
is read and completed, and the argument of the packages' functions that it becomes.  A command names the options that
it takes, and says after the meaning what is its own: a default, an example.  The manual prints the table
(docs/reference/options.md), and tests hold every command to it.
"""

from __future__ import annotations

import re
import sys
from typing import Any, NamedTuple

from multipendula.completion import Completer, files, mode_numbers, places, scenes, words
from multipendula.options import (
    ENGINES,
    FILMS,
    FORMS,
    LOSSES,
    METHODS,
    PICTURES,
    QUANTITIES,
    SHAPERS,
    STARTS,
    Asked,
    Joined,
    Reader,
    Repeated,
    angles,
    band,
    engine,
    frequencies,
    integer,
    number,
    share,
    way,
)

STREAM = ", - for standard output"
"""The remark on every file to be written."""


class Flag(NamedTuple):
    """An option: metavar, empty for a switch or a choice of words, and meaning; the group of a page it stands in.

    `type` reads its value, `kinds` are those of the files that it names, and `keyword` is the argument of the packages'
    functions that it becomes, where that has another name; `names` are others by which their messages call it.  Where
    they ask for it without a value, the `example` is given, or else the metavar.
    """

    metavar: str
    meaning: str
    type: Reader | None = None
    group: str = "asked"
    action: Any = None
    default: Any = None
    choices: tuple[str, ...] | None = None
    completion: Completer | None = None
    kinds: tuple[str, ...] = ()
    short: str = ""
    keyword: str = ""
    names: tuple[str, ...] = ()
    example: str = ""

    @property
    def words(self) -> str:
        """The beginning of a help page: the meaning, and that a file may be standard output."""
        return self.meaning + STREAM * (self.metavar == "FILE")


SECONDS, SECONDS_FROM_0 = number("seconds above 0"), number("seconds from 0", least=0.0)
FLAGS: dict[str, Flag] = {
    "--accuracy": Flag(
        "RAD", "largest error of any angle", number("radians from 1e-200 to 0.3", 0.3, 1e-200), "computed"
    ),
    "--amplitude": Flag(
        "DEG", "largest angle of a mode", number("degrees above 0 and at most 90", most=90), keyword="amplitude_deg"
    ),
    "--amplitudes": Flag("DEG,...", "largest angles of a mode, at each of which it is released", angles),
    "--angles": Flag(
        "",
        "absolute angles, from the vertical, or relative ones, from the link above",
        choices=("absolute", "relative"),
        default="absolute",
    ),
    "--along": Flag(
        "RUN", "saved run along which a table of models is taken", names=("run",), completion=files((".npz", ".csv"))
    ),
    "--at": Flag("HERTZ,...", "frequencies at which numbers are printed", frequencies, action=Joined),
    "--band": Flag(
        "FILE", "file for a picture of the motion's band over the fitted numbers", group="written", kinds=PICTURES
    ),
    "--baseline": Flag("", "how a record is corrected before it is used", choices=("keep", "velocity"), default="keep"),
    "--bootstrap": Flag(
        "N", "number of resampled records that check standard deviations", integer(100_000), "computed"
    ),
    "--column": Flag(
        "HEADING=COLUMN",
        "meaning of a column of a record with another heading, unit or sign",
        action=Repeated,
        keyword="columns",
    ),
    "--columns": Flag("NAMES", "columns of the table", group="written", action=Joined, keyword="columns"),
    "--compare": Flag(
        "LAWS",
        "laws of damping to compare",
        group="computed",
        action=Joined,
        completion=words(("viscous", "coulomb", "drag", "viscous+coulomb")),
        keyword="laws",
    ),
    "--compile": Flag("", "compile in advance what the fast integrators need, and store it", group="computed"),
    "--count": Flag("N", "number of slowest modes that the shaper suppresses", integer(99999)),
    "--covariance": Flag("FIT.json", "report of the fit that gave the scene, as JSON", completion=files((".json",))),
    "--crossing": Flag("COORDINATE", "section at which motions are recorded"),
    "--depth": Flag("N", "how many generations of branches are followed", integer(20)),
    "--digits": Flag("N", "number of digits that are proved", integer(1000), default=30),
    "--discrete": Flag("SECONDS", "sample time of a controller", SECONDS, keyword="step", names=("sample",)),
    "--dominant": Flag(
        "N", "keep only this number of modes, those that contribute most", integer(99999), "alone", keyword="count"
    ),
    "--drive": Flag("NAME", "how the cart is driven"),
    "--duration": Flag("SECONDS", "simulated time", SECONDS, "motion"),
    "--energies": Flag("", "add the distribution of each mode's energy, in percent", group="written"),
    "--energy": Flag("JOULES", "energy above equilibrium", number("joules", least=-sys.float_info.max)),
    "--engine": Flag(
        "", "engine that integrates the members of the ensemble", engine, "numerics", choices=ENGINES, default="auto"
    ),
    "--enter": Flag("", "also follow the branches that bifurcate"),
    "--equilibrium": Flag("down,up", "equilibrium of every link", action=Joined, completion=words(("down", "up"))),
    "--every": Flag("N", "use every N-th row of a record", integer(1_000_000)),
    "--excitation": Flag("", "what excited the measured motions", choices=("free", "random"), default="free"),
    "--explain": Flag("", "report what was computed, and what the scene did not require", group="written"),
    "--film": Flag("FILE", "file for a film in addition to the main result", group="written", kinds=FILMS),
    "--folder": Flag("FOLDER", "folder for finished parts, so that an interrupted run resumes", group="written"),
    "--form": Flag("NAME", "form of the equations of motion", group="numerics", completion=words(FORMS, "")),
    "--format": Flag("", "format of what is printed", group="written", action=Asked),
    "--fps": Flag("N", "frames a second of a film", number("frames a second from 1 to 60", 60, 1), "written"),
    "--free": Flag(
        "PLACES", "numbers of the scene that may change, separated by commas", action=Joined, completion=places
    ),
    "--fresh": Flag("", "discard the stored parts of an interrupted run", group="computed"),
    "--from": Flag("NAME", "the one input whose response is shown", keyword="source"),
    "--gains": Flag("", "controllability and observability of every mode, as relative gains"),
    "--general": Flag("", "project one run on the modes instead"),
    "--help": Flag("", "show this page and exit, -h one screen of it", group="more"),
    "--identification": Flag(
        "", "method of identification", group="computed", choices=("era", "decrement"), default="era", keyword="method"
    ),
    "--identified-modes": Flag(
        "FILE", "file for the identified modes, which fit and poles --scene read", group="written", kinds=("csv",)
    ),
    "--impulse": Flag("", "impulse response"),
    "--input": Flag("WORDS", "inputs of a linear model", action=Joined, keyword="inputs"),
    "--keep-modes": Flag(
        "N", "number of slowest modes to which the motion is restricted", integer(100_000), "computed", keyword="modes"
    ),
    "--kind": Flag("", "kind of input shaper", choices=SHAPERS),
    "--largest-angle": Flag(
        "DEG", "largest angle of any link that periodic orbits reach", number("degrees above 0 and below 180", 179.999)
    ),
    "--linear": Flag("", "compare ways to the natural frequencies instead", group="computed"),
    "--links": Flag("", "kind of the links", choices=("bob", "rod"), default="bob"),
    "--loci": Flag("", "follow every frequency along one --vary by its mode shape"),
    "--lqr": Flag("", "gains of the linear-quadratic regulator, a column for each state, a row for each input"),
    "--loss": Flag("", "cost of a residual", group="computed", choices=LOSSES, default="linear"),
    "--map": Flag("", "map the rhythms that starts reach along one or two --vary"),
    "--max": Flag("QUANTITY=VALUE", "largest value that a quantity may have", action=Repeated, keyword="limits"),
    "--max-acceleration": Flag(
        "M/S²", "largest acceleration of a travel", number("m/s² above 0"), names=("acceleration",)
    ),
    "--max-jerk": Flag("M/S³", "largest jerk of a travel", number("m/s³ above 0"), names=("jerk",)),
    "--max-speed": Flag("M/S", "largest speed of a travel", number("m/s above 0"), names=("speed",)),
    "--maximize": Flag("QUANTITY", "quantity to maximize", action=Repeated, completion=words(QUANTITIES, "")),
    "--measure": Flag("NAME[:N]", "what is measured at every point", action=Repeated),
    "--members": Flag("N", "number of members of the ensemble"),
    "--method": Flag("NAME", "method of integration", group="numerics", completion=words(METHODS, "")),
    "--minimal": Flag("", "remove uncontrollable and unobservable states", group="alone"),
    "--minimize": Flag("QUANTITY", "quantity to minimize", action=Repeated, completion=words(QUANTITIES, "")),
    "--mode": Flag("R", "a row of the table of modes", integer(100_000), action=Repeated, completion=mode_numbers),
    "--modes": Flag("1:10", "rows of the table of modes", completion=mode_numbers),
    "--names": Flag("", "letters for the parts of a scene", group="written", choices=("own", "paper")),
    "--of": Flag("NAMES", "outputs that are shown", action=Joined),
    "--orbits": Flag("", "use exact periodic orbits where a mode is starred", group="computed"),
    "--order": Flag("N", "order of an identified model", integer(200), "computed"),
    "--output": Flag("FILE", "file for the main result", group="written", short="-o"),
    "--over": Flag("SECONDS", "duration of a travel", SECONDS, names=("duration",)),
    "--over-hz": Flag("FROM:TO", "band of frequencies in which peaks count", band, names=("band",)),
    "--parts": Flag("1:12", "parts of a scene that are drawn, the support first", group="written"),
    "--periods": Flag("N", "number of periods of the drives after which a motion repeats", integer(64)),
    "--phase-deg": Flag(
        "DEG",
        "phase of the drives, from the beginning of their period, of the stroboscopic samples",
        number("degrees", least=-sys.float_info.max),
    ),
    "--picture": Flag("FILE", "file for a picture in addition to the main result", group="written", kinds=PICTURES),
    "--pixel": Flag("METRES", "metres of one pixel of marks, x_1_1_px and y_1_1_px", number("metres above 0")),
    "--places": Flag("", "list the places, values and units of the scene's numbers instead"),
    "--prior": Flag("PLACE=VALUE±STD", "prior knowledge of a free number", action=Repeated, keyword="priors"),
    "--prove": Flag("FILE", "file for a proof of every frequency", group="written", kinds=("json",), keyword="proof"),
    "--proved": Flag("", "enclose the motion in a proved tube (extra `certified`)", group="computed"),
    "--psd": Flag("CSV", "file of a one-sided power spectral density", completion=files((".csv",))),
    "--quick": Flag("", "a shorter version"),
    "--quiet": Flag(
        "",
        "print nothing but the result and errors: no summary with a file, no notes, no progress",
        group="written",
        short="-q",
    ),
    "--range": Flag(
        "PLACE=FROM:TO", "number of the scene over whose range the shaper works", completion=places, keyword="span"
    ),
    "--record": Flag("CSV", "file of a motion along the rail", completion=files((".csv",))),
    "--relative-error": Flag(
        "SHARE", "largest relative error of a frequency", number("from 1e-16 to 0.1", 0.1, 1e-16), "computed"
    ),
    "--report": Flag("FILE", "file for the full report", group="written", kinds=("json",)),
    "--residual": Flag(
        "PERCENT", "residual swing that is allowed", number("percent above 0 and at most 50", most=50.0), default=5.0
    ),
    "--robust": Flag("", "tune for the worst case of all masses ±5 percent, each separately", group="computed"),
    "--samples": Flag("N", "number of times in the output", integer(100_000_000), "motion", keyword="output"),
    "--scale": Flag("", "fit the scale of every sensor too", group="computed"),
    "--scene": Flag("SCENE", "scene whose modes are compared with the measured ones", completion=scenes((".toml",))),
    "--schema": Flag("", "print the JSON Schema of a scene file"),
    "--scheduler": Flag("ADDRESS", "Dask cluster that computes", group="numerics"),
    "--seconds": Flag("SECONDS", "longest duration of a film", SECONDS, "written"),
    "--seed": Flag("N", "seed of the random numbers", integer(2**31, 0)),
    "--sensitivities": Flag(
        "", "add the sensitivity of every frequency to every number of the scene", group="written", keyword="sensitive"
    ),
    "--settle": Flag("SECONDS", "time before the first stroboscopic sample", SECONDS_FROM_0, "motion"),
    "--settled": Flag("", "begin where a simulated motion has settled"),
    "--shapes": Flag("", "add mode shapes and energy shares", group="written"),
    "--share": Flag(
        "K/N", "compute only the K-th of N shares, for processes with a common --folder", share, "computed"
    ),
    "--shift": Flag("", "fit the delay of the record behind the scene's motions and forces", group="computed"),
    "--show": Flag("WORDS", "sections of a derivation", group="written", action=Joined, keyword="sections"),
    "--signals": Flag("WORDS", "outputs of a linear model", action=Joined, keyword="outputs", names=("output",)),
    "--speed": Flag(
        "FACTOR",
        "speed of a film over that of the motion",
        number("times real time from 0.001 to 1000", 1000, 0.001),
        "written",
        default=1.0,
    ),
    "--spread": Flag(
        "DEG",
        "largest distance of starting angles from the scene's",
        number("degrees from 0", least=0.0),
        keyword="spread_deg",
    ),
    "--start": Flag(
        "WORDS",
        "where the motion begins",
        group="motion",
        completion=words(STARTS, ""),
        names=("angles_deg",),
        example="mode:1:5 (mode 1, largest angle 5 deg) or --start angles:10,20,...",
    ),
    "--strobe": Flag("", "draw the last stroboscopic samples, one per period of the drives"),
    "--symbolic": Flag("WORDS", "quantities to keep as symbols", action=Joined),
    "--temperature": Flag("KELVIN", "temperature of thermal noise", number("kelvin above 0 and at most 1e6", most=1e6)),
    "--theme": Flag("", "colours of the figure", group="written", choices=("light", "dark"), default="light"),
    "--to": Flag("FORMAT", "format of the exported model", group="written", keyword="format"),
    "--tolerance": Flag(
        "TOL", "relative error of a step of the integrator", number("from 1e-15 to 0.01", 0.01, 1e-15), "numerics"
    ),
    "--travel": Flag("METRES", "how far the cart travels", way, names=("distance",)),
    "--uncertain": Flag(
        "PLACE=WIDTH", "number of the scene that is uncertain, and by how much", action=Repeated, completion=places
    ),
    "--vary": Flag("PLACE=VALUES", "number of the scene that takes several values", action=Repeated, completion=places),
    "--weights": Flag(
        "Q.csv,R.csv",
        "weights of states and of inputs, whose names are the headings: matrices, or the row of a diagonal",
        keyword="weights",
    ),
    "--when": Flag("SECONDS", "time at which a hoist's lengths are taken", SECONDS_FROM_0, names=("Scene.at",)),
    "--where": Flag("COLUMN=VALUE", "which rows of a record are used", action=Repeated),
    "--window": Flag("SECONDS", "length of windows in which a long record is fitted", SECONDS, "computed"),
    "--words": Flag("", "explain everything in sentences, too", group="written"),
    "--workers": Flag("N", "number of processes", integer(1000), "numerics"),
}


class Former(NamedTuple):
    """What an option of a command is called now; `values` is a pattern of those that it took before and now does not.

    Where it has none, the option is gone from the command.
    """

    now: str
    values: str = ""

    def words(self, flag: str, value: str) -> str:
        """The message to a user of the former option, nothing if this value means what it says."""
        if not self.values:
            return f"{flag}: is now {self.now}"
        return f"{flag} {value}: is now {self.now} {value}" if re.match(self.values, value) else ""


_SIGNALS = Former("--signals", r"(cart|angles|rates|relative|joint|tip|pivot|coordinate|spring)\w*(,|$)")

FORMER: dict[tuple[str, str], Former] = {
    ("basins", "--integrator-tolerance"): Former("--tolerance"),
    ("chaos", "--ensemble"): Former("--members"),
    ("check", "--amplitude"): Former("--amplitudes"),
    ("check", "--mode"): Former("--modes"),
    ("export", "--modes"): Former("--dominant"),
    ("export", "--output"): _SIGNALS,
    ("orbits", "--to"): Former("--largest-angle"),
    ("poles", "--method"): Former("--identification"),
    ("poles", "--modes"): Former("--identified-modes"),
    ("response", "--output"): _SIGNALS,
    ("section", "--at"): Former("--crossing"),
    ("section", "--integrator-tolerance"): Former("--tolerance"),
    ("section", "--orbits"): Former("--members"),
    ("shaper", "--tolerance"): Former("--residual"),
    ("spread", "--integrator-tolerance"): Former("--tolerance"),
    ("spread", "--tolerance"): Former("--uncertain", r"[^=]*="),
    ("sync", "--picture"): Former("--output"),
    ("table", "--accuracy"): Former("--relative-error"),
    ("tune", "--angle"): Former("--largest-angle"),
}
"""Options by command and former spelling."""
ASIDE = "shell"
"""The topic of commands that the overview omits."""
FORMER_COMMANDS = {
    "advise": "simulate SCENE --accuracy RAD",
    "compile": "simulate SCENE --compile",
    "gains": "response SCENE --gains",
    "mac": "poles MODES.csv --scene SCENE",
    "schema": "scenes --schema",
    "shock": "vibration SCENE --record CSV",
}
"""The present equivalents of former commands."""
ELSEWHERE = {
    "find_bifurcations": "sweep --strobe",
    "find_rhythms": "sync --map",
    "scene_numbers": "table SCENE --places",
}
"""The command-line equivalents of functions that messages name."""
SYNONYMS = {
    **dict.fromkeys(
        ("--time", "--t-end", "--tmax", "--t", "--end", "--length", "--seconds"), ("--duration", "--over", "--when")
    ),
    **dict.fromkeys(("--dt", "--step", "--time-step", "--steps", "--points"), ("--samples", "--discrete")),
    **dict.fromkeys(("--type", "--shape"), ("--kind", "--format", "--to", "--form")),
    **dict.fromkeys(("--frequency", "--frequencies", "--freq", "--hz"), ("--at", "--over-hz", "--columns frequency")),
    "--amplitude": ("--amplitudes", "--largest-angle", "--start mode:1:10"),
    **dict.fromkeys(
        ("--angle", "--angles", "--theta", "--theta0", "--initial", "--initial-angles", "--ic", "--x0"),
        ("--start angles:10,20", "--largest-angle", "--amplitudes"),
    ),
    **dict.fromkeys(("--solver", "--integrator"), ("--method", "--engine")),
    **dict.fromkeys(("--rtol", "--atol", "--eps", "--tol"), ("--tolerance", "--accuracy", "--relative-error")),
    **dict.fromkeys(("--digits", "--precision"), ("--format csv", "--format json", "--accuracy")),
    **dict.fromkeys(("--jobs", "--threads", "--cores", "--processes"), ("--workers",)),
    **dict.fromkeys(("--plot", "--figure", "--image"), ("--picture", "--output")),
    **dict.fromkeys(("--save", "--out", "--file", "--write"), ("--output",)),
    **dict.fromkeys(("--parameter", "--param", "--set"), ("--vary", "--free", "--uncertain")),
    **dict.fromkeys(("--number", "--n", "--size"), ("--members", "--count", "--samples")),
    **dict.fromkeys(("--parameters", "--list"), ("--places",)),
    "--inputs": ("--input",),
    "--outputs": ("--signals", "--of"),
    "--silent": ("--quiet",),
    "--verbose": ("--explain", "--words"),
    **{f"--{form}": (f"--format {form}",) for form in ("csv", "html", "latex", "markdown")},
    "--json": ("--format json", "--to json"),
    "--mat": ("--to mat",),
    "--format": ("--to",),
    **dict.fromkeys(("modes", "frequencies", "eigenvalues"), ("table",)),
    **dict.fromkeys(("list", "examples", "show"), ("scenes",)),
    **dict.fromkeys(("sim", "run", "motion"), ("simulate",)),
    **dict.fromkeys(("film", "video", "movie"), ("animate",)),
    "bode": ("response",),
    "draw": ("shapes",),
    "optimize": ("tune",),
    "lyapunov": ("chaos",),
}
"""Alternatives for options and commands under other names; the first option that a command has is suggested."""
IN_SCENE = {
    *("--gravity", "--g", "--mass", "--masses", "--length", "--lengths", "--damping", "--stiffness", "--cart-mass")
}
"""Numbers that a scene has, and no command as an option."""
