"""From the strokes of a drawing to the regions they bound."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import NamedTuple

import numpy as np

from d4cad.deviation import deviation
from d4cad.edges import Complexes, Floats
from d4cad.errors import GeometryError
from d4cad.importers.strokes import Stroke, chained
from d4cad.loop import Loop
from d4cad.sketch import Sketch, meetings_of

LARGEST = 1e8
"""mm; beyond, float64 no longer tells a micrometre."""


@dataclass(frozen=True, slots=True)
class Drawing:
    """What was read.

    sketch: the outlines in mm, y up, in the drawing's own place. segments: number of lines, arcs and pieces of other
    curves that the file draws them with. notes: a sentence each on what was assumed, mended or left out.
    """

    sketch: Sketch
    segments: int
    notes: tuple[str, ...] = ()


class Outlines(NamedTuple):
    """What one shape of a drawing bounds: ``loops``, each simple, none crossing another of the same shape."""

    loops: tuple[Loop, ...]


def assembled(
    shapes: Sequence[Outlines], strokes: Sequence[Stroke], gap: float, segments: int, notes: Sequence[str]
) -> Drawing:
    """A drawing of closed shapes and loose strokes.

    Strokes are chained to loops (:func:`d4cad.importers.strokes.chained`). A loop drawn twice within ``gap`` counts
    once. Shapes that overlap are united; then every second loop from outside in bounds a hole.
    """
    _refuse_far(shapes, strokes)
    loops, found = chained(strokes, gap)
    every = [*shapes, *(Outlines((loop,)) for loop in loops)]
    every, twice = _once(every, gap)
    if twice:
        found = (*found, f"{twice} outline{'s' if twice > 1 else ''} drawn twice counted once")
    if not any(shape.loops for shape in every):
        raise GeometryError("there is no closed outline in it")
    return Drawing(Sketch.from_loops(_united(every), "mm"), segments, (*notes, *found))


def _refuse_far(shapes: Sequence[Outlines], strokes: Sequence[Stroke]) -> None:
    parts = [np.array(loop.points) for shape in shapes for loop in shape.loops]
    parts += [np.stack([stroke.points.real, stroke.points.imag], axis=1) for stroke in strokes]
    for part in parts:
        if not np.isfinite(part).all():
            raise GeometryError("it has coordinates that are not finite numbers")
        far = float(np.abs(part).max())
        if far > LARGEST:
            raise GeometryError(f"it has coordinates of {far:g} mm, expected at most {LARGEST:g}")


def _once(shapes: Sequence[Outlines], gap: float) -> tuple[list[Outlines], int]:
    """The shapes without loops that repeat an earlier one within ``gap``, and how many were left out."""
    kept: list[tuple[Floats, Loop]] = []
    found, twice = [], 0
    for shape in shapes:
        new = []
        for loop in shape.loops:
            box = np.array(loop.bounds)
            if any(np.abs(box - b).max() <= gap and deviation(loop, other) <= gap for b, other in kept):
                twice += 1
            else:
                new.append(loop)
        kept += [(np.array(loop.bounds), loop) for loop in new]
        found.append(Outlines(tuple(new)))
    return [shape for shape in found if shape.loops], twice


def _united(shapes: Sequence[Outlines]) -> list[Loop]:
    """The loops of all shapes; those of shapes that cross each other replaced by the loops of their union."""
    loops = [loop for shape in shapes for loop in shape.loops]
    owner = np.repeat(np.arange(len(shapes)), [len(shape.loops) for shape in shapes])
    pairs = {(int(owner[m.first]), int(owner[m.second])) for m in meetings_of(loops)}
    group = list(range(len(shapes)))
    for a, b in pairs:
        if a != b:
            old, new = group[b], group[a]
            group = [new if g == old else g for g in group]
    found: list[Loop] = []
    for g in sorted(set(group)):
        members = [shapes[k] for k in range(len(shapes)) if group[k] == g]
        if len(members) == 1:
            found += members[0].loops
        else:
            found += _union([Sketch.from_loops(shape.loops, "mm") for shape in members]).loops
    return found


def _union(sketches: Sequence[Sketch]) -> Sketch:
    try:
        union = import_module("d4cad.booleans").union
    except ModuleNotFoundError:
        where = meetings_of([loop for sketch in sketches for loop in sketch.loops])[0].place
        raise GeometryError(f"two of its shapes overlap at ({where.real:g}, {where.imag:g})") from None
    united = union(*sketches)
    assert isinstance(united, Sketch)
    return united


def nonzero(loops: Sequence[Loop]) -> tuple[Loop, ...]:
    """The loops that bound the region of non-zero winding, SVG's default fill rule: those with the same on both
    sides go."""
    if not loops:
        return ()
    z = np.array([complex(*loop.points[0]) for loop in loops])
    around = np.array([_contains(loop, z) * np.sign(loop.area) for loop in loops])
    np.fill_diagonal(around, 0.0)
    outside = around.sum(axis=0)
    inside = outside + np.sign([loop.area for loop in loops])
    return tuple(loop for loop, a, b in zip(loops, outside, inside, strict=True) if (a != 0) != (b != 0))


def within_any(loop: Loop, others: Sequence[Loop]) -> bool:
    """Whether the first vertex of a loop lies inside another one."""
    z = np.array([complex(*loop.points[0])])
    return any(bool(_contains(other, z)[0]) for other in others if other is not loop)


def _contains(loop: Loop, z: Complexes) -> Floats:
    return loop.contains(np.stack([z.real, z.imag], axis=1)).astype(np.float64)
