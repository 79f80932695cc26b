"""Limits of fabrication, and the processes that have some by default."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from math import isfinite
from typing import Any

from d4cad.errors import InputError


@dataclass(frozen=True, slots=True)
class Limits:
    """What a part must keep, in mm; None where there is no limit, and no check then.

    ``thickness``: of the plate. ``min_wall``, ``min_gap``: least width of material, and of the space between.
    ``min_feature``: least length of an edge and diameter of a hole. ``tool_diameter``: of the cutter that must reach
    inside corners. ``kerf``: width of the beam's cut. ``bed``: width and height of the machine's table. ``bodies``:
    number of separate parts. Raises InputError for a number that is not positive and finite (the kerf may be 0).
    """

    thickness: float = 3.0
    min_wall: float | None = None
    min_gap: float | None = None
    min_feature: float | None = None
    tool_diameter: float | None = None
    kerf: float | None = None
    bed: tuple[float, float] | None = None
    bodies: int | None = None

    def __post_init__(self) -> None:
        for f in fields(self):
            value = getattr(self, f.name)
            for x in value if isinstance(value, tuple) else () if value is None else (value,):
                if not (isfinite(x) and (x > 0 or (f.name == "kerf" and x == 0))):
                    raise InputError(f"the limit {f.name.replace('_', ' ')} must be a positive number, got {x:g}")

    def given(self, **limits: Any) -> Limits:
        """These limits with those that are not None in place of its own. Raises InputError as the class does."""
        return replace(self, **{name: value for name, value in limits.items() if value is not None})


@dataclass(frozen=True, slots=True)
class Process:
    """A way to make parts: the names of the ``checks`` that matter, in the order of the report, and usual limits."""

    checks: tuple[str, ...]
    limits: Limits


PROCESSES = {
    "laser": Process(
        ("self-intersection", "minimum wall", "minimum gap", "kerf", "smallest feature", "bodies", "bed"),
        Limits(min_wall=1.0, min_gap=0.2, kerf=0.15, min_feature=0.2),
    ),
    "cnc": Process(
        ("self-intersection", "minimum wall", "minimum gap", "inside corners", "smallest feature", "bodies", "bed"),
        Limits(min_wall=1.0, tool_diameter=3.0, min_feature=0.5),
    ),
    "fdm": Process(
        ("self-intersection", "watertight", "minimum wall", "minimum gap", "smallest feature", "bodies", "bed"),
        Limits(min_wall=0.8, min_gap=0.3, min_feature=0.4, bed=(220.0, 220.0), bodies=1),
    ),
}
"""Checks and limits of common processes: a desktop laser, a router with a 3 mm end mill, a printer with a 0.4 mm nozzle
whose walls are two lines wide. Beds differ from machine to machine: only the commonest printer's is assumed."""


def process(name: str) -> Process:
    """The process of that name; raises InputError with those there are."""
    if name not in PROCESSES:
        raise InputError(f"the process must be one of {', '.join(PROCESSES)}, got {name!r}")
    return PROCESSES[name]
