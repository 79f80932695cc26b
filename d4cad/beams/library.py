"""The benchmark problems that come with d4cad, by name; loads and supports on patches, so that refinement converges."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from d4cad.beams.problem import Load, Place, Problem, Support
from d4cad.beams.reading import read_problem
from d4cad.errors import InputError


def _edge(x0: float, y0: float, x1: float, y1: float) -> Place:
    return Place((x0, y0), (x1, y1))


DOWN = (0.0, -1000.0)

CANTILEVER = Problem(
    "cantilever", (120, 60), 1.0, 0.5,
    supports=(Support(_edge(0, 0, 0, 60)),),
    loads=(Load(_edge(120, 28, 120, 32), DOWN),),
)  # fmt: skip
MBB = Problem(
    "mbb", (360, 60), 1.0, 0.5,
    supports=(
        Support(_edge(0, 0, 2, 0), "y"),
        Support(_edge(358, 0, 360, 0), "y"),
        Support(_edge(180, 60, 180, 60), "x"),
    ),
    loads=(Load(_edge(178, 60, 182, 60), DOWN),),
)  # fmt: skip
MBB_HALF = Problem(
    "mbb-half", (180, 60), 1.0, 0.5,
    supports=(Support(_edge(0, 0, 0, 60), "x"), Support(_edge(178, 0, 180, 0), "y")),
    loads=(Load(_edge(0, 60, 2, 60), DOWN),),
)  # fmt: skip
L_BRACKET = Problem(
    "l-bracket", (100, 100), 1.0, 0.4,
    supports=(Support(_edge(0, 100, 40, 100)),),
    loads=(Load(_edge(100, 36, 100, 40), DOWN),),
    cuts=(Place((40, 40), (100, 100), box=True),),
)  # fmt: skip
BRIDGE = Problem(
    "bridge", (120, 60), 1.0, 0.3,
    supports=(Support(_edge(0, 0, 2, 0)), Support(_edge(118, 0, 120, 0))),
    loads=(Load(_edge(58, 0, 62, 0), DOWN),),
)  # fmt: skip

PROBLEMS = {problem.name: problem for problem in (CANTILEVER, MBB, MBB_HALF, L_BRACKET, BRIDGE)}


def find_problem(name: str, volume: float | None = None) -> Problem:
    """The problem of that name, or in the TOML file of that name. Raises InputError if there is neither."""
    if name in PROBLEMS:
        problem = PROBLEMS[name]
        return problem if volume is None else replace(problem, volume=volume)
    if not name.lower().endswith(".toml") and not Path(name).exists():
        raise InputError(f"there is no problem {name!r}: expected one of {', '.join(PROBLEMS)}, or a .toml file")
    return read_problem(name, volume)
