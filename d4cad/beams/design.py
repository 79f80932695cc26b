"""From a structural problem to a part: density, contour, Stochastic Rewrite Descent, fewer primitives at a price."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from math import inf, isfinite
from typing import Any

import numpy as np

from d4cad.beams.connection import require_supported
from d4cad.beams.density import Schedule, optimised_density
from d4cad.beams.outline import part_outline
from d4cad.beams.problem import Problem
from d4cad.beams.start import GRAMMARS, beam_grammar, density_program, whole_domain
from d4cad.canvas import Canvas
from d4cad.descent import Descent, Method, Record, Stage, Stop, descend
from d4cad.errors import GeometryError, InputError
from d4cad.estimators import Funnel
from d4cad.objectives.compliance import ComplianceLoss
from d4cad.objectives.domain import Domain
from d4cad.program import Program
from d4cad.protocols import Grammar
from d4cad.raster.band import Band
from d4cad.sketch import Sketch
from d4cad.steppers import NullSpace

PRICE = 3e-4
"""Share of the compliance that one primitive must save."""

RHYTHM = (20, 15)
ROUNDS = 40

WARM_UP, WARM_ROUNDS = 12, 3
"""From the whole domain the volume shrinks to the problem's in so many steps, each of at most so many rounds."""

RADII = (2.4, 4.0, 6.0)
"""Filter radii in elements of the densities to start from for few primitives: a wider one has fewer bars."""

APART = 10.0
"""A start whose loss is so many times that of a design has come apart: its filter was too wide for the grid."""

RESTORATIONS, EXACT = 8, 2e-4
"""At most so many steps restore the volume of a finished outline, until it is right by this share of it."""

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
    grammar: str = "arc-line",
    init: str = "density",
    simplify: float | None = None,
    fillet: float | None = None,
    seed: int = 0,
    max_time: float | None = None,
    watch: Watch | None = None,
) -> Beam:
    """The stiffest part that a descent finds.

    grammar: "arc-line" or "union-rect". init: "density", the contour of an optimised density, or "axiom", the whole
    domain. simplify: share of the compliance that may be given up for fewer primitives. fillet: radius in mm of inside
    corners. max_time: seconds. watch: called with a Record a round. Raises InputError for a problem that has no answer.
    Ctrl-C ends the search with the best part so far.
    """
    _check(grammar, init, simplify, fillet, seed, max_time)
    require_supported(problem)
    cpu = time.process_time()
    search = _Search.of(problem, grammar, seed, max_time, watch)
    found = search.best(init, simplify)
    program = search.restored(found.program, fillet)
    density = search.loss.density(search.raster(program))
    try:
        outline = search.outline(program, fillet)
    except GeometryError:
        raise InputError(
            f"no part of a volume of {problem.volume:g} was found: its members would be thinner than an element of "
            f"{problem.element:g} mm"
        ) from None
    return Beam(
        problem=problem,
        domain=search.domain,
        program=program,
        canvas=search.domain.canvas,
        grammar=search.grammar,
        outline=outline,
        compliance=search.loss.response(density).compliance,
        history=tuple(search.history),
        stop=Stop.INTERRUPTED if search.interrupted else found.stop,
        seconds=time.process_time() - cpu,
    )


def _check(
    grammar: str, init: str, simplify: float | None, fillet: float | None, seed: int, max_time: float | None
) -> None:
    if grammar not in GRAMMARS:
        raise InputError(f"beams are designed in one of {', '.join(GRAMMARS)}, got {grammar!r}")
    if init not in ("density", "axiom"):
        raise InputError(f"a beam starts from density or axiom, got {init!r}")
    if simplify is not None and not 0 <= simplify < 1:
        raise InputError(f"the compliance given up must be a share from 0 to 1, got {simplify:g}")
    if seed < 0:
        raise InputError(f"the seed must be 0 or more, got {seed}")
    for name, value, unit in (("radius of fillets", fillet, "mm"), ("time limit", max_time, "seconds")):
        if value is not None and not (isfinite(value) and value > 0):
            raise InputError(f"the {name} must be a positive number of {unit}, got {value:g}")


