"""Half profiles turned about an axis."""

from __future__ import annotations

from importlib import import_module
from math import atan, ceil, pi, tan
from typing import Any

import numpy as np

from d4cad.edges import points_along
from d4cad.errors import ExportError, InputError
from d4cad.exporters.form import Revolve
from d4cad.exporters.inset import normals
from d4cad.exporters.occ import CONFUSION, compound, explored, faces, is_valid, kernel_errors, require_mm, volume
from d4cad.loop import Loop
from d4cad.sketch import Face, Sketch

EXACT = 1e-6
"""Largest relative error of a volume."""

NEAR = 1e-3
"""Share of its radius by which a circle may miss the axis and still be read back as if it reached it."""

NODES, WEIGHTS = np.polynomial.legendre.leggauss(24)


def profile(sketch: Sketch, revolve: Revolve) -> Sketch:
    """The sketch (mm) placed so that the axis is x = 0, with nothing left of it.

    What is within the kernel's tolerance of the axis lies on it. Raises InputError for a profile that crosses the axis,
    or touches it in a point only, where the turned solid would pinch itself off.
    """
    require_mm(sketch)
    left = sketch.bounds[0]
    if revolve.axis == "left":
        sketch, left = sketch.translated(-left, 0.0), 0.0
    if left < -CONFUSION:
        raise InputError(f"the profile crosses its axis: it reaches to x = {left:g} mm, and must stay at x >= 0")
    loops = iter([_snapped(loop) for loop in sketch.loops])
    return Sketch(tuple(Face(next(loops), tuple(next(loops) for _ in face.holes)) for face in sketch.faces), "mm")


def _snapped(loop: Loop) -> Loop:
    points = tuple((0.0 if abs(x) <= CONFUSION else x, y) for x, y in loop.points)
    n = len(points)
    along = [points[i][0] == 0 and points[(i + 1) % n][0] == 0 and loop.bulges[i] == 0 for i in range(n)]
    for i, (x, y) in enumerate(points):
        if x == 0 and not (along[i] or along[i - 1]):
            raise InputError(
                f"the profile touches its axis in one point, (0, {y:g}) mm: give it an edge on it, or room"
            )
    found = Loop(points, loop.bulges)
    if found.bounds[0] <= CONFUSION and not any(along):
        raise InputError("the profile touches its axis with an arc: give it a straight edge on the axis, or room")
    return found


def swept_volume(sketch: Sketch, angle: float) -> float:
    """mm^3 of the turned sketch, by Pappus: the angle times the integral of x over the area, or of x^2 / 2 dy."""
    moment = 0.0
    for loop in sketch.loops:
        e = loop.edges.take((slice(None), None))
        z = points_along(e, (NODES + 1) / 2)
        rise = normals(e, z).real * np.array(loop.lengths)[:, None]  # the tangent is i times the normal to its right
        moment += float((z.real**2 / 2 * rise * WEIGHTS / 2).sum())
    return angle * moment


def revolved(sketch: Sketch, revolve: Revolve) -> list[Any]:
    """Valid TopoDS_Solids about the z axis. Raises as :func:`profile`, ExportError if the kernel fails.

    Where an arc's circle reaches the axis its torus crosses itself, and no reader of STEP finds the place of a seam on
    it: such arcs are cut into quarter turns at most, and such a solid's faces turn by half a turn at most.
    """
    half = profile(sketch, revolve)
    wanted = swept_volume(half, revolve.angle)
    horned = any(map(_makes_horn, half.loops))
    if horned:
        half = Sketch.from_loops([_quartered(loop) for loop in half.loops], "mm")
    gp, location = import_module("OCP.gp"), import_module("OCP.TopLoc").TopLoc_Location
    upright = gp.gp_Trsf()
    upright.SetValues(1, 0, 0, 0, 0, 0, -1, 0, 0, 1, 0, 0)  # the sketch's y becomes z
    axis = gp.gp_Ax1(gp.gp_Pnt(0, 0, 0), gp.gp_Dir(0, 0, 1))
    sweep = import_module("OCP.BRepPrimAPI").BRepPrimAPI_MakeRevol
    with kernel_errors():
        found = [
            solid
            for face in faces(half)
            for solid in explored(sweep(face.Moved(location(upright)), axis, revolve.angle).Shape(), "SOLID")
        ]
        if horned:
            found = [_divided(solid) for solid in found]
        if not (found and is_valid(compound(found)) and abs(sum(map(volume, found)) - wanted) <= EXACT * wanted):
            raise ExportError(
                f"the CAD kernel could not turn this profile by {revolve.degrees:g} degrees:"
                " a straight edge on the axis or a gap to it often works, arcs that end along the axis do not"
            )
    return found


def _makes_horn(loop: Loop) -> bool:
    """Whether an arc's circle touches or crosses the axis, and is not centred on it as a sphere's is."""
    b = np.array(loop.bulges)
    if not b.any():
        return False
    start = np.array(loop.points)
    step, middle = np.roll(start, -1, axis=0) - start, (np.roll(start, -1, axis=0) + start) / 2
    arcs = b != 0
    center = middle[arcs, 0] - (1 - b[arcs] ** 2) / (4 * b[arcs]) * step[arcs, 1]
    radius = np.hypot(*step[arcs].T) * (1 + b[arcs] ** 2) / (4 * np.abs(b[arcs]))
    return bool(np.any((np.abs(center) > CONFUSION) & (np.abs(center) <= radius * (1 + NEAR) + CONFUSION)))


def _quartered(loop: Loop) -> Loop:
    """The loop with its arcs in equal pieces of a quarter turn at most."""
    points: list[tuple[float, float]] = []
    bulges: list[float] = []
    for k, (start, bulge) in enumerate(zip(loop.points, loop.bulges, strict=True)):
        sweep = 4 * atan(bulge)
        pieces = max(1, ceil(abs(sweep) / (pi / 2) - 1e-9))
        between = points_along(loop.edges.take((slice(k, k + 1), None)), np.arange(1, pieces) / pieces).ravel()
        points += [start, *((z.real, z.imag) for z in between.tolist())]
        bulges += [bulge if pieces == 1 else tan(sweep / 4 / pieces)] * pieces
    return Loop(tuple(points), tuple(bulges))


def _divided(solid: Any) -> Any:
    divider = import_module("OCP.ShapeUpgrade").ShapeUpgrade_ShapeDivideAngle(pi, solid)
    divider.Perform()
    (half_turns,) = explored(divider.Result(), "SOLID")
    return half_turns
