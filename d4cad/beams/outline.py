"""From a program over a domain to the part in mm: cut at the domain's border, unfolded, fixed regions as they must be."""

from __future__ import annotations


from d4cad.beams.problem import Place, Problem
from d4cad.booleans import difference, intersection, union
from d4cad.loop import Circle, Loop
from d4cad.objectives.domain import Domain
from d4cad.sketch import Sketch

JOINING = 1e-3
"""Elements within which neighbouring edges are one line or arc, as where a mirrored edge goes on."""


def part_outline(problem: Problem, domain: Domain, drawn: Sketch) -> Sketch:
    """The part in mm, the domain's lower left corner at (0, 0), of an outline in world units of the domain's canvas."""
    canvas, element = domain.canvas, problem.element
    factor = element / canvas.pixel
    x, y = canvas.extent
    margin = domain.margin * element
    sketch = drawn.translated(x, y).scaled(factor, "mm").translated(-margin, -margin)
    width, height = (side / (2 if mirrored else 1) for side, mirrored in zip(problem.size, domain.mirrored, strict=True))
    sketch = intersection(sketch, _box(0.0, 0.0, width, height))
    if domain.mirrored[0]:
        sketch = union(sketch, _reflected(sketch, problem.size[0], None))
    if domain.mirrored[1]:
        sketch = union(sketch, _reflected(sketch, None, problem.size[1]))
    if problem.solids:
        sketch = union(sketch, *(shape(place) for place in problem.solids))
    for place in (*problem.voids, *problem.cuts):
        sketch = difference(sketch, shape(place))
    if problem.solids:
        sketch = intersection(sketch, _box(0.0, 0.0, *problem.size))
    return sketch.simplified(JOINING * element)


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
        points = tuple(
            (x if width is None else width - x, y if height is None else height - y) for x, y in loop.points
        )
        return Loop(points, tuple(-b for b in loop.bulges))  # travelled the other way round: from_loops turns it

    return Sketch.from_loops([image(loop) for loop in sketch.loops], sketch.unit)
