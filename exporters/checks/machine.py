"""Checks of the part on a machine: a closed mesh, the bed, and other parts beside it."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module

import numpy as np

from d4cad.booleans import intersection
from d4cad.edges import Complexes, Edges, Floats, distances
from d4cad.errors import ExportError
from d4cad.exporters.checks.limits import Limits
from d4cad.exporters.checks.outline import ENOUGH
from d4cad.exporters.checks.report import Finding, Place, Status, judged, not_checked
from d4cad.exporters.checks.spans import centre_lines, edges_and_corners, nearest, on
from d4cad.exporters.mesh import mesh as extruded
from d4cad.loop import ROUNDING
from d4cad.sketch import Sketch

ANGLES = 720
"""Rotations of the part on the bed that are tried first, over half a turn."""


def watertight(sketch: Sketch, limits: Limits) -> Finding:
    """Whether the extruded mesh is closed, consistently oriented and of positive volume, by manifold3d and trimesh.

    The genus (number of handles, less the bodies beyond the first) must be what the holes say.
    """
    name = "watertight"
    try:
        manifold3d, trimesh = import_module("manifold3d"), import_module("trimesh")
    except ImportError as error:
        return not_checked(name, f"{error.name} is not installed", "")
    try:
        vertices, triangles = extruded(sketch, limits.thickness)
    except ExportError as error:
        return Finding(name, Status.FAILED, str(error), unit="")
    solid = trimesh.Trimesh(vertices, triangles, process=False)
    facts = {
        "is watertight": bool(solid.is_watertight),
        "has consistent normals": bool(solid.is_winding_consistent),
        "has a volume": bool(solid.is_volume),
    }
    body = manifold3d.Manifold(manifold3d.Mesh64(np.array(vertices), triangles.astype(np.uint64)))
    genus = sum(len(face.holes) for face in sketch.faces) - len(sketch.faces) + 1
    facts["is a manifold"] = body.status() == manifold3d.Error.NoError
    facts["has as many handles as the outline has holes"] = body.genus() == genus
    wrong = [fact for fact, true in facts.items() if not true]
    text = "the mesh is not one that " + " and ".join(wrong) if wrong else f"closed, {solid.volume:.6g} mm3"
    details = {"volume_mm3": float(solid.volume), "triangles": float(len(triangles)), "genus": float(body.genus())}
    return Finding(name, judged(not wrong), text, unit="", details=details)


def bed(sketch: Sketch, limits: Limits) -> Finding:
    """Whether the part fits on the bed in some rotation. Measured: the factor by which the bed would have to be
    larger, 1 or less where it fits."""
    name = "bed"
    if limits.bed is None:
        return not_checked(name, "no size of the bed was given", "x bed")
    hull = _hull(sketch)
    angle, size = _best_rotation(hull, limits.bed)
    need = float(max(size[0] / limits.bed[0], size[1] / limits.bed[1]))
    shown = f"{size[0]:.2f} x {size[1]:.2f} mm"
    turn = f"turned by {np.degrees(angle):.2f} degrees" if angle else "as it is"
    on = f"a bed of {limits.bed[0]:g} x {limits.bed[1]:g} mm"
    ok = need <= 1 / ENOUGH
    text = f"{'fits' if ok else 'does not fit'} on {on}: {turn} it is {shown}"
    details = {"angle_deg": float(np.degrees(angle)), "width_mm": float(size[0]), "height_mm": float(size[1])}
    return Finding(name, judged(ok), text, need, 1.0, "x bed", details=details)


def _hull(sketch: Sketch) -> Complexes:
    """Corners of the convex hull, arcs to within a micrometre or a millionth of the extent."""
    xmin, ymin, xmax, ymax = sketch.bounds
    points = np.concatenate([face.outer.polygon(1e-6 * max(xmax - xmin, ymax - ymin)) for face in sketch.faces])
    from scipy.spatial import ConvexHull

    corner = points[ConvexHull(points).vertices]
    return np.asarray(corner[:, 0] + 1j * corner[:, 1])


def _best_rotation(hull: Complexes, size: tuple[float, float]) -> tuple[float, Floats]:
    """The rotation (radians, from 0 to a half turn) in which the hull needs the least multiple of the bed, and its
    width and height then. As it is, if that fits."""
    given = _sizes(hull, np.zeros(1))[:, 0]
    if given[0] <= size[0] and given[1] <= size[1]:
        return 0.0, given

    def need(angles: Floats) -> Floats:
        found = _sizes(hull, angles)
        return np.asarray(np.maximum(found[0] / size[0], found[1] / size[1]))

    # where a side of the hull lies on the bed's, the sizes have their least values (rotating calipers)
    sides = np.angle(np.roll(hull, -1) - hull)
    angles = np.concatenate(
        [np.linspace(0, np.pi, ANGLES, endpoint=False), -sides % np.pi, (np.pi / 2 - sides) % np.pi]
    )
    best, width = float(angles[need(angles).argmin()]), np.pi / ANGLES
    for _ in range(24):  # and between those, where width and height are equally good
        tried = best + np.linspace(-width, width, 9)
        best, width = float(tried[need(tried).argmin()]), width / 3
    best %= np.pi
    return best, _sizes(hull, np.array([best]))[:, 0]


def _sizes(hull: Complexes, angles: Floats) -> Floats:
    """Width and height (2, k) of the hull in rotations (k,)."""
    turned = hull[:, None] * np.exp(1j * angles)
    return np.stack([np.ptp(turned.real, axis=0), np.ptp(turned.imag, axis=0)])


def interference(sketch: Sketch, others: Sequence[Sketch], limits: Limits) -> Finding:
    """Whether the part and others overlap as they are placed: exact common area, and the volume of the thickness."""
    name = "interference"
    if not others:
        return not_checked(name, "no other part was given", "mm2")
    common = [intersection(sketch, other) for other in others]
    area = sum(part.area for part in common)
    places = tuple(Place(*_middle(face.outer.bounds), face.area) for part in common for face in part.faces)
    details = {"volume_mm3": area * limits.thickness}
    slack = ROUNDING * sketch.area
    text = "no part overlaps another"
    if area > slack:
        text = f"parts overlap by {area:.6g} mm2, {details['volume_mm3']:.6g} mm3"
    return Finding(name, judged(area <= slack), text, area, 0.0, "mm2", places[:12], details)


def clearance(sketch: Sketch, others: Sequence[Sketch], limits: Limits) -> Finding:
    """The least distance between the outlines of the part and others."""
    name = "clearance"
    if not others:
        return not_checked(name, "no other part was given")
    found = [_nearest(sketch, other) for other in others]
    length, p, q = min(found, key=lambda item: item[0])
    middle = (p + q) / 2
    place = Place(middle.real, middle.imag, length, (q.real, q.imag))
    text = f"the nearest outlines are {length:.3f} mm apart at ({place.x:.2f}, {place.y:.2f})"
    if any(intersection(sketch, other).area > ROUNDING * sketch.area for other in others):
        return Finding(name, Status.FAILED, "the parts overlap", 0.0, limits.min_gap)
    if limits.min_gap is None:
        return Finding(name, Status.NOT_CHECKED, f"no limit was given; {text}", length, None, places=(place,))
    return Finding(name, judged(length >= limits.min_gap * ENOUGH), text, length, limits.min_gap, places=(place,))


def _nearest(a: Sketch, c: Sketch) -> tuple[float, complex, complex]:
    """The shortest distance between outlines that do not cross, and its ends: at an end of an edge or where both have
    one normal."""
    first, _ = edges_and_corners(a.loops)
    second, _ = edges_and_corners(c.loops)
    best: tuple[float, complex, complex] = (np.inf, 0j, 0j)
    for e, f in ((first, second), (second, first)):
        d = distances(f.take((None, slice(None))), e.z0[:, None])
        k, m = np.unravel_index(int(d.argmin()), d.shape)
        if d[k, m] < best[0]:
            foot = nearest(f.take([m]), e.z0[[k]])
            best = (float(d[k, m]), complex(e.z0[k]), complex(foot[0]))
    slack = ROUNDING * (a.length + c.length)
    both = Edges(*(np.concatenate(pair) for pair in zip(first, second, strict=True)))
    i, j = (x.ravel() for x in np.meshgrid(np.arange(first.b.size), first.b.size + np.arange(second.b.size)))
    for p, q in zip(*centre_lines(both, i, j), strict=True):
        d = np.abs(q - p)
        near = np.flatnonzero(d < best[0])
        near = near[on(both.take(i[near]), p[near], slack) & on(both.take(j[near]), q[near], slack)]
        if near.size:
            k = near[d[near].argmin()]
            best = (float(d[k]), complex(p[k]), complex(q[k]))
    return best


def _middle(box: tuple[float, float, float, float]) -> tuple[float, float]:
    return (box[0] + box[2]) / 2, (box[1] + box[3]) / 2
