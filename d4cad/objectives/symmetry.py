"""Half of a structure that is its own mirror image: half of the unknowns, and the same energies."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from d4cad.objectives.fem import Grid, PlaneStress
from d4cad.program import Floats


class Work(NamedTuple):
    """energy: (height, width), u' K0 u of each element summed over the load cases. compliance: as of a Response."""

    energy: Floats
    compliance: float


@dataclass(frozen=True, slots=True, eq=False)
class Folded:
    """The part of a structure that is solved. halves: whether it is the left half, and the lower half."""

    elastic: PlaneStress
    halves: tuple[bool, bool]

    @classmethod
    def of(cls, elastic: PlaneStress, mirrored: tuple[bool, bool]) -> Folded:
        """A structure that is its own mirror image (left to right, bottom to top)."""
        halves = [False, False]
        for axis in (0, 1):
            half = half_of(elastic, axis) if mirrored[axis] else None
            if half is not None:
                elastic, halves[axis] = half, True
        return cls(elastic, (halves[0], halves[1]))

    def solve(self, young: Floats) -> Work:
        """The work in the whole structure for stiffnesses (height, width) that are their own mirror image too.

        Raises InputError where they carry nothing.
        """
        grid = self.elastic.grid
        found = self.elastic.solve(np.ascontiguousarray(young[: grid.height, : grid.width]))
        energy = found.energy
        if self.halves[0]:
            energy = np.concatenate([energy, energy[:, ::-1]], axis=1)
        if self.halves[1]:
            energy = np.concatenate([energy, energy[::-1]], axis=0)
        return Work(energy, found.compliance * 2 ** sum(self.halves))


def half_of(elastic: PlaneStress, axis: int) -> PlaneStress | None:
    """The left (axis 0) or lower half of a structure that is its own mirror image.

    Where all loads are symmetric, the plane of symmetry is held across; where all push on one half as they pull on the
    other, it is held along. Loads on it are shared by the halves. None where the load cases differ in that.
    """
    whole, loads = elastic.grid, elastic.loads
    image = np.empty_like(loads)
    for way in (0, 1):
        image[2 * whole.nodes + way] = loads[2 * np.flip(whole.nodes, axis) + way] * (-1 if way == axis else 1)
    symmetric, opposite = (np.allclose(loads, sign * image, atol=1e-12) for sign in (1, -1))
    if not symmetric and not opposite:
        return None
    grid = Grid(whole.height, whole.width // 2) if axis == 0 else Grid(whole.height // 2, whole.width)
    kept = whole.nodes[: grid.width + 1, : grid.height + 1]
    fixed, part = np.zeros(grid.size, dtype=np.bool_), np.zeros((grid.size, loads.shape[1]))
    for way in (0, 1):
        fixed[2 * grid.nodes + way] = elastic.fixed[2 * kept + way]
        part[2 * grid.nodes + way] = loads[2 * kept + way]
    middle = grid.nodes[-1] if axis == 0 else grid.nodes[:, -1]
    fixed[2 * middle + (axis if symmetric else 1 - axis)] = True
    part[2 * middle] /= 2
    part[2 * middle + 1] /= 2
    return PlaneStress(grid, fixed, np.where(fixed[:, None], 0.0, part), elastic.stiffness, grid.dofs)
