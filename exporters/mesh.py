"""Closed triangle meshes by manifold3d: no CAD kernel needed."""

from __future__ import annotations

from importlib import import_module
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from d4cad.errors import ExportError, InputError
from d4cad.exporters.form import PLAIN, Form
from d4cad.exporters.form_mesh import form_mesh
from d4cad.exporters.occ import require_mm, require_thickness
from d4cad.sketch import Sketch

CHORD_TOLERANCE = 0.01
"""Default distance in mm between an arc and the mesh's flat facets: below what a printer resolves."""

Mesh = tuple[NDArray[np.float64], NDArray[np.int64]]
"""Vertices (n, 3) and triangles (m, 3), whose corners go counter-clockwise seen from outside."""


def require_tolerance(tolerance: float) -> float:
    """The chord tolerance in mm. Raises InputError unless it is positive and finite."""
    if not (isfinite(tolerance) and tolerance > 0):
        raise InputError(f"the chord tolerance of a mesh must be positive and finite, got {tolerance:g} mm")
    return float(tolerance)


def mesh(sketch: Sketch, thickness: float, tolerance: float = CHORD_TOLERANCE, form: Form = PLAIN) -> Mesh:
    """The sketch (mm) from z = 0 to ``thickness`` mm, extruded or in another form, as a closed mesh in mm.

    ``tolerance``: largest distance in mm of the facets from the exact walls. Raises InputError for a bad thickness,
    tolerance or unit, ExportError if no closed mesh results.
    """
    manifold3d = import_module("manifold3d")  # it ships no types that mypy finds
    height = require_thickness(thickness)
    require_mm(sketch)
    if form != PLAIN:
        return form_mesh(sketch, height, require_tolerance(tolerance), form)
    # Clipper, behind CrossSection, rounds to some 1e-8 units and has a range: hence sizes are checked above
    section = manifold3d.CrossSection(sketch.polygon(require_tolerance(tolerance)), manifold3d.FillRule.EvenOdd)
    solid = section.extrude(height)
    if solid.status() != manifold3d.Error.NoError or solid.is_empty():
        raise ExportError(f"the mesh of the part is not closed: {solid.status().name}")
    found = solid.to_mesh64()
    return np.asarray(found.vert_properties[:, :3]), np.asarray(found.tri_verts, dtype=np.int64)
