"""Triangle meshes of every form.

Solids with level faces and vertical walls, and turned ones, are made by manifold3d from polygons within the chord
tolerance. Leaning walls and fillets are tessellated by OpenCASCADE from the exact solid, because polygons cannot
follow the corners between them; manifold3d merges the faces and says whether the mesh closes.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from importlib import import_module
from math import ceil, isfinite, pi, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from d4cad.errors import ExportError, InputError
from d4cad.exporters.form import PLAIN, Form, Revolve
from d4cad.exporters.offset import explored
from d4cad.exporters.plan import Column, Plan, plan
from d4cad.exporters.revolve import profile
from d4cad.exporters.solids import solids_of
from d4cad.sketch import Sketch

TURN = 0.35
"""Largest angle in radians between neighbouring facets of a tessellated surface, however large the tolerance."""

Mesh = tuple[NDArray[np.float64], NDArray[np.int64]]


def form_mesh(sketch: Sketch, thickness: float, tolerance: float, form: Form = PLAIN) -> Mesh:
    """Vertices (n, 3) in mm and triangles (m, 3), outward normals, of the sketch (mm) in a form.

    ``tolerance``: largest distance in mm of the facets from the exact walls. Raises InputError for a bad number or a
    form that does not fit, ExportError if no closed mesh results.
    """
    if not (isfinite(tolerance) and tolerance > 0):
        raise InputError(f"the chord tolerance of a mesh must be positive and finite, got {tolerance:g} mm")
    if form.revolve is not None:
        return _arrays(_turned(profile(sketch, form.revolve), form.revolve, tolerance))
    parts = plan(sketch, thickness, form)
    if parts.straight:
        return _arrays(_assembled(parts, tolerance))
    return _arrays(_tessellated(solids_of(sketch, thickness, form), tolerance))


def _section(sketch: Sketch, tolerance: float) -> Any:
    manifold3d = import_module("manifold3d")  # it ships no types that mypy finds
    return manifold3d.CrossSection(sketch.polygon(tolerance), manifold3d.FillRule.EvenOdd)


def _assembled(parts: Plan, tolerance: float) -> Any:
    body = _stack(parts.add, tolerance)
    for columns in (parts.cut, parts.hollow):
        if columns:
            body -= _stack(columns, tolerance)
    return body


def _stack(columns: Sequence[Column], tolerance: float) -> Any:
    """The union of columns with vertical walls."""
    bodies = [
        _section(slab.sketch, tolerance).extrude(slab.top - slab.bottom).translate((0.0, 0.0, slab.bottom))
        for column in columns
        for slab in column.slabs
    ]
    return reduce(lambda a, b: a + b, bodies)


def _turned(half: Sketch, revolve: Revolve, tolerance: float) -> Any:
    """A chord over the angle a of the widest circle, of radius R, is R (1 - cos(a / 2)) from it: about R a^2 / 8."""
    radius = half.bounds[2]
    segments = max(12, ceil(2 * pi / sqrt(8 * min(tolerance / radius, 0.1))))
    return _section(half, tolerance).revolve(segments, revolve.degrees)


def _tessellated(found: Sequence[Any], tolerance: float) -> Any:
    """One closed body of OpenCASCADE solids."""
    manifold3d = import_module("manifold3d")
    bodies = []
    for solid in found:
        import_module("OCP.BRepMesh").BRepMesh_IncrementalMesh(solid, tolerance, False, TURN, False)
        vertices, triangles, count = [], [], 0
        for face in explored(solid, "FACE"):
            corners, facets = _facets(face)
            vertices.append(corners)
            triangles.append(facets + count)
            count += len(corners)
        soup = manifold3d.Mesh64(np.concatenate(vertices), np.concatenate(triangles).astype(np.uint64))
        soup.merge()
        bodies.append(manifold3d.Manifold(soup))
    return reduce(lambda a, b: a + b, bodies)


def _facets(face: Any) -> Mesh:
    """The triangulation that OpenCASCADE keeps with a face, outward."""
    location = import_module("OCP.TopLoc").TopLoc_Location()
    tool = import_module("OCP.BRep").BRep_Tool
    found = tool.Triangulation_s(face, location)
    if found is None:
        raise ExportError("the CAD kernel could not mesh a face of the part: another chord tolerance may work")
    move = location.Transformation()
    nodes = [found.Node(i).Transformed(move) for i in range(1, found.NbNodes() + 1)]
    corners = np.array([(p.X(), p.Y(), p.Z()) for p in nodes])
    facets = np.array([found.Triangle(i).Get() for i in range(1, found.NbTriangles() + 1)], dtype=np.int64) - 1
    backwards = face.Orientation() == import_module("OCP.TopAbs").TopAbs_Orientation.TopAbs_REVERSED
    return corners, facets[:, ::-1] if backwards else facets


def _arrays(body: Any) -> Mesh:
    """Of a manifold3d body that is closed."""
    if body.status() != import_module("manifold3d").Error.NoError or body.is_empty():
        raise ExportError(f"the mesh of the part is not closed: {body.status().name}")
    found = body.to_mesh64()
    return np.asarray(found.vert_properties[:, :3]), np.asarray(found.tri_verts, dtype=np.int64)
