"""Triangle meshes of every form, by manifold3d: no CAD kernel needed.

Sections of one outline keep its edges at every height, so that a column is its sections' polygons, joined point by
point: closed as it is made, drafted walls and fillets included.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from importlib import import_module
from math import ceil, isfinite, pi, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from d4cad.edges import Floats, points_along
from d4cad.errors import ExportError, InputError
from d4cad.exporters.form import PLAIN, Form, Revolve
from d4cad.exporters.plan import Column, plan
from d4cad.exporters.revolve import profile
from d4cad.loop import Loop
from d4cad.sketch import Sketch

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
    parts = plan(sketch, thickness, form, chord=tolerance)
    body = _union(parts.add, tolerance)
    for columns in (parts.cut, parts.hollow):
        if columns:
            body -= _union(columns, tolerance)
    return _arrays(body)


def _union(columns: Sequence[Column], tolerance: float) -> Any:
    return reduce(lambda a, b: a + b, [_lofted(column, tolerance) for column in columns])


def _lofted(column: Column, tolerance: float) -> Any:
    """The closed body between the lowest and the highest section of a column."""
    manifold3d = import_module("manifold3d")  # it ships no types that mypy finds
    heights = [z for z, _ in column.profile]
    loops = [_polygons(sections, tolerance) for sections in zip(*column.sections, strict=True)]
    sizes = [len(polygons[0]) for polygons in loops]
    starts, count = np.cumsum([0, *sizes]), sum(sizes)
    levels = [np.concatenate([polygons[k] for polygons in loops]) for k in range(len(heights))]
    vertices = np.concatenate([np.c_[points, np.full(count, z)] for points, z in zip(levels, heights, strict=True)])
    here = np.arange(count)
    after = np.concatenate([start + np.roll(np.arange(size), -1) for start, size in zip(starts, sizes, strict=False)])
    ring = np.concatenate([np.c_[here, after, after + count], np.c_[here, after + count, here + count]])
    walls = [ring + k * count for k in range(len(heights) - 1)]
    floor, roof = (
        np.asarray(manifold3d.triangulate([polygons[k] for polygons in loops]), dtype=np.int64) for k in (0, -1)
    )
    triangles = np.concatenate([floor[:, ::-1], *walls, roof + (len(heights) - 1) * count])
    return manifold3d.Manifold(manifold3d.Mesh64(vertices, triangles.astype(np.uint64)))


def _polygons(sections: Sequence[Loop], tolerance: float) -> list[Floats]:
    """One polygon (n, 2) for each section of one loop, its corners the same shares of the same edges."""
    counts = np.max([[len(trace) - 1 for trace in loop.traces(tolerance)] for loop in sections], axis=0)
    found = []
    for loop in sections:
        e = loop.edges
        z = [points_along(e.take(slice(i, i + 1)), np.arange(n) / n) for i, n in enumerate(counts.tolist())]
        points = np.concatenate(z)
        found.append(np.c_[points.real, points.imag])
    return found


def _turned(half: Sketch, revolve: Revolve, tolerance: float) -> Any:
    """A chord over the angle a of the widest circle, of radius R, is R (1 - cos(a / 2)) from it: about R a^2 / 8."""
    manifold3d = import_module("manifold3d")
    segments = max(12, ceil(2 * pi / sqrt(8 * min(tolerance / half.bounds[2], 0.1))))
    section = manifold3d.CrossSection(half.polygon(tolerance), manifold3d.FillRule.EvenOdd)
    return section.revolve(segments, revolve.degrees)


def _arrays(body: Any) -> Mesh:
    """Of a manifold3d body that is closed."""
    if body.status() != import_module("manifold3d").Error.NoError or body.is_empty():
        raise ExportError(f"the mesh of the part is not closed: {body.status().name}")
    found = body.to_mesh64()
    return np.asarray(found.vert_properties[:, :3]), np.asarray(found.tri_verts, dtype=np.int64)
