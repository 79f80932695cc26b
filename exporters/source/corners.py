"""Fillets and chamfers between lines along the axes, computed from their corner."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import copysign

from d4cad.exporters.source.drawing import Drawing, Key
from d4cad.exporters.source.linear import Linear
from d4cad.exporters.source.places import BULGE, QUARTER
from d4cad.exporters.source.sizes import NAMES


@dataclass(frozen=True, slots=True)
class _Setback:
    """The coordinate ``free`` of an end of a fillet or chamfer is ``way`` from the ``corner``'s, another vertex's."""

    free: Key
    corner: Key
    way: float

    @property
    def size(self) -> float:
        return abs(self.way)


def round_corners(drawing: Drawing) -> None:
    """Computes the ends of fillets and chamfers from their corner, which two named lines have."""
    for dimension in drawing.sketch.dimensions:
        refs = [ref for ref in dimension.refs if drawing.has_edges(ref[0])]
        quarters = all(abs(abs(drawing.loops[loop].bulges[k]) - QUARTER) <= BULGE for loop, k in refs)
        if dimension.kind != "radius" or not (refs and quarters and NAMES.fullmatch(dimension.name)):
            continue
        corners = [_setbacks(drawing, loop, k) for loop, k in refs]
        if all(corners) and _cut(drawing, dimension.name, dimension.value, corners):
            for loop, k in refs:
                points = drawing.loops[loop].points
                drawing.radii[points[k], points[drawing.after(loop, k)]] = dimension.name
    chamfers: list[list[list[_Setback]]] = []
    for loop in filter(drawing.has_edges, drawing.names):
        for k, bulge in enumerate(drawing.loops[loop].bulges):
            corner = _setbacks(drawing, loop, k) if bulge == 0 else []
            if not corner or abs(corner[0].size - corner[1].size) > drawing.slack:
                continue
            same = next((g for g in chamfers if abs(g[0][0].size - corner[0].size) <= drawing.slack), None)
            if same is None:
                chamfers.append([corner])
            else:
                same.append(corner)
    for k, corners in enumerate(sorted(chamfers, key=lambda group: -group[0][0].size), 1):
        _cut(drawing, "chamfer" if len(chamfers) == 1 else f"chamfer_{k}", corners[0][0].size, corners)


def _setbacks(drawing: Drawing, loop: int, k: int) -> list[_Setback]:
    """Those of both ends of an edge between a level and an upright line; none of any other edge."""
    before, end = (k - 1) % len(drawing.loops[loop].points), drawing.after(loop, k)
    for axis in (0, 1):
        if (1 - axis, loop, before) in drawing.level and (axis, loop, end) in drawing.level:
            ways = ((axis, loop, k), (axis, loop, end)), ((1 - axis, loop, end), (1 - axis, loop, k))
            if all(corner in drawing.places and free not in drawing.places for free, corner in ways):
                return [_Setback(free, corner, drawing.at(free) - drawing.at(corner)) for free, corner in ways]
    return []


def _cut(drawing: Drawing, name: str, size: float, corners: Sequence[Sequence[_Setback]]) -> bool:
    """Names the size by which corners are set back, unless it is not that of them all."""
    setbacks = [setback for corner in corners for setback in corner]
    if any(abs(setback.size - size) > drawing.slack for setback in setbacks):
        return False
    drawing.values[name] = round(size, drawing.decimals)
    for setback in setbacks:
        drawing.places[setback.free] = drawing.places[setback.corner] + Linear.of(name, copysign(1.0, setback.way))
    return True
