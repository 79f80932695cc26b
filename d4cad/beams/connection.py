"""Whether loads find their way to supports: through the domain before a search, through the part after it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from d4cad.beams.occupancy import solid_elements
from d4cad.beams.problem import Problem
from d4cad.errors import InputError
from d4cad.objectives.fem import holds
from d4cad.objectives.solid import touched_dofs
from d4cad.sketch import Sketch

Bools = NDArray[np.bool_]


def require_supported(problem: Problem) -> None:
    """Raises InputError, naming the load, unless each load is held through material that the domain may have."""
    domain = problem.domain()
    _require_held(problem, domain.inside & ~domain.void, 1.0, "the material that the domain may have")


def require_carried(problem: Problem, part: Sketch, refinement: float = 4.0) -> None:
    """Raises InputError, naming the load, unless each load is held through the part, a sketch in mm.

    refinement: of the grid on whose element centres the part is looked at.
    """
    grid = problem.grid(refinement)
    solid = solid_elements(part, grid, problem.element / refinement)
    _require_held(problem, solid, refinement, "the part")


def _require_held(problem: Problem, solid: Bools, refinement: float, what: str) -> None:
    """Pieces are joined along the sides of elements: a corner carries no moment."""
    from scipy.ndimage import label

    elastic = problem.domain(refinement).elastic
    grid, side = elastic.grid, problem.element / refinement
    pieces, _ = label(solid)
    every = np.ones((grid.width + 1, grid.height + 1), dtype=np.bool_)
    for load in problem.loads:
        if not any(load.force):
            continue
        loaded = np.zeros(grid.size, dtype=np.bool_)
        loaded[2 * problem.nodes(grid, load.place, side, every, "load")] = True
        carrying = np.unique(pieces.ravel()[loaded[grid.dofs].any(axis=1)])
        carrying = carrying[carrying > 0]
        if carrying.size == 0:
            raise InputError(f"the load at {load.place} does not touch {what}")
        if not any(holds(grid, elastic.fixed & touched_dofs(grid, pieces == k)) for k in carrying):
            raise InputError(f"no support holds {what} at the load at {load.place}: it is a mechanism")
