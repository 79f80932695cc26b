"""All checks by name, and the report of those that were asked for."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from d4cad.errors import InputError
from d4cad.exporters.checks import machine, outline
from d4cad.exporters.checks.limits import Limits
from d4cad.exporters.checks.report import Finding, Report, Status, not_checked
from d4cad.exporters.occ import require_mm
from d4cad.loop import Loop
from d4cad.sketch import Sketch

Check = Callable[[Sketch, Limits, Sequence[Sketch]], Finding]

CHECKS: dict[str, Check] = {
    "self-intersection": lambda sketch, limits, others: outline.self_intersection(sketch.loops),
    "watertight": lambda sketch, limits, others: machine.watertight(sketch, limits),
    "minimum wall": lambda sketch, limits, others: outline.minimum_wall(sketch, limits),
    "minimum gap": lambda sketch, limits, others: outline.minimum_gap(sketch, limits),
    "inside corners": lambda sketch, limits, others: outline.inside_corners(sketch, limits),
    "kerf": lambda sketch, limits, others: outline.kerf(sketch, limits),
    "smallest feature": lambda sketch, limits, others: outline.smallest_feature(sketch, limits),
    "bodies": lambda sketch, limits, others: outline.bodies(sketch, limits),
    "bed": lambda sketch, limits, others: machine.bed(sketch, limits),
    "interference": lambda sketch, limits, others: machine.interference(sketch, others, limits),
    "clearance": lambda sketch, limits, others: machine.clearance(sketch, others, limits),
}
"""Every check by its name, in the order in which they are reported."""


def check(
    sketch: Sketch, limits: Limits, checks: Sequence[str] = tuple(CHECKS), others: Sequence[Sketch] = ()
) -> Report:
    """The findings of ``checks`` about a sketch in mm.

    ``others``: parts beside it, for interference and clearance. A check without a limit or whose engine is missing says
    "not checked". Raises InputError for a sketch that is not in mm or empty, or an unknown check.
    """
    require_mm(sketch)
    for other in others:
        require_mm(other)
    for name in checks:
        if name not in CHECKS:
            raise InputError(f"expected checks among {', '.join(CHECKS)}, got {name!r}")
    return Report(tuple(CHECKS[name](sketch, limits, others) for name in checks), sketch.loops)


def check_loops(
    loops: Sequence[Loop], limits: Limits, checks: Sequence[str] = tuple(CHECKS), others: Sequence[Sketch] = ()
) -> Report:
    """As :func:`check` for loops in mm as a file has them: where they cross, nothing else is checked.

    Raises GeometryError where a loop is degenerate.
    """
    crossing = outline.self_intersection(loops)
    if crossing.status is Status.FAILED:
        rest = [not_checked(name, "the loops cross") for name in checks if name != crossing.name]
        return Report((crossing, *rest), tuple(loops))
    return check(Sketch.from_loops(loops, "mm"), limits, checks, others)
