"""The paper's own structural set-ups, run as published (SPEC 6): for comparison with its pictures."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from math import inf, isfinite
from typing import Any

import numpy as np

from d4cad.beams.connection import require_carried
from d4cad.beams.design import Beam, Watch
from d4cad.beams.outline import part_outline
from d4cad.beams.problem import Load, Place, Problem, Support
from d4cad.canvas import PAPER_RAMP, SPAN
from d4cad.descent import Method, Record, Stage, descend
from d4cad.errors import InputError
from d4cad.estimators import Frozen, Stepped
from d4cad.grammars.arc_line import sagitta_metric
from d4cad.objectives.paper_compliance import REACH, WEAK, Controller, PaperCompliance
from d4cad.program import Program
from d4cad.raster.band import Band
from d4cad.registry import make_grammar
from d4cad.sketch import Loop, Sketch
from d4cad.steppers import ClippedGradient

SIDE = 64
"""Elements along either side of the square domain."""
STEPS, PERIOD = 2000, 25
EXCESS = 10.0
RATE, PRICE, ARC_WEIGHT = 0.01, 1e-6, 2.0


@dataclass(frozen=True, slots=True)
class Setup:
    """volume: share of the domain at the start, of which half is asked for. top: margin of the first rectangle at top
    and bottom as a share of the domain. supports, load: in elements.
    """

    volume: float
    top: float
    supports: tuple[Support, ...]
    load: Place


def _at(x: float, y: float) -> Place:
    return Place((x, y), (x, y))


SETUPS = {
    "cantilever": Setup(49 / 128, 9 / 32, (Support(Place((4, 18), (4, 46))),), _at(60, 32)),
    # the published one can drift in x: one node more is held
    "mbb": Setup(49 / 384, 41 / 96, (Support(_at(4, 27), "y"), Support(_at(60, 27), "y"), Support(_at(32, 37), "x")),
                 _at(32, 37)),
    "mbb-half": Setup(49 / 192, 17 / 48, (Support(Place((4, 0), (4, 64)), "x"), Support(_at(60, 23), "y")), _at(4, 41)),
}  # fmt: skip


def _merit(loss: PaperCompliance, band: Band, volume: float) -> float:
    """Compliance, the more for a volume larger than the one asked for: losses at different multipliers do not tell
    which program is best, and the last one, which the paper returns, may have come apart.
    """
    filled = loss.occupancy(band.coverage)
    excess = max(float(filled.mean()) / volume - 1, 0.0)
    return float(loss.elastic.solve(WEAK + (1 - WEAK) * filled**2).compliance * (1 + EXCESS * excess * excess))


def _carries(problem: Problem, outline: Sketch) -> bool:
    """Whether each load is held through the part."""
    try:
        require_carried(problem, outline)
    except InputError:
        return False
    return True


def paper_beam(
    name: str, *, seed: int = 0, steps: int = STEPS, max_time: float | None = None, watch: Watch | None = None
) -> Beam:
    """A beam of the paper on 64 x 64 elements of 1 mm, total load 1 N: clipped gradient, 64 sampled rewrites a round.

    max_time: seconds. Raises InputError for a name that the paper has no set-up of.
    """
    if name not in SETUPS:
        raise InputError(f"the paper has the beams {', '.join(SETUPS)}, got {name!r}")
    if seed < 0:
        raise InputError(f"the seed must be 0 or more, got {seed}")
    if max_time is not None and not (isfinite(max_time) and max_time > 0):
        raise InputError(f"the time limit must be a positive number of seconds, got {max_time:g}")
    setup = SETUPS[name]
    problem = Problem(name, (SIDE, SIDE), 1.0, setup.volume / 2, setup.supports, (Load(setup.load, (0.0, -1.0)),))
    domain = replace(problem.domain(), mirrored=(False, False), margin=0)
    canvas = domain.canvas.with_ramp(REACH)
    loss = PaperCompliance(domain.elastic, Controller(setup.volume), PAPER_RAMP)
    grammar: Any = replace(make_grammar("arc-line", "paper", canvas), arc_weight=ARC_WEIGHT)  # type: ignore[type-var]
    stepper = ClippedGradient(rate=RATE, least=RATE, metric=sagitta_metric)
    method = Method(
        (Stage(REACH, PRICE, steps // PERIOD, patience=steps),), (10, 10, 5), stepper, Frozen(Stepped(stepper, 1)), 64,
        (("add-loop", 0.25),), recheck=False,
    )  # fmt: skip
    x, y = SPAN * (0.5 - 1 / 16), SPAN * (0.5 - setup.top)
    first = grammar.drawn([Loop.polyline([(-x, -y), (x, -y), (x, y), (-x, y)])])
    history: list[Record] = []
    kept, least = first, inf

    def note(record: Record, program: Program[Any]) -> None:
        nonlocal kept, least
        history.append(record)
        merit = _merit(loss, grammar.rasterize(program, canvas), setup.volume / 2)
        if merit <= least and _carries(problem, part_outline(problem, domain, grammar.outline(program))):
            kept, least = program, merit
        if watch is not None:
            watch(record)

    cpu = time.process_time()
    found = descend(
        first, grammar, loss, canvas, method, np.random.default_rng(seed), note, inf if max_time is None else max_time
    )
    program = grammar.repair(kept).program
    density = loss.occupancy(grammar.rasterize(program, canvas).coverage)
    return Beam(
        problem=problem,
        domain=domain,
        program=program,
        canvas=canvas,
        grammar=grammar,
        outline=part_outline(problem, domain, grammar.outline(program)),
        compliance=domain.elastic.solve(WEAK + (1 - WEAK) * density**2).compliance,
        history=tuple(history),
        stop=found.stop,
        seconds=time.process_time() - cpu,
    )
