"""Exact faces and solids in OpenCASCADE, through its Python binding OCP alone.

OCP comes with build123d or with CadQuery and costs a second to import, so every import is inside a function. Only
gp, BRepBuilderAPI and friends are used: TopTools and TColgp collections do not exist in every version.
Shapes are OCP's own TopoDS objects, typed Any because OCP carries no usable types.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from math import isfinite
from typing import Any

import numpy as np

from d4cad.edges import chords
from d4cad.errors import ExportError, InputError
from d4cad.loop import Circle, Loop, Point
from d4cad.sketch import Face, Sketch

FLATTEST = 3e7
"""Radius in mm above which an arc is passed on as a line: further on rounding nears CONFUSION."""

CAUTIOUS = 3e5
"""The same for a face that the kernel finds invalid: from here to 1e6 mm about 1% of valid corners between an arc and
another edge are called crossings by its checker (seen in 7.9 and 8.0). Over a chord of 50 mm the line is 1 um off."""

CONFUSION = 1e-7
"""OpenCASCADE's tolerance in mm: an arc with less sagitta is a line to it."""

SMALLEST, LARGEST = 1e-4, 1e7
"""Sizes in mm that the kernel's tolerance and its float coordinates leave room for: 0.1 um to 10 km."""


def require_kernel() -> None:
    """Raises ExportError if no CAD kernel is installed, or one that cannot be imported."""
    try:
        import_module("OCP")
        import_module("OCP.gp")
    except ImportError as error:
        if not (isinstance(error, ModuleNotFoundError) and error.name == "OCP"):
            raise broken("the CAD kernel", error) from error
        raise ExportError(
            "STEP needs a CAD kernel: pip install 'd4cad[build123d]' or pip install 'd4cad[cadquery]'"
        ) from error


def broken(name: str, error: ImportError) -> ExportError:
    """One sentence for a library that is installed and cannot be imported."""
    reason = " ".join(str(error).split())
    return ExportError(f"{name} is installed but cannot be imported ({reason}): `d4cad doctor` says how to mend it")


@contextmanager
def kernel_errors() -> Iterator[None]:
    """Turns what OpenCASCADE throws into ExportError."""
    known = vars(import_module("OCP.Standard")).values()  # in Python these share no base class but Exception
    failures = tuple(kind for kind in known if isinstance(kind, type) and issubclass(kind, Exception))
    try:
        yield
    except failures as error:
        raise ExportError(f"the CAD kernel failed: {error}") from error


def require_thickness(thickness: float | None) -> float:
    """The thickness in mm. Raises InputError unless it is positive, finite and of a size that exists."""
    if thickness is None or not (isfinite(thickness) and thickness > 0):
        given = "none" if thickness is None else f"{thickness:g}"
        raise InputError(f"a solid needs a positive, finite thickness in mm, got {given}")
    _require_size("thickness", thickness)
    return float(thickness)


def _require_size(name: str, size: float) -> None:
    if not SMALLEST <= size <= LARGEST:
        raise InputError(f"the {name} of a part must be from {SMALLEST:g} to {LARGEST:g} mm, got {size:g} mm")


def require_mm(sketch: Sketch) -> None:
    """Raises InputError unless the sketch has faces, is in mm and of a size that exists."""
    if sketch.unit != "mm":
        raise InputError(f"a CAD file is in mm but this sketch is in {sketch.unit!r} units: scale it first")
    if not sketch.faces:
        raise InputError("an empty sketch cannot be written: it has no faces")
    xmin, ymin, xmax, ymax = sketch.bounds
    _require_size("width", xmax - xmin)
    _require_size("height", ymax - ymin)


def faces(sketch: Sketch) -> list[Any]:
    """One valid TopoDS_Face in the plane z = 0, normal +z, for each face of a sketch in mm.

    Neighbouring edges share their vertex; full circles are one closed edge, so that extruding gives one cylinder.
    Raises ExportError if there is no kernel or it refuses.
    """
    require_kernel()
    require_mm(sketch)
    with kernel_errors():
        return [_sound_face(face) for face in sketch.faces]


def solids(sketch: Sketch, thickness: float) -> list[Any]:
    """One valid TopoDS_Solid for each face, from z = 0 up to ``thickness`` mm.

    Raises InputError for a thickness that is not positive, ExportError if the kernel is missing or its result invalid.
    """
    height = require_thickness(thickness)
    require_kernel()
    require_mm(sketch)
    with kernel_errors():
        return [_solid(face, height) for face in sketch.faces]


def _solid(face: Face, height: float) -> Any:
    up = import_module("OCP.gp").gp_Vec(0.0, 0.0, height)
    for flattest in (FLATTEST, CAUTIOUS):
        solid = import_module("OCP.BRepPrimAPI").BRepPrimAPI_MakePrism(_face(face, flattest), up).Shape()
        if is_valid(solid):
            return solid
    x, y = face.outer.points[0]
    raise ExportError(f"the CAD kernel finds the solid at ({x:g}, {y:g}) mm invalid")


