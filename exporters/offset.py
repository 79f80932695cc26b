"""The outline of a hollow: everything that is further than a wall from the edge of a sketch."""

from __future__ import annotations

from importlib import import_module
from itertools import product
from math import pi, tan
from typing import Any

import numpy as np

from d4cad.errors import ExportError, GeometryError
from d4cad.exporters.inset import inset
from d4cad.exporters.occ import compound, faces, kernel_errors, require_kernel
from d4cad.loop import Circle, Loop, Point
from d4cad.sketch import Face, Sketch

FINE = 1e-3
"""Chord tolerance in mm of the polygons by which an offset is checked, and by which areas may differ along an edge."""

RETRIES = (1.0, 1 + 1e-6, 1 - 1e-6, 1 + 1e-4)
"""Factors of the distance that are tried: OpenCASCADE fails where three edges happen to meet in one point."""


def offset(sketch: Sketch, wall: float) -> Sketch:
    """The part of the sketch (mm) that is at least ``wall`` mm from its edges, as lines and arcs.

    Where every edge lives on it is the inset, whose corners are sharp; otherwise OpenCASCADE finds what is left.
    Raises GeometryError if nothing is left, ExportError if the kernel is missing or its result wrong.
    """
    try:
        return inset(sketch, wall)
    except GeometryError:
        pass
    require_kernel()
    found = tuple(face for island in sketch.faces for face in _left(Sketch((island,), sketch.unit), wall))
    if not found:
        raise GeometryError(f"no part of it is {wall:g} mm from its edges")
    return Sketch(found, sketch.unit)


def _left(island: Sketch, wall: float) -> tuple[Face, ...]:
    """What is left of one face."""
    wanted = _polygon_area(island, wall)
    if wanted <= FINE * island.length:
        return ()
    for factor, attempt in product(RETRIES, (_offset_whole, _offset_parts)):
        try:
            with kernel_errors():
                found = Sketch.from_loops(attempt(island, wall * factor), island.unit)
        except (ExportError, GeometryError):
            continue
        if abs(found.area - wanted) <= 0.01 * wanted + FINE * found.length:
            return found.faces
    x, y = island.faces[0].outer.points[0]
    raise ExportError(
        f"the CAD kernel could not move the outline at ({x:g}, {y:g}) mm inwards by {wall:g} mm: try another wall"
    )


def _polygon_area(sketch: Sketch, wall: float) -> float:
    """The area by manifold3d, which works on polygons and is never wrong by much."""
    manifold3d = import_module("manifold3d")
    section = manifold3d.CrossSection(sketch.polygon(FINE), manifold3d.FillRule.EvenOdd)
    return float(section.offset(-wall, manifold3d.JoinType.Round, 2.0, 256).area())


def _offset_whole(island: Sketch, wall: float) -> list[Loop]:
    """All loops at once, which fails where moved loops meet."""
    return _kernel_offset(island, -wall)


def _offset_parts(island: Sketch, wall: float) -> list[Loop]:
    """Every loop on its own, then the grown holes are cut out."""
    (face,) = island.faces
    left = compound(faces(_moved(face.outer, -wall)))
    for hole in face.holes:
        maker = import_module("OCP.BRepAlgoAPI").BRepAlgoAPI_Cut(left, compound(faces(_moved(hole.reversed(), wall))))
        if not maker.IsDone():
            raise ExportError("the CAD kernel could not cut a hole out of a hollow")
        left = maker.Shape()
    return [_loop(wire) for wire in explored(left, "WIRE")]


def _moved(outline: Loop, distance: float) -> Sketch:
    """The region within a counter-clockwise loop, grown by ``distance`` (shrunk if negative) with round corners."""
    circle = outline.circle
    if circle is not None and circle.radius + distance > 0:
        return Sketch.from_loops([Circle(circle.center, circle.radius + distance).loop()], "mm")
    return Sketch.from_loops(_kernel_offset(Sketch((Face(outline),), "mm"), distance), "mm")


def _kernel_offset(island: Sketch, distance: float) -> list[Loop]:
    join = import_module("OCP.GeomAbs").GeomAbs_JoinType
    (face,) = faces(island)
    maker = import_module("OCP.BRepOffsetAPI").BRepOffsetAPI_MakeOffset(face, join.GeomAbs_Arc, False)
    maker.Perform(distance)
    if not maker.IsDone():
        raise ExportError("the CAD kernel made no offset")
    return [_loop(wire) for wire in explored(maker.Shape(), "WIRE")]


def explored(shape: Any, kind: str) -> list[Any]:
    """The sub-shapes of a kind, "SOLID", "FACE", "WIRE" or "EDGE", of their own class; shared ones more than once."""
    kinds, topods = import_module("OCP.TopAbs").TopAbs_ShapeEnum, import_module("OCP.TopoDS").TopoDS
    name = kind.capitalize()
    cast = getattr(topods, f"{name}_s", None) or getattr(topods, name)  # OCP 7 has the first, OCP 8 the second
    explorer = import_module("OCP.TopExp").TopExp_Explorer(shape, getattr(kinds, f"TopAbs_{kind}"))
    found = []
    while explorer.More():
        found.append(cast(explorer.Current()))
        explorer.Next()
    return found


def _loop(wire: Any) -> Loop:
    """A wire of lines and circular arcs in the plane z = 0, its edges in any order."""
    edges = [_ends(edge) for edge in explored(wire, "EDGE")]
    if len(edges) == 1:
        circle, start, bulge = edges[0][0], edges[0][1], edges[0][3]
        if circle is None:
            raise GeometryError(f"the offset has an open edge at ({start[0]:g}, {start[1]:g})")
        return circle.loop(clockwise=bulge < 0)
    points, bulges = [], []
    _, start, end, bulge = edges.pop(0)
    while True:
        points.append(start)
        bulges.append(bulge)
        if not edges:
            return Loop(tuple(points), tuple(bulges))
        nearest = min(range(len(edges)), key=lambda i: abs(complex(*edges[i][1]) - complex(*end)))
        _, start, end, bulge = edges.pop(nearest)


def _ends(edge: Any) -> tuple[Circle | None, Point, Point, float]:
    """Full circle or None, start, end, bulge of an edge in its own direction."""
    curve = import_module("OCP.BRepAdaptor").BRepAdaptor_Curve(edge)
    kinds, turned = import_module("OCP.GeomAbs").GeomAbs_CurveType, import_module("OCP.TopAbs").TopAbs_Orientation
    first, last = curve.FirstParameter(), curve.LastParameter()
    a, z = curve.Value(first), curve.Value(last)
    start, end = (a.X(), a.Y()), (z.X(), z.Y())
    backwards = edge.Orientation() == turned.TopAbs_REVERSED
    if backwards:
        start, end = end, start
    if curve.GetType() == kinds.GeomAbs_Line:
        return None, start, end, 0.0
    if curve.GetType() != kinds.GeomAbs_Circle:
        raise GeometryError("the offset has an edge that is neither line nor arc")
    circle = curve.Circle()
    up = circle.Axis().Direction().Z() > 0
    sweep = (last - first) * (1 if up != backwards else -1)
    whole = np.isclose(abs(sweep), 2 * pi, rtol=1e-9)
    center = circle.Location()
    return (
        Circle((center.X(), center.Y()), circle.Radius()) if whole else None,
        start,
        end,
        float(np.sign(sweep)) if whole else tan(sweep / 4),
    )
