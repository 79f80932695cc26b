"""Bolt circles: circles evenly on a circle, computed from its centre and radius."""

from __future__ import annotations

from math import hypot, sqrt

from d4cad.exporters.source.drawing import CENTER, Drawing
from d4cad.exporters.source.linear import Linear
from d4cad.exporters.source.words import contours

DECIMALS = 11
"""Of a sine: those that regularisation leaves exact, so that 0, 1/2 and 1 are written as such."""


def bolt_circles(drawing: Drawing) -> None:
    """Names the centre and radius of every bolt circle, and computes from them its holes and what is at its centre.

    Four holes at the corners of an upright square are none: their rows and columns are named.
    """
    found = []
    for relation in drawing.sketch.relations:
        loops = [loop for loop, _ in relation.refs]
        if relation.kind != "polar" or not all(loop in drawing.circles for loop in loops):
            continue
        points = [drawing.circles[loop] for loop in loops]
        x, y = (sum(point[axis] for point in points) / len(points) for axis in (0, 1))
        radius = sum(hypot(px - x, py - y) for px, py in points) / len(points)
        square = len(points) == 4 and all(abs(abs(px - x) - radius / sqrt(2)) <= drawing.slack for px, _ in points)
        if not square:
            found.append((loops, (x, y), radius))
    for k, (loops, middle, radius) in enumerate(found, 1):
        name = "bolt_circle" if len(found) == 1 else f"bolt_circle_{k}"
        inner = [
            loop
            for loop, (x, y) in drawing.circles.items()
            if loop not in loops and hypot(x - middle[0], y - middle[1]) <= drawing.slack
        ]
        for axis in (0, 1):
            ways = [(drawing.circles[loop][axis] - middle[axis]) / radius for loop in loops]
            drawing.name(f"{name}_{'xy'[axis]}", [(axis, loop, CENTER) for loop in inner], middle[axis])
            for loop, way in zip(loops, ways, strict=True):
                reach = Linear.of(f"{name}_radius", round(way, DECIMALS))
                drawing.places[axis, loop, CENTER] = Linear.of(f"{name}_{'xy'[axis]}") + reach
        drawing.values[f"{name}_radius"] = round(radius, drawing.decimals)
        drawing.notes[f"{name}_radius"] = f"of {contours([drawing.names[loop] for loop in loops])}"
