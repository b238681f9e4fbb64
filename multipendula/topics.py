"""What every command tells, and what one wants when one calls it: the words of the help pages."""

from __future__ import annotations

ABOUT = (
    "Frequencies, mode shapes and motion of multi-pendulum systems: chains of bobs, rods and rigid bodies in the plane "
    "or in space, alone or hung from one cart that couples them."
)

TOPICS = {
    "look": ("scenes", "schema", "completion"),
    "modes": ("table", "shapes", "matrices"),
    "motion": ("simulate", "plot", "animate", "check", "tradeoff", "advise", "chaos"),
    "coupling and synchronization": ("explain", "sweep", "sync"),
    "control": ("export", "gains", "response", "shaper"),
    "symbols and proof": ("derive", "enclose"),
}
"""Commands by what one wants."""

TELLS = {
    "scenes": "Every shipped scene has a name that commands take in place of a file. With a name, its file is printed: "
    "a start for a scene of your own, in TOML and SI units, with angles in degrees from the hanging rest.",
    "schema": "Editors that know JSON Schema complete a scene file while it is written and mark what is wrong in it.",
    "completion": "The shell then completes commands, options, names of scenes, files of the right kind, places of a "
    "scene and words such as those of --show and --measure. Write the lines to a file once and have your shell read it "
    "whenever it starts. It works where `multipendula` itself is found.",
    "table": "One row a mode: frequency and period, how many shapes share it, its family in words, how much the cart "
    "takes part, its modal effective mass, the angle up to which the linear frequency is right to 1 %, and a bound on "
    "its relative error. With dampers damping ratios come in, where links stand up growth rates.",
    "shapes": "One panel a mode, drawn at the largest angle that you ask for; a mode that several shapes share shows "
    "one of each sort. What stands still is drawn still.",
    "matrices": "Mass, stiffness and damping matrix about the scene's rest, M q'' + D q' + K q = 0, with the names of "
    "the coordinates: x of the cart, then the absolute angle of every link, copies counted out.",
    "explain": "What mass a force on the cart feels at each frequency, which modes leave the cart still and which move "
    "it, how fast pendula exchange energy, what the cart's mass does to it at both ends, and what dampers take from "
    "each family. Every number stands with its formula.",
    "simulate": "The full equations at any angle, with what proves the run: drift of energy, of momentum and of the "
    "constraints. The start is the scene's own, a mode at an amplitude, or angles at rest. A saved run goes on. With "
    "--accuracy the cheapest way that keeps to it is found.",
    "plot": "Of a saved run or a scene that is simulated first. Dotted lines in the spectrum are the frequencies of "
    "the table of modes.",
    "animate": "Of a saved run or a scene that is simulated first, as a GIF that plays everywhere, as MP4 (extra "
    "`video`), or as a page with buttons (HTML).",
    "check": "Every mode is released at several amplitudes, simulated for 40 periods and its frequency measured, "
    "beside what the table promises: the small-angle frequency, how it shifts with amplitude, and where it is off by "
    "1 %. With --general one run is projected on the modes instead.",
    "tradeoff": "Linear modes, modes with corrected frequencies, every integrator at several tolerances, plain and "
    "compiled: what each costs, by how much it is wrong, and until when errors can be told at all.",
    "advise": "Modes in closed form where the motion is small, a few modes for long chains, else integration: every "
    "attempt is listed with its time, and the last one with what shows that its error is below what you asked for.",
    "chaos": "The largest Lyapunov exponent with its uncertainty, from tangent vectors along an ensemble of starts; "
    "where it cannot be told from none, what it is below. paper:000 and paper:001 test what two papers claim.",
    "sweep": "One to three numbers of a scene, named by their place in the file, are set to every combination of "
    "values, on all cores. What is done is kept beside --output and taken up again after Ctrl-C. With --loci the "
    "frequencies are followed by their shapes along one number, and crossings told from veerings.",
    "sync": "For scenes with drives, van der Pol torques or escapements: in which configurations they can keep "
    "swinging, which one this start ends in and when, by averaged equations; then the same measured in a simulation of "
    "the full ones. With --vary every configuration is followed along one number of the scene instead.",
    "export": "z' = A z + B u, y = C z + D u about the scene's rest, with a name and a unit for every state, input and "
    "output; sampled with --discrete.",
    "gains": "Controllability and observability as numbers instead of ranks: the gain of every mode from each input "
    "and to each output, relative to the mode that the signal knows best.",
    "response": "Magnitude and phase of every output from one input, or its answer to an impulse, in closed form over "
    "the modes, whose frequencies are marked.",
    "shaper": "Impulses to convolve a command with, so that the load hangs still at the end of a move (Singer & "
    "Seering 1990). Printed as times and amplitudes that sum to one.",
    "derive": "The whole derivation from the Lagrangian to the modes, to read or to paste into a lecture, each step "
    "confirmed by a second route. paper:000, paper:001 and paper:002 print a paper's equations as printed and as they "
    "should read.",
    "enclose": "Two decimals a frequency between which it provably lies, by ball arithmetic. Needs the extra "
    "`certified`, and a scene without dampers, joint springs and standing links.",
}
"""What each command tells, below its one line."""

TITLES = {
    "what is asked": (
        *("input", "output", "from", "of", "modes", "mode", "vary", "measure", "loci", "amplitude", "general", "quick"),
        *("ensemble", "kind", "count", "drive", "digits", "symbolic", "links", "equilibrium"),
        *("minimal", "discrete", "impulse"),
    ),
    "the motion": ("start", "duration", "samples"),
    "how it is computed": ("method", "form", "tolerance", "accuracy", "keep-modes", "workers", "scheduler", "fresh"),
    "what is shown and written": ("format", "to", "shapes", "show", "explain", "theme", "fps", "speed", "seconds"),
}
"""Options by title, each under the longest of its names; those that take a FILE are written."""
