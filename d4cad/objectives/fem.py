"""Plane stress on a regular grid of bilinear squares: displacements and strain energies for a field of stiffnesses.

The stiffness matrix is banded when nodes are numbered along the shorter side, and one sparse product of a fixed map
with the elements' stiffnesses assembles it; LAPACK's banded Cholesky does the rest. One BLAS thread is faster than
two here.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import ThreadpoolController

from d4cad.errors import InputError
from d4cad.program import Floats

Bools = NDArray[np.bool_]
Ints = NDArray[np.int64]


def element_stiffness(nu: float) -> Floats:
    """Stiffness (8, 8) of a unit square of unit thickness and Young's modulus 1, integrated exactly.

    Degrees of freedom: x and y of the lower left, lower right, upper right and upper left corner, y up. Independent of
    the element's size. Formula: Sigmund, "A 99 line topology optimization code", Struct. Multidisc. Optim. 21 (2001).
    Raises InputError unless -1 < nu < 0.5.
    """
    if not -1 < nu < 0.5:
        raise InputError(f"Poisson's ratio must lie between -1 and 0.5, got {nu:g}")
    a, b = 1 / 2 - nu / 6, 1 / 8 + nu / 8
    c, d = -1 / 4 - nu / 12, -1 / 8 + 3 * nu / 8
    e, f = -1 / 4 + nu / 12, nu / 6
    rows = [
        [a, b, c, d, e, -b, f, -d],
        [b, a, -d, f, -b, e, d, c],
        [c, -d, a, -b, f, d, e, b],
        [d, f, -b, a, -d, c, b, e],
        [e, -b, f, -d, a, b, c, d],
        [-b, e, d, c, b, a, -d, f],
        [f, d, e, b, c, -d, a, -b],
        [-d, c, b, e, d, f, -b, a],
    ]
    return np.array(rows) / (1 - nu * nu)


@dataclass(frozen=True, slots=True, eq=False)
class Grid:
    """A regular grid of ``height`` x ``width`` square elements, y up: node (i, j) is column i from the left, row j up.

    Arrays over elements are (height, width) with row 0 lowest, as coverage is.
    """

    height: int
    width: int

    @property
    def nodes(self) -> Ints:
        """Numbers (width + 1, height + 1) of the nodes (i, j), consecutive along the shorter side."""
        n = np.arange((self.width + 1) * (self.height + 1))
        if self.height <= self.width:
            return n.reshape(self.width + 1, self.height + 1)
        return n.reshape(self.height + 1, self.width + 1).T

    @property
    def dofs(self) -> Ints:
        """(height * width, 8) degrees of freedom of each element, row by row: 2 node for x, 2 node + 1 for y."""
        n = self.nodes
        corners = np.stack([n[:-1, :-1], n[1:, :-1], n[1:, 1:], n[:-1, 1:]], axis=-1)
        both = np.stack([2 * corners, 2 * corners + 1], axis=-1)
        return both.transpose(1, 0, 2, 3).reshape(-1, 8)

    @property
    def size(self) -> int:
        """Number of degrees of freedom."""
        return 2 * (self.width + 1) * (self.height + 1)


@dataclass(frozen=True, slots=True, eq=False)
class Response:
    """What the loads do.

    displacement: (dofs, cases). energy: (height, width), u' K0 u of each element summed over the load cases, so that
    the compliance is the sum of stiffness x energy, and minus the energy is its derivative by the stiffness.
    compliance: summed over the load cases, load times displacement.
    """

    displacement: Floats
    energy: Floats
    compliance: float


class Assembly(NamedTuple):
    """How stiffnesses become a matrix. map: sparse, from the elements' stiffnesses to the lower band, flat. kept:
    (dofs * band,) bool, what the supports leave of the band.
    """

    map: Any
    kept: Bools


@dataclass(frozen=True, eq=False)
class PlaneStress:
    """A grid that is held and loaded: everything that does not depend on the stiffnesses.

    fixed: (dofs,) bool. loads: (dofs, cases), zero where it is fixed. stiffness: (8, 8) of an element. dofs: (elements,
    8), as of the grid.
    """

    grid: Grid
    fixed: Bools
    loads: Floats
    stiffness: Floats
    dofs: Ints

    @classmethod
    def of(cls, grid: Grid, fixed: Bools, loads: Floats, nu: float = 0.3) -> PlaneStress:
        """Raises InputError for supports that let the part move as a whole, for no load that can move it, or for a
        wrong nu.
        """
        if loads.ndim != 2 or not loads.any():
            raise InputError("there is no load")
        stiffness = element_stiffness(nu)
        if not holds(grid, fixed):
            raise InputError("the supports let the part move as a whole: hold it in x, in y and against turning")
        free = np.where(fixed[:, None], 0.0, loads)
        if not free.any():
            raise InputError("every load acts on a support in a direction that it holds, so that nothing is deformed")
        return cls(grid, fixed, free, stiffness, grid.dofs)

    @cached_property
    def assembly(self) -> Assembly:
        """The banded matrix's map. Made when first used: on fine grids the band takes much memory."""
        from scipy.sparse import csr_array

        size, dofs = self.grid.size, self.dofs
        band = int((dofs.max(axis=1) - dofs.min(axis=1)).max()) + 1
        row, col = np.repeat(dofs, 8, axis=1).ravel(), np.tile(dofs, (1, 8)).ravel()
        value, element = np.tile(self.stiffness.ravel(), len(dofs)), np.repeat(np.arange(len(dofs)), 64)
        low = row >= col
        flat = (col * band + row - col)[low]
        assembly = csr_array((value[low], (flat, element[low])), shape=(size * band, len(dofs)))
        partner = np.arange(size)[:, None] + np.arange(band)[None, :]
        lost = self.fixed[:, None] | self.fixed[np.minimum(partner, size - 1)] | (partner >= size)
        return Assembly(assembly, ~lost.ravel())

    def solve(self, young: Floats) -> Response:
        """The response to stiffnesses (height, width), all positive. Raises InputError where they carry nothing."""
        from scipy.linalg import LinAlgError, cho_solve_banded, cholesky_banded

        matrix = (self.assembly.map @ young.ravel()) * self.assembly.kept
        matrix = matrix.reshape(self.grid.size, -1)
        matrix[self.fixed, 0] = 1.0
        with one_thread():
            try:
                factor = cholesky_banded(matrix.T, lower=True, overwrite_ab=True, check_finite=False)
            except LinAlgError:
                raise InputError("the part is a mechanism: its stiffness matrix is singular") from None
            u = cho_solve_banded((factor, True), self.loads, check_finite=False)
        return self.response(u, float(np.sum(self.loads * u)))

    def response(self, displacement: Floats, compliance: float) -> Response:
        """Displacements (dofs, cases) with the energies that go with them."""
        parts = displacement[self.dofs]  # (elements, 8, cases)
        parts = parts.transpose(0, 2, 1)
        energy = np.sum((parts @ self.stiffness) * parts, axis=(1, 2))
        return Response(displacement, energy.reshape(self.grid.height, self.grid.width), compliance)


def one_thread() -> Any:
    """A context in which BLAS uses one thread."""
    return _libraries().limit(limits=1)


@cache
def _libraries() -> ThreadpoolController:
    """Found once: looking for them takes as long as solving a small grid."""
    import scipy.linalg  # noqa: F401  its BLAS must be loaded to be found

    return ThreadpoolController()


def holds(grid: Grid, fixed: Bools) -> bool:
    """Whether fixed degrees of freedom (dofs,) stop both translations and the rotation of one rigid piece."""
    i, j = np.meshgrid(np.arange(grid.width + 1.0), np.arange(grid.height + 1.0), indexing="ij")
    modes = np.zeros((grid.size, 3))
    n = grid.nodes.ravel()
    modes[2 * n, 0], modes[2 * n + 1, 1] = 1.0, 1.0
    modes[2 * n, 2], modes[2 * n + 1, 2] = -j.ravel() / grid.height, i.ravel() / grid.width
    return bool(fixed.any() and np.linalg.matrix_rank(modes[fixed], tol=1e-9) == 3)
