"""From an outline to the program that draws it: the way back from `ArcLine.outline`."""

from __future__ import annotations

import numpy as np

from d4cad.grammars.arc_line.structure import Structure
from d4cad.program import Program
from d4cad.sketch import Sketch


def drawn(sketch: Sketch) -> Program[Structure]:
    """The program of a sketch in world units: its loops in order, its lines lines and its arcs arcs."""
    loops = sketch.loops
    bulges = [bulge for loop in loops for bulge in loop.bulges]
    structure = Structure(tuple(len(loop.bulges) for loop in loops), tuple(bulge != 0 for bulge in bulges))
    points = [x for loop in loops for point in loop.points for x in point]
    return Program(structure, np.array([*points, *(bulge for bulge in bulges if bulge != 0)]))
