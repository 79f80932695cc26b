"""STL meshes for printers, by manifold3d: no CAD kernel needed."""

from __future__ import annotations

from importlib import import_module
from math import isfinite
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from d4cad.errors import ExportError, InputError
from d4cad.exporters.form import PLAIN, Form
from d4cad.exporters.form_mesh import form_mesh
from d4cad.exporters.occ import require_mm, require_thickness
from d4cad.files import replacing
from d4cad.sketch import Sketch

CHORD_TOLERANCE = 0.01
"""Default distance in mm between an arc and the mesh's flat facets: below what a printer resolves."""

TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
"""One facet of a binary STL file, 50 bytes."""


def mesh(
    sketch: Sketch, thickness: float, tolerance: float = CHORD_TOLERANCE
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Vertices (n, 3) in mm and triangles (m, 3), outward normals, of the sketch (mm) extruded from z = 0.

    ``tolerance``: largest distance in mm of the facets from the exact walls. Raises InputError for a bad thickness,
    tolerance or unit, ExportError if no closed mesh results.
    """
    manifold3d = import_module("manifold3d")  # it ships no types that mypy finds
    height = require_thickness(thickness)
    require_mm(sketch)
    if not (isfinite(tolerance) and tolerance > 0):
        raise InputError(f"the chord tolerance of a mesh must be positive and finite, got {tolerance:g} mm")
    # Clipper, behind CrossSection, rounds to some 1e-8 units and has a range: hence sizes are checked above
    section = manifold3d.CrossSection(sketch.polygon(tolerance), manifold3d.FillRule.EvenOdd)
    solid = section.extrude(height)
    if solid.status() != manifold3d.Error.NoError or solid.is_empty():
        raise ExportError(f"the mesh of the part is not closed: {solid.status().name}")
    found = solid.to_mesh64()
    return np.asarray(found.vert_properties[:, :3]), np.asarray(found.tri_verts, dtype=np.int64)


def write_stl(
    sketch: Sketch,
    path: str | Path,
    *,
    thickness: float,
    tolerance: float = CHORD_TOLERANCE,
    form: Form = PLAIN,
) -> None:
    """Writes the sketch (mm), extruded from z = 0, as a binary STL file; see :func:`mesh`."""
    plain = form == PLAIN
    vertices, triangles = mesh(sketch, thickness, tolerance) if plain else form_mesh(sketch, thickness, tolerance, form)
    corners = vertices[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    facets = np.zeros(len(triangles), TRIANGLE)
    facets["normal"] = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    facets["corners"] = corners
    with replacing(path) as temporary:
        header = b"d4cad, millimetres".ljust(80) + np.uint32(len(facets)).tobytes()
        temporary.write_bytes(header + facets.tobytes())
