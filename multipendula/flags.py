"""Every option of the command line, its metavar and its one meaning, whatever command takes it.

A new option stands here first.  Help pages begin what they say of an option with its meaning, and go on with what is
of that command alone: its default, an example.  The manual prints both tables (docs/reference/options.md), and tests
hold every command to them.
"""

from __future__ import annotations

import re
from typing import NamedTuple

FLAGS: dict[str, tuple[str, str]] = {
    "--accuracy": ("RAD", "largest error of any angle"),
    "--amplitude": ("DEG", "largest angle of a mode"),
    "--amplitudes": ("DEG,...", "largest angles of a mode, at each of which it is released"),
    "--angles": ("", "absolute angles, from the vertical, or relative ones, from the link above"),
    "--at": ("HERTZ,...", "frequencies at which numbers are printed"),
    "--band": ("FILE", "file for a picture of the motion's band over the fitted numbers, - for standard output"),
    "--baseline": ("", "how a record is corrected before it is used"),
    "--bootstrap": ("N", "number of resampled records that check standard deviations"),
    "--column": ("HEADING=COLUMN", "what a column of a record with another heading, unit or sign holds"),
    "--columns": ("NAMES", "columns of the table"),
    "--compare": ("LAWS", "laws of damping to compare"),
    "--count": ("N", "number of slowest modes that a shaper is for"),
    "--covariance": ("FIT.json", "report of the fit that gave the scene, as JSON"),
    "--crossing": ("COORDINATE", "what a motion passes where it is recorded"),
    "--depth": ("N", "how often branches that leave are followed in turn"),
    "--digits": ("N", "number of digits that are proved"),
    "--discrete": ("SECONDS", "sample time of a controller"),
    "--dominant": ("N", "number of modes that contribute most, and are the only ones kept"),
    "--drive": ("NAME", "what moves the cart"),
    "--duration": ("SECONDS", "simulated time"),
    "--energy": ("JOULES", "energy above the scene's rest"),
    "--engine": ("", "what integrates the members of the ensemble"),
    "--enter": ("", "also follow the branches that leave"),
    "--equilibrium": ("down,up", "equilibrium of every link"),
    "--excitation": ("", "what excited the measured motions"),
    "--explain": ("", "report what was computed, and what the scene did not require"),
    "--film": ("FILE", "file for a film beside the main result, - for standard output"),
    "--folder": ("FOLDER", "where finished parts are kept, so that an interrupted run goes on"),
    "--form": ("NAME", "form of the equations of motion"),
    "--format": ("", "format of what is printed"),
    "--fps": ("N", "frames a second of a film"),
    "--free": ("PLACES", "numbers of the scene that may change, separated by commas"),
    "--fresh": ("", "discard what an interrupted run has kept"),
    "--from": ("NAME", "the one input whose response is shown"),
    "--general": ("", "project one run on the modes instead"),
    "--help": ("", "show this help message and exit"),
    "--identification": ("", "method of identification"),
    "--identified-modes": ("FILE", "file for the identified modes, which fit and mac read, - for standard output"),
    "--impulse": ("", "impulse response"),
    "--input": ("WORDS", "inputs of a linear model"),
    "--keep-modes": ("N", "number of slowest modes to which the motion is restricted"),
    "--kind": ("", "kind of input shaper"),
    "--largest-angle": ("DEG", "largest angle of any link that periodic orbits reach"),
    "--linear": ("", "compare ways to the natural frequencies instead"),
    "--links": ("", "kind of the links"),
    "--loci": ("", "follow every frequency along one --vary by its mode shape"),
    "--loss": ("", "cost of a residual"),
    "--max": ("QUANTITY=VALUE", "largest value that a quantity may have"),
    "--maximize": ("QUANTITY", "quantity to make large"),
    "--measure": ("NAME[:N]", "what is measured of every point"),
    "--members": ("N", "number of members of the ensemble"),
    "--method": ("NAME", "method of integration"),
    "--minimal": ("", "without uncontrollable and unobservable states"),
    "--minimize": ("QUANTITY", "quantity to make small"),
    "--mode": ("R", "a row of the table of modes"),
    "--modes": ("1:10", "rows of the table of modes"),
    "--names": ("", "whose letters the parts of a scene have"),
    "--of": ("NAMES", "outputs that are shown"),
    "--orbits": ("", "use exact periodic orbits where a mode is starred"),
    "--order": ("N", "order of an identified model"),
    "--output": ("FILE", "file for the main result, - for standard output"),
    "--over": ("SECONDS", "duration of a travel"),
    "--over-hz": ("FROM:TO", "frequencies between which peaks count"),
    "--parts": ("1:12", "parts of a scene that are drawn, the support first"),
    "--periods": ("N", "number of periods of the drives after which a motion repeats"),
    "--phase-deg": ("DEG", "phase of the drives, from the beginning of their period, at which strobes come"),
    "--picture": ("FILE", "file for a picture beside the main result, - for standard output"),
    "--prior": ("PLACE=VALUE±STD", "what is known of a free number beforehand"),
    "--psd": ("CSV", "file of a one-sided power spectral density"),
    "--quick": ("", "a shorter version"),
    "--quiet": ("", "print nothing but the result and errors: no summary beside a file, no notes, no progress"),
    "--relative-error": ("SHARE", "largest relative error of a frequency"),
    "--report": ("FILE", "file for the full report, - for standard output"),
    "--residual": ("PERCENT", "residual swing that is allowed"),
    "--robust": ("", "tune for the worst case of all masses ±5 percent, each separately"),
    "--samples": ("N", "number of times in the output"),
    "--scale": ("", "fit the scale of every sensor too"),
    "--scheduler": ("ADDRESS", "Dask cluster that computes"),
    "--seconds": ("SECONDS", "longest duration of a film"),
    "--seed": ("N", "seed of the random numbers"),
    "--sensitivities": ("", "add the sensitivity of every frequency to every number of the scene"),
    "--settle": ("SECONDS", "time that passes before strobes are kept"),
    "--settled": ("", "begin where a simulated motion has settled"),
    "--shapes": ("", "add mode shapes and energy shares"),
    "--share": ("K/N", "compute the K-th of N shares alone, for processes with a common --folder"),
    "--show": ("WORDS", "sections of a derivation"),
    "--signals": ("WORDS", "outputs of a linear model"),
    "--speed": ("FACTOR", "speed of a film over that of the motion"),
    "--spread": ("DEG", "largest distance of starting angles from the scene's"),
    "--start": ("WORDS", "where the motion begins"),
    "--strobe": ("", "draw the last strobes, once a period of the drives"),
    "--symbolic": ("WORDS", "quantities to keep as symbols"),
    "--temperature": ("KELVIN", "temperature of thermal noise"),
    "--theme": ("", "colours of the figure"),
    "--to": ("FORMAT", "what a model is exported to"),
    "--tolerance": ("TOL", "relative error of a step of the integrator"),
    "--travel": ("METRES", "how far the cart travels, smoothly"),
    "--uncertain": ("PLACE=WIDTH", "a number of the scene that is uncertain, and how much"),
    "--vary": ("PLACE=VALUES", "a number of the scene that takes several values"),
    "--when": ("SECONDS", "time at which a hoist's lengths are taken"),
    "--where": ("COLUMN=VALUE", "which rows of a record are used"),
    "--window": ("SECONDS", "length of windows in which a long record is fitted"),
    "--words": ("", "everything in sentences too"),
    "--workers": ("N", "number of processes"),
}
"""Metavar, empty for a switch or a choice of words that the page lists, and meaning."""


class Former(NamedTuple):
    """What an option of a command is called now; `values` is a pattern of those that it took before and now does not.

    Where it has none, the option is gone from the command.
    """

    now: str
    values: str = ""

    def words(self, flag: str, value: str) -> str:
        """What to say to a user of the former option, nothing if this value means what it says."""
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
    ("gains", "--output"): _SIGNALS,
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
