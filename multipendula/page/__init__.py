"""The live page: one HTML file in which a scene hangs, swings and is changed, or a saved motion plays.

In: a scene or a trajectory.  Out: a page without any request to a network.  `document` puts it together from
`page.html`, `page.css` and the JavaScript modules in `modules/`, and writes the equations of one link into it
(`nonlinear.dynamics.steps`); `payload` is its data, `equations` has for pages of structures their own, all equations
and the drawing (`carriers.js`), and the equations and switches of scenes with dry friction or forces (`switched.js`),
of which `scalars` writes what Python runs as JavaScript.  In `modules/`, `system.js` is a scene as numbers, `modes.js`
its modes under the numbers of the table, `equations.js` the loops of its equations of motion, `motion.js` a run;
`main.js` joins them to what is seen.  Start with `document`.
"""

from multipendula.page.document import LARGEST, LARGEST_OF_STRUCTURES, MODULES, joined, page
from multipendula.page.equations import scaffold_of, structure_module
from multipendula.page.payload import MOST_LINKS, recording_of, scene_data

__all__ = [
    "LARGEST",
    "LARGEST_OF_STRUCTURES",
    "MODULES",
    "MOST_LINKS",
    "joined",
    "page",
    "recording_of",
    "scaffold_of",
    "scene_data",
    "structure_module",
]
