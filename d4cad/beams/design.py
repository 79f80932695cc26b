"""From a structural problem to a part: density, contour, Stochastic Rewrite Descent, and fewer primitives at a price."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from math import inf
from typing import Any

import numpy as np

from d4cad.beams.density import optimised_density
from d4cad.beams.outline import part_outline
from d4cad.beams.problem import Problem
from d4cad.beams.start import density_sketch, whole_domain
from d4cad.canvas import Canvas
from d4cad.descent import Descent, Method, Record, Stage, Stop, descend
from d4cad.errors import InputError
from d4cad.estimators import Funnel
from d4cad.objectives.compliance import ComplianceLoss
from d4cad.objectives.domain import Domain
from d4cad.program import Program
from d4cad.protocols import Grammar
from d4cad.sketch import Sketch
from d4cad.steppers import NullSpace

PRICE = 3e-4
"""Share of the compliance that one primitive must save."""

RHYTHM = (20, 15)
ROUNDS = 40

WARM_UP, WARM_ROUNDS = 12, 3
"""From the whole domain the volume shrinks to the problem's in so many steps, each of at most so many rounds."""

Watch = Callable[[Record], None]


@dataclass(frozen=True, eq=False)
class Beam:
    """A designed part.

    problem: what it answers. domain: its grid. program, canvas, grammar: the program over the domain, or over its half
    if the problem is its own mirror image. outline: the part in mm. compliance: on the domain's grid by the objective's
    soft density, total load and stiffness 1. seconds: CPU.
    """

    problem: Problem
    domain: Domain
    program: Program[Any]
    canvas: Canvas
    grammar: Grammar[Any]
    outline: Sketch
    compliance: float
    history: tuple[Record, ...]
    stop: Stop
    seconds: float

    @property
    def primitives(self) -> int:
        """Number of lines and arcs of the outline, a full circle counting two."""
        return self.outline.primitives


def design_beam(
    problem: Problem,
    *,
    init: str = "density",
    simplify: float | None = None,
    seed: int = 0,
    max_time: float | None = None,
    watch: Watch | None = None,
) -> Beam:
    """The stiffest part of lines and arcs that a descent finds.

    init: "density", the contour of an optimised density, or "axiom", the whole domain. simplify: share of the
    compliance that may be given up for fewer primitives. max_time: seconds. watch: called with a Record a round.
    Raises InputError for a problem that has no answer. Ctrl-C ends the search with the best part so far.
    """
    if init not in ("density", "axiom"):
        raise InputError(f"a beam starts from density or axiom, got {init!r}")
    if simplify is not None and not 0 <= simplify < 1:
        raise InputError(f"the compliance given up must be a share from 0 to 1, got {simplify:g}")
    cpu, wall = time.process_time(), time.perf_counter()
    domain = problem.domain()
    loss = ComplianceLoss.of(domain, problem.domain(0.5) if problem.divides(0.5) and _halves(domain) else None)
    grammar = _grammar(domain)
    sketch = density_sketch(domain, optimised_density(domain)) if init == "density" else whole_domain(domain)
    program = grammar.repair(_bent(sketch)).program
    rng = np.random.default_rng(seed)

    def improved(program: Program[Any], price: float, loss: ComplianceLoss = loss, rounds: int = ROUNDS) -> Descent[Any]:
        left = inf if max_time is None else max(max_time - (time.perf_counter() - wall), 0.0)
        method = _method(price, rounds)
        return descend(program, grammar, loss, domain.canvas, method, rng, _forwarded(watch), left)

    def price(program: Program[Any]) -> float:
        return PRICE * loss.value(grammar.rasterize(program, domain.canvas))

    if init == "axiom":
        for share in np.geomspace(1, domain.volume / domain.free.sum(), WARM_UP + 1)[1:-1]:
            stage = loss.with_volume(float(share * domain.free.sum()))
            found = improved(program, price(program), stage, WARM_ROUNDS)
            program = found.program
    found = improved(program, price(program))
    if simplify is not None:
        found = _simplified(found, simplify, improved)
    band = grammar.rasterize(found.program, domain.canvas)
    return Beam(
        problem=problem,
        domain=domain,
        program=found.program,
        canvas=domain.canvas,
        grammar=grammar,
        outline=part_outline(problem, domain, grammar.outline(found.program)),
        compliance=loss.response(loss.density(band)).compliance,
        history=found.history,
        stop=found.stop,
        seconds=time.process_time() - cpu,
    )


def _simplified(
    found: Descent[Any], share: float, improved: Callable[[Program[Any], float], Descent[Any]]
) -> Descent[Any]:
    """The fewest primitives within a share of the compliance: the price of one doubles as long as it is kept."""
    allowed, price = found.loss * (1 + share), 2 * PRICE * found.loss
    best = found
    while price < share * found.loss * 4 and best.stop not in (Stop.INTERRUPTED, Stop.TIME):
        there = improved(best.program, price)
        if there.loss > allowed:
            break
        best = replace(there, history=best.history + there.history)
        price *= 2
    return best


def _method(price: float, rounds: int) -> Method:
    stepper = NullSpace()
    return Method((Stage(1.0, price, rounds),), RHYTHM, stepper, Funnel(stepper))


def _halves(domain: Domain) -> bool:
    """Whether elements of twice the size fill what a program draws."""
    return all(side % 2 == 0 for side in domain.drawn)


def _grammar(domain: Domain) -> Any:
    from d4cad.grammars.arc_line import ArcLine
    from d4cad.grammars.arc_line.places import DemandPlaces

    return ArcLine(domain.canvas.pixel, places=DemandPlaces(small=3.0, least=2.0, most=8))


def _bent(sketch: Sketch) -> Program[Any]:
    """The program of a sketch in which every edge is an arc, straight ones of bulge 0: so that all of them can bend."""
    from d4cad.grammars.arc_line.structure import Structure

    sizes = tuple(len(loop.points) for loop in sketch.loops)
    points = np.array([point for loop in sketch.loops for point in loop.points])
    bulges = np.array([bulge for loop in sketch.loops for bulge in loop.bulges])
    return Program(Structure(sizes, (True,) * len(bulges)), np.concatenate([points.ravel(), bulges]))


def _forwarded(watch: Watch | None) -> Callable[[Record, Program[Any]], None] | None:
    return None if watch is None else lambda record, _: watch(record)
