"""The width that a laser or a cutter burns away."""

from __future__ import annotations

from math import isfinite

from d4cad.errors import InputError
from d4cad.offsets import offset
from d4cad.sketch import Sketch


def require_kerf(kerf: float) -> float:
    """The kerf in mm. Raises InputError unless it is finite and not negative."""
    if not (isfinite(kerf) and kerf >= 0):
        raise InputError(f"the kerf must be 0 or a positive number in mm, got {kerf:g}")
    return float(kerf)


def compensated(sketch: Sketch, kerf: float | None) -> Sketch:
    """The path of a cutter's middle that leaves the sketch (mm) when it takes away ``kerf`` mm.

    Outer loops grow and holes shrink by half the kerf; arcs stay arcs. Holes narrower than the kerf are gone, parts
    closer than that are one: :func:`losses` tells. Raises InputError for a negative kerf or a sketch not in mm.
    """
    width = 0.0 if kerf is None else require_kerf(kerf)
    if width == 0:
        return sketch
    if sketch.unit != "mm":
        raise InputError(f"a kerf is in mm but this sketch is in {sketch.unit!r} units: scale it first")
    return offset(sketch, width / 2)


def losses(sketch: Sketch, kerf: float) -> tuple[str, ...]:
    """What :func:`compensated` loses of a sketch, a sentence each: holes that close, parts that grow together."""
    path = compensated(sketch, kerf)
    lost = []
    holes = [sum(len(face.holes) for face in s.faces) for s in (sketch, path)]
    if holes[1] < holes[0]:
        lost.append(f"a kerf of {kerf:g} mm closes {_count(holes[0] - holes[1], 'hole')}")
    if len(path.faces) < len(sketch.faces):
        lost.append(f"a kerf of {kerf:g} mm makes {len(sketch.faces)} parts {len(path.faces)}")
    return tuple(lost)


def _count(n: int, noun: str) -> str:
    return f"{n} {noun}{'' if n == 1 else 's'}"
