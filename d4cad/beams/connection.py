"""Whether loads find their way to supports: through the domain before a search, through the part after it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from d4cad.beams.occupancy import solid_elements
from d4cad.beams.problem import Problem, touched
from d4cad.errors import InputError
from d4cad.objectives.fem import Grid, holds
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

    domain = problem.domain(refinement)
    grid, fixed = domain.elastic.grid, domain.elastic.fixed
    side = problem.element / refinement
    pieces, count = label(solid)
    every = np.ones((grid.width + 1, grid.height + 1), dtype=np.bool_)
    # the material within a node's reach of each piece, and whether the supports on it hold it
    reach = [touched(grid, pieces == k) for k in range(1, count + 1)]
    held = [_is_held(reach_k, grid.nodes, fixed, grid) for reach_k in reach]
    for load in problem.loads:
        if not any(load.force):
            continue
        loaded = np.isin(grid.nodes, problem.nodes(grid, load.place, side, every, "load"))
        carrying = [k for k in range(count) if (reach[k] & loaded).any()]
        if not carrying:
            raise InputError(f"the load at {load.place} does not touch {what}")
        if not any(held[k] for k in carrying):
            raise InputError(f"no support holds {what} at the load at {load.place}: it is a mechanism")


def _is_held(reach: Bools, nodes: NDArray[np.int64], fixed: Bools, grid: Grid) -> bool:
    numbers = nodes[reach]
    here = np.zeros_like(fixed)
    here[2 * numbers] = here[2 * numbers + 1] = True
    return holds(grid, fixed & here)
