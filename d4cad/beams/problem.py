"""A structural problem as data: domain, material, supports, loads and fixed regions, in mm, N and MPa."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from d4cad.errors import InputError
from d4cad.objectives.domain import MARGIN, Domain
from d4cad.objectives.fem import Grid, PlaneStress
from d4cad.program import Floats

Bools = NDArray[np.bool_]
Point = tuple[float, float]

NEAR = 0.5 - 1e-6
"""Share of an element within which a node belongs to a place."""

LARGEST = 2_000_000
"""The most elements that a problem may have: beyond, the banded solver needs more memory than machines have."""


@dataclass(frozen=True, slots=True)
class Place:
    """Part of the plane, in mm, y up: a segment from ``start`` to ``end`` thickened by ``radius``, or a box of those
    corners.
    """

    start: Point
    end: Point
    radius: float = 0.0
    box: bool = False

    def distances(self, x: Floats, y: Floats) -> Floats:
        """How far points are from the place, mm; 0 inside."""
        if self.box:
            (x0, y0), (x1, y1) = self.start, self.end
            return np.hypot(np.maximum(np.maximum(x0 - x, x - x1), 0), np.maximum(np.maximum(y0 - y, y - y1), 0))
        start, end, p = complex(*self.start), complex(*self.end), x + 1j * y
        along = end - start
        share = np.clip(((p - start) * np.conj(along)).real / abs(along) ** 2, 0, 1) if along else np.zeros(x.shape)
        return np.maximum(np.abs(p - start - share * along) - self.radius, 0.0)

    def misses(self, width: float, height: float, margin: float) -> bool:
        """Whether the place's extent keeps more than ``margin`` away from a domain of that size."""
        reach = self.radius + margin
        return any(
            max(ends) < -reach or min(ends) > side + reach
            for *ends, side in zip(self.start, self.end, (width, height), strict=True)
        )

    def __str__(self) -> str:
        (x0, y0), (x1, y1) = self.start, self.end
        if self.box:
            return f"the box from ({x0:g}, {y0:g}) to ({x1:g}, {y1:g}) mm"
        if self.start == self.end:
            return (
                f"({x0:g}, {y0:g}) mm"
                if self.radius == 0
                else f"the circle of {self.radius:g} mm at ({x0:g}, {y0:g}) mm"
            )
        return f"the segment from ({x0:g}, {y0:g}) to ({x1:g}, {y1:g}) mm"


@dataclass(frozen=True, slots=True)
class Support:
    """A place that cannot move in x, in y or in both: ``fix`` is "x", "y" or "xy"."""

    place: Place
    fix: str = "xy"


@dataclass(frozen=True, slots=True)
class Load:
    """A total force in N, spread evenly over a place. Loads of one ``case`` act together."""

    place: Place
    force: Point
    case: str = ""


@dataclass(frozen=True, slots=True)
class Material:
    """young: MPa. poisson: a pure number. strength: stress in MPa at which it yields, None where no one asks.

    Raises InputError for what no material has.
    """

    young: float = 210e3
    poisson: float = 0.3
    strength: float | None = None

    def __post_init__(self) -> None:
        if not (isfinite(self.young) and self.young > 0):
            raise InputError(f"Young's modulus must be a positive number of MPa, got {self.young:g}")
        if not -1 < self.poisson < 0.5:
            raise InputError(f"Poisson's ratio must lie between -1 and 0.5, got {self.poisson:g}")
        if self.strength is not None and not (isfinite(self.strength) and self.strength > 0):
            raise InputError(f"the yield strength must be a positive number of MPa, got {self.strength:g}")


