"""STL: triangles for printers, nothing else."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from d4cad.exporters.form import PLAIN, Form
from d4cad.exporters.mesh import CHORD_TOLERANCE, mesh
from d4cad.files import replacing
from d4cad.sketch import Sketch

TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
"""One facet of a binary STL file, 50 bytes."""


def write_stl(
    sketch: Sketch, path: str | Path, *, thickness: float, tolerance: float = CHORD_TOLERANCE, form: Form = PLAIN
) -> None:
    """Writes the sketch (mm), by default extruded from z = 0, as a binary STL file; raises as `mesh.mesh` does."""
    vertices, triangles = mesh(sketch, thickness, tolerance, form)
    corners = vertices[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    facets = np.zeros(len(triangles), TRIANGLE)
    facets["normal"] = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    facets["corners"] = corners
    with replacing(path) as temporary:
        header = b"d4cad, millimetres".ljust(80) + np.uint32(len(facets)).tobytes()
        temporary.write_bytes(header + facets.tobytes())
