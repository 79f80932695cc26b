"""Union, difference and intersection of parts, exactly on lines and arcs."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from d4cad.arrangement import regions
from d4cad.cutting import Ints
from d4cad.edges import Bools
from d4cad.errors import GeometryError
from d4cad.sketch import Face, Sketch


def union(*sketches: Sketch) -> Sketch:
    """What lies in any of the sketches; an empty sketch for none.

    Edges that are not cut come back as they are. See :func:`d4cad.arrangement.regions` for tolerances and for parts
    that touch in a point. Raises GeometryError where the units differ.

    >>> from d4cad.sketch import Circle
    >>> disc = Sketch.from_loops([Circle((0, 0), 1).loop()], "mm")
    >>> round(union(disc, disc.translated(1, 0)).area, 6)
    5.054816
    """
    return _bounded(sketches, lambda winding: winding >= 1)


def difference(a: Sketch, b: Sketch) -> Sketch:
    """What lies in ``a`` and not in ``b``. Tolerances and errors as for :func:`union`."""
    outside = Sketch(tuple(Face(f.outer.reversed(), tuple(h.reversed() for h in f.holes)) for f in b.faces), b.unit)
    return _bounded((a, outside), lambda winding: winding >= 1)


def intersection(a: Sketch, b: Sketch) -> Sketch:
    """What lies in both. Tolerances and errors as for :func:`union`."""
    return _bounded((a, b), lambda winding: winding >= 2)


def symmetric_difference(a: Sketch, b: Sketch) -> Sketch:
    """What lies in exactly one of the two. Tolerances and errors as for :func:`union`."""
    return _bounded((a, b), lambda winding: winding == 1)


def _bounded(sketches: Sequence[Sketch], inside: Callable[[Ints], Bools]) -> Sketch:
    units = sorted({sketch.unit for sketch in sketches if sketch.faces})
    if len(units) > 1:
        raise GeometryError(f"sketches to combine must be in one unit, got {' and '.join(units)}")
    unit = units[0] if units else next((sketch.unit for sketch in sketches), "world")
    return Sketch.from_loops(regions([loop for sketch in sketches for loop in sketch.loops], inside), unit)