@dataclass(frozen=True)
class Problem:
    """What is to be held up, and with how much material.

    size: width and height of the domain in mm, its lower left corner at (0, 0). element: side of an element in mm.
    volume: share of the domain that may be material. cuts: what is no part of the domain; voids, solids: what must stay
    empty or be filled (a void in a solid is empty). thickness: mm.
    """

    name: str
    size: Point
    element: float
    volume: float
    supports: tuple[Support, ...]
    loads: tuple[Load, ...]
    material: Material = Material()
    thickness: float = 10.0
    cuts: tuple[Place, ...] = ()
    voids: tuple[Place, ...] = ()
    solids: tuple[Place, ...] = ()

    def __post_init__(self) -> None:
        width, height = self.size
        if not (isfinite(width) and isfinite(height) and min(width, height) > 0):
            raise InputError(f"the domain's size must be two positive numbers of mm, got {width:g} and {height:g}")
        if not (isfinite(self.element) and 0 < self.element <= min(width, height) / 4):
            raise InputError(
                f"an element must be positive and at most a quarter of the domain's shorter side "
                f"({min(width, height) / 4:g} mm), got {self.element:g} mm"
            )
        if width * height / self.element**2 > LARGEST:
            raise InputError(f"elements of {self.element:g} mm are too small for {width:g} x {height:g} mm")
        if not 0 < self.volume < 1:
            raise InputError(f"the volume must be a share between 0 and 1 of the domain, got {self.volume:g}")
        if not self.supports:
            raise InputError("there is no support")
        if not any(any(load.force) for load in self.loads):
            raise InputError("there is no load")
        for load in self.loads:
            if not all(isfinite(part) for part in load.force):
                raise InputError(f"the load at {load.place} must be finite, got {load.force}")
        for support in self.supports:
            if support.fix not in ("x", "y", "xy"):
                raise InputError(f'the support at {support.place} must fix "x", "y" or "xy", got {support.fix!r}')
        if not (isfinite(self.thickness) and self.thickness > 0):
            raise InputError(f"the thickness must be a positive number of mm, got {self.thickness:g}")

    @cached_property
    def cases(self) -> tuple[str, ...]:
        """Names of the load cases, in order of appearance."""
        return tuple(dict.fromkeys(load.case for load in self.loads))

    @property
    def force(self) -> float:
        """The total of all loads in N, by which forces are divided where lengths are elements and stiffness is 1."""
        return float(sum(np.hypot(*load.force) for load in self.loads))

    def grid(self, refinement: float = 1.0) -> Grid:
        """The grid with elements ``refinement`` times as small; InputError if the domain is no whole number of them."""
        counts = [side / self.element * refinement for side in self.size]
        if any(abs(count - round(count)) > 1e-6 * count for count in counts):
            width, height = self.size
            raise InputError(
                f"the domain of {width:g} x {height:g} mm is no whole number of elements of {self.element:g} mm"
            )
        return Grid(round(counts[1]), round(counts[0]))

    def divides(self, refinement: float) -> bool:
        """Whether there is a grid of that refinement."""
        try:
            self.grid(refinement)
        except InputError:
            return False
        return True

    def domain(self, refinement: float = 1.0) -> Domain:
        """The problem on a grid, total load 1 and lengths in elements of it.

        Raises InputError for places that hold no node or no material, a volume that the solids exceed, and supports
        that let the part move.
        """
        grid = self.grid(refinement)
        side = self.element / refinement
        x, y = np.meshgrid((np.arange(grid.width) + 0.5) * side, (np.arange(grid.height) + 0.5) * side)
        inside = ~_covered(self.cuts, x, y)
        void = _covered(self.voids, x, y) & inside
        solid = _covered(self.solids, x, y) & inside & ~void
        held = _touched(grid, inside)
        fixed = np.zeros(grid.size, dtype=np.bool_)
        for support in self.supports:
            nodes = self.nodes(grid, support.place, side, held, "support")
            for axis, letter in enumerate("xy"):
                if letter in support.fix:
                    fixed[2 * nodes + axis] = True
        carrying = _touched(grid, inside & ~void)
        loads = np.zeros((grid.size, len(self.cases)))
        for load in self.loads:
            nodes = self.nodes(grid, load.place, side, carrying, "load")
            share = self._shares(grid, load.place, nodes, side)
            for axis in (0, 1):
                loads[2 * nodes + axis, self.cases.index(load.case)] += load.force[axis] / self.force * share
        elastic = PlaneStress.of(grid, fixed, loads, self.material.poisson)
        volume = self.volume * float(inside.sum())
        if not solid.sum() < volume:
            raise InputError(
                f"the solid regions alone are {solid.sum() / inside.sum():.3g} of the domain, more than the volume of "
                f"{self.volume:g}"
            )
        if not volume <= float((inside & ~void).sum()):
            raise InputError(f"the void regions leave no room for a volume of {self.volume:g}")
        margin = max(round(MARGIN * refinement), 1)
        mirrored = (
            _is_mirrored(grid, (inside, solid, void), fixed, loads, 0),
            _is_mirrored(grid, (inside, solid, void), fixed, loads, 1),
        )
        return Domain(inside, solid, void, elastic, volume, mirrored, margin)

    def nodes(self, grid: Grid, place: Place, side: float, held: Bools, what: str) -> NDArray[np.int64]:
        """Numbers of the nodes in a place, ordered along x then y."""
        x, y = _node_places(grid, side)
        near = place.distances(x, y) < NEAR * side
        if not near.any():
            raise InputError(
                f"the {what} at {place} lies outside of the domain of {self.size[0]:g} x {self.size[1]:g} mm"
            )
        nodes = grid.nodes[near & held]
        if nodes.size == 0:
            raise InputError(f"the {what} at {place} touches no material")
        return np.asarray(nodes)

    def _shares(self, grid: Grid, place: Place, nodes: NDArray[np.int64], side: float) -> Floats:
        """The share of a load on each of its nodes: even along a segment, whose end nodes have half an element each."""
        share = np.ones(nodes.size)
        if not place.box and place.start != place.end and nodes.size > 1:
            x, y = _node_places(grid, side)
            order = np.empty(grid.size // 2)
            along = np.array(place.end) - np.array(place.start)
            order[grid.nodes.ravel()] = (x * along[0] + y * along[1]).ravel()
            share[[int(np.argmin(order[nodes])), int(np.argmax(order[nodes]))]] = 0.5
        return np.asarray(share / share.sum())


def _node_places(grid: Grid, side: float) -> tuple[Floats, Floats]:
    """Coordinates (width + 1, height + 1) of the nodes in mm."""
    x, y = np.meshgrid(np.arange(grid.width + 1.0) * side, np.arange(grid.height + 1.0) * side, indexing="ij")
    return x, y


def _covered(places: tuple[Place, ...], x: Floats, y: Floats) -> Bools:
    found = np.zeros(x.shape, dtype=np.bool_)
    for place in places:
        found |= place.distances(x, y) <= 0
    return found


def _touched(grid: Grid, elements: Bools) -> Bools:
    """The nodes (width + 1, height + 1) that have one of the elements (height, width) beside them."""
    found = np.zeros((grid.width + 1, grid.height + 1), dtype=np.bool_)
    for i in (0, 1):
        for j in (0, 1):
            found[i : i + grid.width, j : j + grid.height] |= elements.T
    return found


def _is_mirrored(grid: Grid, masks: tuple[Bools, ...], fixed: Bools, loads: Floats, axis: int) -> bool:
    """Whether the problem is its mirror image along an axis (0: x), each load case up to its sign."""
    if (grid.height if axis else grid.width) % 2:
        return False
    if any(not np.array_equal(mask, np.flip(mask, 1 - axis)) for mask in masks):
        return False
    image = np.flip(grid.nodes, axis)
    for way in (0, 1):
        here, there = 2 * grid.nodes + way, 2 * image + way
        if not np.array_equal(fixed[here], fixed[there]):
            return False
    both = [
        (np.stack([loads[2 * grid.nodes + way, k] for way in (0, 1)]),
         np.stack([loads[2 * image + way, k] * (-1 if way == axis else 1) for way in (0, 1)]))
        for k in range(loads.shape[1])
    ]  # fmt: skip
    return all(np.allclose(a, b, atol=1e-12) or np.allclose(a, -b, atol=1e-12) for a, b in both)
