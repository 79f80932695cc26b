"""Drawings of few lines and arcs in place of many: every loop segmented anew, none crossing another."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from d4cad.deviation import deviation
from d4cad.errors import GeometryError
from d4cad.joining import joined
from d4cad.loop import Loop
from d4cad.segmentation import segment
from d4cad.sketch import Face, Sketch, meetings_of

TRACE = 1 / 50
"""Share of the tolerance by which the points that stand for an arc may leave it between them."""


def simplified(sketch: Sketch, tolerance: float) -> Sketch:
    """The sketch with as few lines and arcs as stay within ``tolerance``, a length in its unit, and the reverse.

    Unlike :meth:`Sketch.simplified`, which only joins edges, this moves vertices. No loop gets more edges than it had;
    one that fewer edges do not help stays as it is; where simpler loops would touch each other, those keep their
    vertices. Raises GeometryError for a tolerance that is not positive.
    """
    loops = simplified_loops(sketch.loops, tolerance)
    rest = iter(loops)
    faces = tuple(Face(next(rest), tuple(next(rest) for _ in face.holes)) for face in sketch.faces)
    return Sketch(faces, sketch.unit)


def simplified_loops(loops: Sequence[Loop], tolerance: float) -> tuple[Loop, ...]:
    """Disjoint simple loops, each as :func:`simplified` has it, in the same order and orientation."""
    given = tuple(loops)
    found = [simplified_loop(loop, tolerance) for loop in given]
    for share in (1 / 4, 1 / 16):
        for k in _meeting(found):
            found[k] = simplified_loop(given[k], share * tolerance)
    while meeting := _meeting(found):
        changed = [k for k in meeting if found[k] is not given[k]]
        if not changed:
            break
        for k in changed:
            found[k] = given[k]
    return tuple(found)


def _meeting(loops: Sequence[Loop]) -> list[int]:
    if not loops:
        return []
    return sorted({k for meeting in meetings_of(loops) for k in (meeting.first, meeting.second)})


def simplified_loop(loop: Loop, tolerance: float) -> Loop:
    """One loop of as few edges as stay within ``tolerance`` of it, by joining neighbours or by segmentation.

    It runs the way the loop does. Raises GeometryError for a tolerance that is not positive.
    """
    if not (tolerance > 0 and np.isfinite(tolerance)):
        raise GeometryError(f"the tolerance of a simplification must be positive, got {tolerance}")
    best = loop
    for candidate in (joined(loop, tolerance), segment(loop.polygon(TRACE * tolerance), tolerance)):
        fewer = len(candidate.points) < len(best.points)
        if fewer and _is_alike(candidate, loop) and deviation(candidate, loop) <= tolerance:
            best = candidate
    return best


def _is_alike(candidate: Loop, loop: Loop) -> bool:
    """Whether a candidate runs the same way around and does not cross itself."""
    return candidate.area * loop.area > 0 and not meetings_of([candidate])
