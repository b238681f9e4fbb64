"""Examples for the help pages: what to type, and what it does.  The tests run every one, a page in order."""

from __future__ import annotations

Examples = tuple[tuple[str, str], ...]

FIRST: Examples = (
    ("scenes", "what is shipped"),
    ("table paper-cart-2", "every mode of two double pendula on a cart"),
    ("shapes paper-cart-2 -o shapes.png", "the same, drawn"),
    ("explain paper-cart-2", "why the two exchange energy, and how slowly"),
    ("animate paper-cart-3 --duration 2 -o run.gif", "three of them let go from level"),
    ("scenes crane-hook > mine.toml", "a scene to edit; then `multipendula table mine.toml`"),
)

EXAMPLES: dict[str, Examples] = {
    "scenes": (
        ("scenes", "names and titles"),
        ("scenes crane-hook", "one of them, to read"),
        ("scenes crane-hook > mine.toml", "the start of a scene of your own"),
    ),
    "schema": (
        ("schema > scene.schema.json", "once, beside your scenes"),
        ("scenes crane-hook > mine.toml", "then put `#:schema ./scene.schema.json` in its first line"),
    ),
    "completion": (
        ("completion bash > ~/.multipendula.bash", "then `. ~/.multipendula.bash` in ~/.bashrc"),
        ("completion zsh > ~/.multipendula.zsh", "then `. ~/.multipendula.zsh` in ~/.zshrc, after compinit"),
        ("completion fish > ~/.multipendula.fish", "then `source ~/.multipendula.fish` in ~/.config/fish/config.fish"),
        ("completion powershell > ~/multipendula.ps1", "then `. ~/multipendula.ps1` in the file that $PROFILE names"),
    ),
    "table": (
        ("table paper-cart-2", "every mode of two double pendula on a cart"),
        ("table rope --modes 1:5", "the first five of a rope of 1000 links"),
        ("table cart-upright", "about a rest in which links stand: growth rates"),
        ("table crane-hook --format latex -o crane.tex", "to paste into a paper"),
        ("table paper-cart-2 --format json --shapes", "every digit, with shapes and energy shares"),
    ),
    "shapes": (
        ("shapes paper-cart-2 -o shapes.png", "every mode"),
        ("shapes rope --modes 1:4 -o rope.svg", "the first four, as vectors"),
        ("shapes crane-hook --amplitude 10 -o hook.pdf", "drawn at 10 degrees at most"),
    ),
    "matrices": (
        ("matrices chain-3", "of three bobs in a row"),
        ("matrices paper-cart-2 --format json -o paper.json", "every digit, with the names of the coordinates"),
    ),
    "explain": (
        ("explain paper-cart-2", "families, beats and the mass that the cart seems to have"),
        ("explain metronomes -o coupling.png", "in words and in one picture"),
        ("explain crane-two-loads --format markdown", "two loads that differ: who exchanges with whom"),
    ),
    "simulate": (
        ("simulate paper-cart-3 --duration 20 -o run.npz", "from the scene's own start, level at rest"),
        ("simulate run.npz --duration 10 -o more.npz", "the saved run goes on"),
        ("simulate crane-hook --start mode:2:10 --duration 20", "in the shape of mode 2, its largest angle 10 degrees"),
        ("simulate chain-2 --start angles:60,0 --duration 10 --accuracy 1e-6", "every angle right to a microradian"),
        ("simulate chain-3 --form maximal --duration 5 --explain", "with every pivot force, and what that took"),
    ),
    "plot": (
        ("simulate paper-cart-3 --duration 10 -o run.npz", "a run to draw"),
        ("plot run.npz -o run.png", "angles, cart, energies, phase portrait, spectrum"),
        ("plot chain-2 --start mode:1:30 --duration 10 -o mode.svg", "the run of a scene, in one go"),
    ),
    "animate": (
        ("simulate chain-2 --start angles:90,90 --duration 4 -o run.npz", "a run to film"),
        ("animate run.npz --seconds 2 -o run.gif", "the first two seconds of film"),
        ("animate run.npz --speed 4 --fps 15 -o fast.html", "all of it four times as fast, with buttons"),
    ),
    "check": (
        ("check chain-2 --mode 1 --amplitude 10,30", "the slow mode at two amplitudes"),
        ("check crane-hook --mode 2 --amplitude 20 -o check.png", "with a picture"),
        ("check chain-2 --general --start angles:10,0 --duration 30", "one run, projected on the modes"),
    ),
    "tradeoff": (
        ("tradeoff chain-1 --start mode:1:10 --duration 1", "every way to a second of a small swing"),
        ("tradeoff chain-1 --start angles:60 --duration 1 -o t.png", "with a picture: time against error"),
    ),
    "advise": (
        ("advise paper-cart-2 --start mode:2:5 --accuracy 1e-3", "a minute right to 1e-3 rad: modes are enough"),
        ("advise chain-2 --start mode:1:30 --accuracy 1e-6 --duration 10 -o run.npz", "here not; the run is kept"),
    ),
    "chaos": (
        ("chaos chain-2 --duration 10 --ensemble 4", "a short look at a double pendulum"),
        ("chaos paper-cart-1 --duration 20 -o lyapunov.png", "with 16 starts, and how the estimate settles"),
    ),
    "sweep": (
        ("sweep paper-cart-2 --vary support.mass=1:1000:20log --measure beat -o beat.csv", "20 masses of the cart"),
        (
            "sweep crane-two-loads --vary 'pendulum[0].links[0].length=6:14:20' --loci --picture loci.png",
            "frequencies that veer where two lengths agree",
        ),
        (
            "sweep chain-2 --vary gravity=1:10:4 --vary 'pendulum[*].links[*].mass=1,2,3' --picture map.png",
            "a map over two numbers; [*] stands for all of them",
        ),
    ),
    "sync": (
        ("sync huygens -o huygens.png --film huygens.gif", "two clocks on a beam: told, drawn and filmed"),
        ("sync huygens --vary support.mass=1:40:4log -o branches.png", "where each way to agree begins and ends"),
    ),
    "export": (
        ("export crane-hook --to mat -o crane.mat", "for MATLAB and Octave"),
        (
            "export crane-hook --to control --input cart_acceleration -o crane.py",
            "for python-control, driven by motion",
        ),
        (
            "export crane-hook --to c --discrete 0.01 --input cart_acceleration --output angles -o crane.h",
            "for a controller that samples at 100 Hz",
        ),
        ("export paper-cart-3 --to json --minimal -o small.json", "only what the cart can reach: 6 states of 14"),
    ),
    "gains": (
        ("gains crane-two-loads", "which modes the force on the trolley reaches, and how well"),
        ("gains crane-two-loads --output cart_position", "what the trolley's position alone can see"),
    ),
    "response": (
        ("response crane-hook -o bode.png", "every output of the crane"),
        ("response crane-hook --input cart_acceleration --of theta_1_2 -o load.png", "one output, the trolley driven"),
        ("response crane-hook --impulse -o impulse.svg", "after a knock on the trolley"),
    ),
    "shaper": (
        ("shaper crane-hook", "for the slowest mode"),
        ("shaper crane-hook --kind zvd --count 2", "for both, and for cables not quite as long as said"),
    ),
    "derive": (
        ("derive chain:3", "three bobs: Lagrangian, equations, M and K, polynomial, modes"),
        ("derive chain:2 --symbolic masses,lengths --format latex", "with a symbol for every mass and length"),
        ("derive cart:3x2 --links rod --show polynomial,modes", "three double rods on a cart"),
        ("derive paper-cart-2 --show polynomial", "of a scene, in exact integers"),
        ("derive paper:002", "the equations of a paper, as they should read"),
    ),
    "enclose": (
        ("enclose chain-3", "30 digits, proved"),
        ("enclose paper-cart-2 --digits 50", "more of them"),
    ),
}
"""By command."""
