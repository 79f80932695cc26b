"""Plane stress of a part of solid elements: what is empty is left out, but for a thin weak layer around the part.

For analysis on fine grids, where the banded matrix of the whole grid would be several times as large. The layer, of
1e-9 of the stiffness, keeps pieces that meet in a corner only from making the matrix singular.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from d4cad.errors import InputError
from d4cad.objectives.fem import Grid, PlaneStress, Response, holds, one_thread

Bools = NDArray[np.bool_]

WEAK = 1e-9
"""Stiffness of an empty element as a share of the solid's."""


def solve_solid(elastic: PlaneStress, solid: Bools) -> Response:
    """The response of solid elements (height, width) of stiffness 1.

    Pieces that no load acts on and that are not held are left out; displacements are 0 there. Differs by about 1e-9 of
    its value from the compliance of the whole grid with empty elements of stiffness 1e-9. Raises InputError where a
    load acts on no material, or on a piece that is not held.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.linalg import splu

    grid, dofs = elastic.grid, elastic.dofs
    here = held_pieces(grid, elastic.fixed, grown(solid)).ravel()
    parts = dofs[here]
    used = touched_dofs(grid, here)
    if elastic.loads[~used].any():
        raise InputError("a load acts on no material, or on a piece of it that the supports do not hold")
    free = used & ~elastic.fixed
    number = np.cumsum(free) - 1
    row, col = np.repeat(parts, 8, axis=1).ravel(), np.tile(parts, (1, 8)).ravel()
    value = (np.where(solid.ravel()[here], 1.0, WEAK)[:, None] * elastic.stiffness.ravel()).ravel()
    kept = free[row] & free[col]
    size = int(free.sum())
    matrix = coo_array((value[kept], (number[row[kept]], number[col[kept]])), shape=(size, size)).tocsc()
    loads = elastic.loads[free]
    with one_thread():
        # for a symmetric positive definite matrix the diagonal is a good pivot
        factor = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
        found = np.asarray(factor.solve(loads))
    displacement = np.zeros((grid.size, loads.shape[1]))
    displacement[free] = found
    return elastic.response(displacement, float(np.sum(loads * found)))


def grown(solid: Bools) -> Bools:
    """The elements (height, width) that are solid or share a node with a solid one."""
    around = np.pad(solid, 1)
    height, width = solid.shape
    return np.asarray(np.any([around[i : i + height, j : j + width] for i in range(3) for j in range(3)], axis=0))


def held_pieces(grid: Grid, fixed: Bools, elements: Bools) -> Bools:
    """Those of the elements (height, width) whose piece, joined along sides and at corners, the supports hold."""
    from scipy.ndimage import label

    pieces, _ = label(elements, structure=np.ones((3, 3)))
    supported = np.unique(pieces.ravel()[fixed[grid.dofs].any(axis=1)])
    found = [k for k in supported[supported > 0] if holds(grid, fixed & touched_dofs(grid, pieces == k))]
    return np.isin(pieces, found)


def touched_dofs(grid: Grid, elements: Bools) -> Bools:
    """The degrees of freedom (dofs,) of elements (height, width)."""
    found = np.zeros(grid.size, dtype=np.bool_)
    found[grid.dofs[elements.ravel()]] = True
    return found
