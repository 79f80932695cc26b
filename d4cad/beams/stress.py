"""Displacements and stresses of a part in mm and MPa."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from d4cad.beams.occupancy import solid_elements
from d4cad.beams.problem import Point, Problem
from d4cad.errors import InputError
from d4cad.objectives.solid import solve_solid
from d4cad.program import Floats
from d4cad.sketch import Sketch

Bools = NDArray[np.bool_]

REFINEMENT = 4
"""Elements of the fine grid along one of the design's."""


@dataclass(frozen=True, slots=True, eq=False)
class Analysis:
    """A part under the problem's loads, on a grid of elements that are solid or empty.

    solid: (height, width) bool. side: of an element, mm. compliance: with total load, stiffness and thickness 1, summed
    over the load cases, as the benchmarks give it; work: the same in N mm, load times displacement. displacement:
    (width + 1, height + 1) mm, the largest of the load cases at each node. von_mises: (height, width) MPa at the
    elements' centres, the largest of the load cases; 0 where empty.
    """

    solid: Bools
    side: float
    compliance: float
    work: float
    displacement: Floats
    von_mises: Floats

    @property
    def volume(self) -> int:
        """Number of solid elements."""
        return int(self.solid.sum())


def analysed(problem: Problem, part: Sketch, refinement: float = REFINEMENT) -> Analysis:
    """The part, a sketch in mm, on a grid with elements ``refinement`` times as small as the design's.

    An element is solid where its centre lies inside the part. Raises InputError where the part does not carry the load
    on that grid.
    """
    solid = solid_elements(part, problem.grid(refinement), problem.element / refinement)
    return analysed_elements(problem, solid, refinement)


def analysed_elements(problem: Problem, solid: Bools, refinement: float = REFINEMENT) -> Analysis:
    """The same for solid elements (height, width) of that grid; those outside of the domain do not count."""
    domain = problem.domain(refinement)
    grid, side = domain.elastic.grid, problem.element / refinement
    solid = solid & domain.inside
    response = solve_solid(domain.elastic, solid)
    # with total load F, stiffness E and thickness t in place of 1: u F / (E t)
    per_load = problem.force / (problem.material.young * problem.thickness)
    moved = response.displacement * per_load
    largest = np.hypot(moved[0::2], moved[1::2]).max(axis=1)
    stress = element_stress(problem, moved[domain.elastic.dofs], side)  # (elements, 3, cases)
    equivalent = von_mises(stress).max(axis=1).reshape(solid.shape)
    return Analysis(
        solid=solid,
        side=side,
        compliance=response.compliance,
        work=response.compliance * problem.force * per_load,
        displacement=largest[grid.nodes],
        von_mises=np.where(solid, equivalent, 0.0),
    )


def element_stress(problem: Problem, moved: Floats, side: float) -> Floats:
    """Stresses xx, yy, xy (elements, 3, cases) in MPa at the centres of square elements in plane stress.

    moved: (elements, 8, cases) displacements in mm of the corners, as `Grid.dofs` orders them.
    """
    nu = problem.material.poisson
    elastic = np.array([[1, nu, 0], [nu, 1, 0], [0, 0, (1 - nu) / 2]]) * (problem.material.young / (1 - nu * nu))
    x, y = np.array([-1, 1, 1, -1]), np.array([-1, -1, 1, 1])  # signs of the corners seen from the centre
    strain = np.zeros((3, 8))
    strain[0, 0::2], strain[1, 1::2], strain[2, 0::2], strain[2, 1::2] = x, y, y, x
    return np.asarray(np.einsum("ij,ejk->eik", elastic @ strain / (2 * side), moved))


def von_mises(stress: Floats) -> Floats:
    """Equivalent stress (elements, cases) of stresses xx, yy, xy (elements, 3, cases) in plane stress."""
    xx, yy, xy = stress[:, 0], stress[:, 1], stress[:, 2]
    return np.asarray(np.sqrt(xx * xx - xx * yy + yy * yy + 3 * xy * xy))


def peak_stress(analysis: Analysis, window: int = REFINEMENT) -> tuple[float, Point]:
    """The largest von Mises stress in MPa and where it is, in mm.

    Averaged over windows of ``window`` x ``window`` elements, one of the design's, that are at least half solid: steps
    of the grid along the boundary raise the stress of single elements. At a notch no wider than a window the true peak
    is higher.
    """
    height, width = (n // window * window for n in analysis.solid.shape)
    shape = (height // window, window, width // window, window)

    def sums(values: Floats) -> Floats:
        return np.asarray(values[:height, :width].reshape(shape).sum(axis=(1, 3)))

    filled = sums(analysis.solid.astype(np.float64))
    total = sums(analysis.von_mises)
    mean = np.where(filled >= window * window / 2, total / np.maximum(filled, 1), 0.0)
    row, col = np.unravel_index(int(np.argmax(mean)), mean.shape)
    size = window * analysis.side
    return float(mean[row, col]), ((float(col) + 0.5) * size, (float(row) + 0.5) * size)


def minimum_member(analysis: Analysis) -> float:
    """The width in mm of the narrowest member, within 1.5 elements of the analysis's grid.

    Twice the least distance by which the part can be shrunk until two of its holes, or a hole and the outside, run into
    each other, or a piece of some thickness comes off. A part without any such member has the width of its thickest
    place.
    """
    from scipy.ndimage import distance_transform_edt, label

    depth = distance_transform_edt(np.pad(analysis.solid, 1))
    deepest = float(depth.max())
    if deepest == 0:
        raise InputError("the part has no material")
    corners = np.ones((3, 3))

    def gaps(distance: float) -> int:
        return int(label(depth <= distance, structure=corners)[1])

    def pieces(distance: float) -> int:
        # what comes off counts if it is thicker by an element: a wedge's tip is no member
        labels, _ = label(depth > distance)
        thick = np.unique(labels[depth > distance + 1.0])
        return int(np.count_nonzero(thick))

    distances = np.unique(depth[depth > 0])
    before = gaps(0.0), pieces(0.0)
    for distance in distances:
        if gaps(float(distance)) < before[0] or pieces(float(distance)) > before[1]:
            return float(2 * distance - 0.5) * analysis.side
    return float(2 * deepest - 0.5) * analysis.side
