"""From a program over a domain to the part in mm: cut at the domain's border, unfolded, fixed regions heeded."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from d4cad.beams.problem import Place, Problem
from d4cad.booleans import difference, intersection, union
from d4cad.edges import distances
from d4cad.errors import InputError
from d4cad.loop import Circle, Loop
from d4cad.objectives.domain import Domain
from d4cad.offsets import offset
from d4cad.sketch import Face, Sketch

JOINING = 1e-3
"""Elements within which neighbouring edges are one line or arc, as where a mirrored edge goes on."""


DIGITS = 9
"""Decimals of a coordinate in mm: what is beyond is rounding."""


def part_outline(problem: Problem, domain: Domain, drawn: Sketch, fillet: float | None = None) -> Sketch:
    """The part in mm, the domain's lower left corner at (0, 0), of an outline in world units of the domain's canvas.

    fillet: radius in mm of inside corners, fixed regions excepted. Pieces that no load touches are left out. Raises
    InputError where a hole has no room for the fillets.
    """
    canvas, element = domain.canvas, problem.element
    factor = element / canvas.pixel
    x, y = canvas.extent
    margin = domain.margin * element
    sketch = drawn.translated(x, y).scaled(factor, "mm").translated(-margin, -margin)
    width, height = (
        side / (2 if mirrored else 1) for side, mirrored in zip(problem.size, domain.mirrored, strict=True)
    )
    sketch = intersection(sketch, _box(0.0, 0.0, width, height))
    if domain.mirrored[0]:
        sketch = union(sketch, _reflected(sketch, problem.size[0], None))
    if domain.mirrored[1]:
        sketch = union(sketch, _reflected(sketch, None, problem.size[1]))
    if fillet is not None:
        sketch = filleted(sketch, fillet)
    if problem.solids:
        sketch = union(sketch, *(shape(place) for place in problem.solids))
    for place in (*problem.voids, *problem.cuts):
        sketch = difference(sketch, shape(place))
    if problem.solids or fillet is not None:
        sketch = intersection(sketch, _box(0.0, 0.0, *problem.size))
    return _loaded(_rounded(sketch.simplified(JOINING * element)), problem)


def filleted(sketch: Sketch, radius: float) -> Sketch:
    """The sketch with its inside corners rounded: grown and shrunk again, as by a cutter of that radius.

    Raises InputError where a hole is too narrow for the cutter.
    """
    closed = offset(offset(sketch, radius), -radius)
    if len(closed.loops) < len(sketch.loops):
        raise InputError(f"a hole of the part is too narrow for fillets of {radius:g} mm: choose a smaller radius")
    return closed


def _rounded(sketch: Sketch) -> Sketch:
    """The sketch without the rounding of its coordinates."""
    loops = [
        Loop(tuple((round(x, DIGITS) + 0.0, round(y, DIGITS) + 0.0) for x, y in loop.points), loop.bulges)
        for loop in sketch.loops
    ]
    return Sketch.from_loops(loops, sketch.unit)


def _loaded(sketch: Sketch, problem: Problem) -> Sketch:
    """The pieces that a load touches; all of them if none does."""
    z = np.array([complex(*point) for load in problem.loads for point in (load.place.start, load.place.end)])
    points = np.stack([z.real, z.imag], axis=1)

    def is_loaded(face: Face) -> bool:
        edges = face.outer.edges
        near = [np.min(distances(edges, np.full(edges.b.shape, q))) <= problem.element for q in z]
        return bool(np.any(near) or np.any(face.outer.contains(points)))

    kept = tuple(face for face in sketch.faces if is_loaded(face))
    return replace(sketch, faces=kept) if kept else sketch


def shape(place: Place) -> Sketch:
    """A place that has an area, as a sketch in mm."""
    if place.box:
        return _box(*place.start, *place.end)
    if place.start == place.end:
        return Sketch.from_loops([Circle(place.start, place.radius).loop()], "mm")
    (x0, y0), (x1, y1), r = place.start, place.end, place.radius
    length = ((x1 - x0) ** 2 + (y1 - y0) ** 2) ** 0.5
    nx, ny = (y1 - y0) / length * r, (x0 - x1) / length * r
    corners = ((x0 + nx, y0 + ny), (x1 + nx, y1 + ny), (x1 - nx, y1 - ny), (x0 - nx, y0 - ny))
    return Sketch.from_loops([Loop(corners, (0.0, 1.0, 0.0, 1.0))], "mm")


def _box(x0: float, y0: float, x1: float, y1: float) -> Sketch:
    return Sketch.from_loops([Loop.polyline([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])], "mm")


def _reflected(sketch: Sketch, width: float | None, height: float | None) -> Sketch:
    """The mirror image about the middle of a domain of that width or height."""

    def image(loop: Loop) -> Loop:
        points = tuple((x if width is None else width - x, y if height is None else height - y) for x, y in loop.points)
        return Loop(points, tuple(-b for b in loop.bulges))  # travelled the other way round: from_loops turns it

    return Sketch.from_loops([image(loop) for loop in sketch.loops], sketch.unit)