def compound(shapes: list[Any]) -> Any:
    """The shape itself if there is one, a TopoDS_Compound of them otherwise."""
    if len(shapes) == 1:
        return shapes[0]
    brep, topods = import_module("OCP.BRep"), import_module("OCP.TopoDS")
    builder, whole = brep.BRep_Builder(), topods.TopoDS_Compound()
    builder.MakeCompound(whole)
    for shape in shapes:
        builder.Add(whole, shape)
    return whole


def is_valid(shape: Any) -> bool:
    """Whether OpenCASCADE's topology and geometry check passes."""
    return bool(import_module("OCP.BRepCheck").BRepCheck_Analyzer(shape).IsValid())


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


def volume(shape: Any) -> float:
    """Volume in mm^3, by the kernel's own integration of the faces."""
    properties = import_module("OCP.GProp").GProp_GProps()
    import_module("OCP.BRepGProp").BRepGProp.VolumeProperties_s(shape, properties)
    return float(properties.Mass())


def _sound_face(face: Face) -> Any:
    """The face, checked only where an arc is flat enough for the kernel to find fault: it costs more than building."""
    if not any(_has_flat_arc(loop) for loop in face.loops):
        return _face(face, FLATTEST)
    for flattest in (FLATTEST, CAUTIOUS):
        made = _face(face, flattest)
        if is_valid(made):
            return made
    x, y = face.outer.points[0]
    raise ExportError(f"the CAD kernel finds the face at ({x:g}, {y:g}) mm invalid")


def _has_flat_arc(loop: Loop) -> bool:
    edges = loop.edges
    bend = np.abs(edges.b)
    return bool(np.any((bend > 0) & (chords(edges) * (1 + bend**2) > 4 * bend * CAUTIOUS)))


def _face(face: Face, flattest: float) -> Any:
    gp, api = import_module("OCP.gp"), import_module("OCP.BRepBuilderAPI")
    plane = gp.gp_Pln(gp.gp_Pnt(0, 0, 0), gp.gp_Dir(0, 0, 1))
    maker = api.BRepBuilderAPI_MakeFace(plane, _wire(face.outer, flattest), True)
    for hole in face.holes:
        maker.Add(_wire(hole, flattest))
    if not maker.IsDone():
        x, y = face.outer.points[0]
        raise ExportError(f"the CAD kernel made no face of the loop at ({x:g}, {y:g}) mm")
    return maker.Face()


def _wire(loop: Loop, flattest: float) -> Any:
    gp, api = import_module("OCP.gp"), import_module("OCP.BRepBuilderAPI")
    maker = api.BRepBuilderAPI_MakeWire()
    circle = loop.circle
    if circle is not None:
        maker.Add(api.BRepBuilderAPI_MakeEdge(_circle(circle, loop.bulges[0] > 0)).Edge())
        return maker.Wire()
    vertices = [api.BRepBuilderAPI_MakeVertex(gp.gp_Pnt(x, y, 0)).Vertex() for x, y in loop.points]
    for i in range(len(vertices)):
        maker.Add(_edge(loop, i, vertices, flattest))
    if not maker.IsDone():
        x, y = loop.points[0]
        raise ExportError(f"the CAD kernel could not close the loop at ({x:g}, {y:g}) mm")
    return maker.Wire()


def _edge(loop: Loop, i: int, vertices: list[Any], flattest: float) -> Any:
    api = import_module("OCP.BRepBuilderAPI")
    j = (i + 1) % len(vertices)
    (x0, y0), (x1, y1), b = loop.points[i], loop.points[j], loop.bulges[i]
    chord = ((x1 - x0) ** 2 + (y1 - y0) ** 2) ** 0.5
    if abs(b) * chord / 2 < CONFUSION or chord * (1 + b * b) > 4 * abs(b) * flattest:
        maker = api.BRepBuilderAPI_MakeEdge(vertices[i], vertices[j])
    else:
        radius = chord * (1 + b * b) / (4 * abs(b))
        lift = (1 - b * b) / (4 * b)  # the centre is this share of the chord to the left of its middle
        center = ((x0 + x1) / 2 - lift * (y1 - y0), (y0 + y1) / 2 + lift * (x1 - x0))
        # counted from the start: the kernel moves a start that is near, but not on, the end of its period
        circle = _circle(Circle(center, radius), b > 0, zero=(x0 - center[0], y0 - center[1]))
        maker = api.BRepBuilderAPI_MakeEdge(circle, vertices[i], vertices[j])
    if not maker.IsDone():
        raise ExportError(f"the CAD kernel made no edge from ({x0:g}, {y0:g}) to ({x1:g}, {y1:g}) mm, bulge {b:g}")
    return maker.Edge()


def _circle(circle: Circle, counter_clockwise: bool, zero: Point = (1.0, 0.0)) -> Any:
    """A gp_Circ in z = 0 whose axis points up, or down for a clockwise one, and whose angle 0 is towards ``zero``."""
    gp = import_module("OCP.gp")
    axis = gp.gp_Dir(0, 0, 1 if counter_clockwise else -1)
    x, y = circle.center
    return gp.gp_Circ(gp.gp_Ax2(gp.gp_Pnt(x, y, 0), axis, gp.gp_Dir(*zero, 0)), circle.radius)