@dataclass(frozen=True, eq=False)
class _Search:
    """The working parts of :func:`design_beam`. history: of all descents, one after another. stops: why each ended."""

    problem: Problem
    domain: Domain
    loss: ComplianceLoss
    grammar: Any
    rng: np.random.Generator
    deadline: float
    watch: Watch | None
    history: list[Record]
    stops: list[Stop]

    @classmethod
    def of(cls, problem: Problem, grammar: str, seed: int, max_time: float | None, watch: Watch | None) -> _Search:
        domain = problem.domain()
        halves = problem.divides(0.5) and all(side % 2 == 0 for side in domain.drawn)
        loss = ComplianceLoss.of(domain, problem.domain(0.5) if halves else None)
        deadline = inf if max_time is None else time.perf_counter() + max_time
        language = beam_grammar(grammar, domain)
        return cls(problem, domain, loss, language, np.random.default_rng(seed), deadline, watch, [], [])

    def with_volume(self, volume: float) -> _Search:
        """The same with another volume, in elements."""
        return replace(self, loss=self.loss.with_volume(volume))

    def best(self, init: str, simplify: float | None) -> Descent[Any]:
        """The stiffest part, or the one of fewest primitives that is within a share of it."""
        if init == "axiom":
            found = [self.warmed(whole_domain(self.grammar, self.domain))]
        else:
            found = [self.improved(self.density_start(RADII[0]), PRICE)]
        if simplify is None:
            return found[0]
        allowed = found[0].loss * (1 + simplify)
        try:
            for radius in RADII[1:] if init == "density" else ():
                if self.has_time:
                    start = self.density_start(radius)
                    if self.loss.value(self.raster(start)) < APART * found[0].loss:
                        found.append(self.improved(start, PRICE))
        except KeyboardInterrupt:  # in a density: what was found before is kept
            self.stops.append(Stop.INTERRUPTED)
        simple = [self.simplified(descent, allowed) for descent in found if descent.loss <= allowed]
        return min(simple, key=lambda descent: (self.grammar.complexity(descent.program), descent.loss))

    @property
    def interrupted(self) -> bool:
        """Whether Ctrl-C ended a descent: all that follow it end at once."""
        return Stop.INTERRUPTED in self.stops

    @property
    def has_time(self) -> bool:
        """Whether there is time left for another start."""
        return not self.interrupted and time.perf_counter() < self.deadline

    def raster(self, program: Program[Any]) -> Band:
        """The program on the domain's canvas."""
        band: Band = self.grammar.rasterize(program, self.domain.canvas)
        return band

    def density_start(self, radius: float) -> Program[Any]:
        """The contour of a density with that filter radius, in elements."""
        density = optimised_density(self.domain, Schedule(radius=radius))
        program: Program[Any] = self.grammar.repair(density_program(self.grammar, self.domain, density)).program
        return program

    def warmed(self, program: Program[Any]) -> Descent[Any]:
        """The descent from a program of the whole domain, its volume shrinking step by step."""
        free = float(self.domain.free.sum())
        for share in np.geomspace(1, self.domain.volume / free, WARM_UP + 1)[1:-1]:
            program = self.with_volume(float(share) * free).improved(program, PRICE, WARM_ROUNDS).program
        return self.improved(program, PRICE)

    def simplified(self, found: Descent[Any], allowed: float) -> Descent[Any]:
        """Fewer primitives at a loss of at most ``allowed``: the price of one doubles as long as it is kept."""
        best, price = found, 2 * PRICE
        while price < 0.1 and best.stop not in (Stop.INTERRUPTED, Stop.TIME):
            there = self.improved(best.program, price)
            if there.loss > allowed:
                break
            best, price = there, 2 * price
        return best

    def outline(self, program: Program[Any], fillet: float | None = None) -> Sketch:
        """The part in mm that a program is."""
        return part_outline(self.problem, self.domain, self.grammar.outline(program), fillet)

    def restored(self, program: Program[Any], fillet: float | None) -> Program[Any]:
        """The program with its whole boundary moved until the finished outline has the problem's volume.

        At an optimum material is worth the same all along the boundary: it does not matter where it goes.
        """
        volume, nearest, least = self.domain.volume, program, inf
        for _ in range(RESTORATIONS):
            try:
                excess = self.outline(program, fillet).area / self.problem.element**2 - volume
            except GeometryError:  # moved until a thin part of it is gone
                break
            if abs(excess) < least:
                nearest, least = program, abs(excess)
            if least <= EXACT * volume:
                break
            here = self.loss.evaluate(self.raster(program))
            assert here.constraint is not None
            here = replace(here, constraint=replace(here.constraint, residual=excess))
            moved = program.moved(program.params + NullSpace().restoring(here))
            program = self.grammar.repair(moved).program
        return nearest

    def improved(self, program: Program[Any], price: float, rounds: int = ROUNDS) -> Descent[Any]:
        """A descent at a price of a primitive, a share of the loss at ``program``."""
        canvas, stepper = self.domain.canvas, NullSpace()
        value = self.loss.value(self.grammar.rasterize(program, canvas))
        method = Method((Stage(canvas.ramp, price * value, rounds),), RHYTHM, stepper, Funnel(stepper))
        before = self.history[-1] if self.history else None

        def note(record: Record, _: Program[Any]) -> None:
            self.history.append(_after(before, record))
            if self.watch is not None:
                self.watch(self.history[-1])

        left = max(self.deadline - time.perf_counter(), 0.0) if self.has_time else 0.0
        found = descend(program, self.grammar, self.loss, canvas, method, self.rng, note, left)
        self.stops.append(found.stop)
        return found


def _after(before: Record | None, record: Record) -> Record:
    """A record with the steps and seconds of what came before."""
    if before is None:
        return record
    return replace(record, step=before.step + record.step, seconds=before.seconds + record.seconds)
