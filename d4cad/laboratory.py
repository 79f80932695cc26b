"""Experiments with random programs of any grammar, which is seen through its rasters alone."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from d4cad.canvas import Canvas
from d4cad.errors import GeometryError, GrammarError
from d4cad.grammars.arc_line import ArcLine
from d4cad.objectives.image import ImageLoss
from d4cad.program import Edit, Floats, Program, Rewrite
from d4cad.protocols import Bonded, Grammar, RuleFacts, Stepper
from d4cad.shapes import generate

STEPS = 12
"""Gradient steps by which what comes near is fitted."""
FINALISTS = 3
"""So many of the rewrites that lead back nearest are fitted."""
TRIES = 2
"""Rewrites of each kind that are tried at each program."""
SHAKEN = 6.0
"""Standard deviation in pixels of how far each parameter by itself then moves the boundary at most."""
WANDER = 1.0
"""The same for random programs on their way."""
FARTHEST = 0.3
"""The most that a parameter is moved, in world units, radians or as a number, however little it moves the boundary."""
NUDGE = 1e-6
"""The step of the differences by which a parameter's influence is seen."""
SEEN = 0.01
"""Share of a parameter's greatest influence below which it is said to have none on a pixel."""
ROUNDS = (3, 9)
"""Least and greatest number of rounds of up to three rewrites that make a random program."""
CROWD = 60
"""Primitives past which a random program grows no more."""
EMPTY = 0.01
"""Share of the canvas that a random program covers at least."""
SAME = 1e-9
"""Summed squared change of coverage (px2) below which a shape is the same: rounding of thousands of pixels is less."""


@dataclass(frozen=True, slots=True)
class Shot:
    """One rewrite of one program, the fields as in a RuleReport; back, mended: px2 at once and when fitted."""

    rule: str
    jump: float
    refitted: float
    back: float
    mended: float
    inverse: str | None
    reach: float
    span: float


@dataclass(frozen=True, slots=True)
class Laboratory:
    """A grammar on a canvas, and the generator from which all that is random comes."""

    grammar: Grammar[Any]
    canvas: Canvas
    stepper: Stepper[Any]
    rng: np.random.Generator
    facts: Mapping[str, RuleFacts]

    def coverage(self, program: Program[Any]) -> Floats:
        """Coverage (height, width)."""
        return self.grammar.rasterize(program, self.canvas).coverage

    def border(self, program: Program[Any]) -> Any:
        """The pixels (height, width) that the boundary touches."""
        coverage = self.coverage(program)
        return (coverage > 0) & (coverage < 1)

    def influence(self, program: Program[Any], which: Any) -> Floats:
        """By how much some parameters (k,) move the coverage, (k, height, width), each by one unit."""
        base = self.coverage(program)
        found = np.zeros((len(which), *base.shape))
        for k, i in enumerate(which):
            params = program.params.copy()
            params[i] += NUDGE
            found[k] = (self.coverage(program.moved(params)) - base) / NUDGE
        return found

    def moved(self, program: Program[Any], influence: Floats, pixels: float) -> Program[Any]:
        """The program with all parameters moved, each so that by itself it moves the boundary by normally distributed
        pixels at most."""
        strongest = np.abs(influence).max(axis=(1, 2), initial=0.0) * 2 * self.canvas.ramp
        step = np.minimum(pixels / np.maximum(strongest, 1e-9), FARTHEST) * (strongest > 0)
        return program.moved(program.params + step * self.rng.standard_normal(step.size))

    def random_program(self) -> tuple[Program[Any], Floats]:
        """A program that random rewrites, most of which let it grow, made of the axiom, and the picture (height, width)
        of a random part at which it was asked for them."""
        grammar, rng = self.grammar, self.rng
        target = ArcLine(self.canvas.pixel)
        picture = target.rasterize(target.drawn(generate(rng, 12).loops), self.canvas).coverage
        program = grammar.repair(grammar.axiom(self.canvas)).program
        for _ in range(int(rng.integers(*ROUNDS, endpoint=True))):
            if grammar.primitives(program) > CROWD:
                break
            chosen, taken = list[Rewrite](), set[int]()
            offered = grammar.rewrites(program, picture - self.coverage(program), self.canvas, rng)
            for _ in range(3):
                free = [r for r in offered if taken.isdisjoint(r.sites) and all(r is not other for other in chosen)]
                growing = [r for r in free if grammar.growth(program, r) > 0]
                free = growing if growing and rng.random() < 0.7 else free
                if free:
                    rule = rng.choice(sorted({r.rule for r in free}))
                    chosen.append(_any([r for r in free if r.rule == rule], rng))
                    taken |= chosen[-1].sites
            there = grammar.apply(program, chosen).program
            there = self.tight(there)
            there = self.moved(there, self.influence(there, np.arange(there.params.size)), WANDER)
            there = grammar.repair(self.tight(there)).program
            if self.coverage(there).mean() > EMPTY and self.border(there).any() and self.drawable(there):
                program = there
        return program, picture

    def shots(self, program: Program[Any], target: Floats) -> Iterator[Shot]:
        """Some rewrites of every kind that is offered, one by one."""
        here = self.coverage(program)
        offered = self.grammar.rewrites(program, target - here, self.canvas, self.rng)
        for rule in sorted({rewrite.rule for rewrite in offered}):
            pool = [rewrite for rewrite in offered if rewrite.rule == rule]
            for k in self.rng.permutation(len(pool))[:TRIES].tolist():
                edit = self.grammar.apply(program, [pool[k]])
                if edit.program is not program:
                    yield self._shot(pool[k], program, here, edit)

    def tight(self, program: Program[Any]) -> Program[Any]:
        """The program with its bonds, if its grammar knows bonds, made exact: as every search has it."""
        return self.grammar.tightened(program) if isinstance(self.grammar, Bonded) else program

    def _shot(self, rewrite: Rewrite, program: Program[Any], here: Floats, edit: Edit[Any]) -> Shot:
        after = self.tight(edit.program)
        there = self.coverage(after)
        fresh = self.influence(after, np.flatnonzero(edit.origin < 0))
        seen = np.abs(fresh) > SEEN * np.abs(fresh).max(axis=(1, 2), keepdims=True, initial=0.0)
        touched = (np.abs(there - here) > 1e-6) | seen.any(axis=0)
        every = self.border(program) | self.border(after) | touched
        back, mended, inverse = self._return(rewrite.rule, program, here, after)
        return Shot(
            rule=rewrite.rule,
            jump=float(((there - here) ** 2).sum()),
            refitted=self._fitted(after, ImageLoss.of(here)),
            back=back,
            mended=mended,
            inverse=inverse,
            reach=float(touched.sum() / max(every.sum(), 1)),
            span=span(touched, every),
        )

    def _return(
        self, rule: str, program: Program[Any], here: Floats, there: Program[Any]
    ) -> tuple[float, float, str | None]:
        """How near (px2) one rewrite leads back to a program of the same complexity and shape, at once and when fitted,
        and which kind of rewrite comes nearest."""
        grammar = self.grammar
        wanted = grammar.complexity(program), grammar.primitives(program), program.params.size
        said = self.facts[rule].inverse or "" if rule in self.facts else ""
        growth = grammar.complexity(there) - wanted[0]
        found: list[tuple[float, str, Program[Any]]] = []
        for rewrite in grammar.rewrites(there, here - self.coverage(there), self.canvas, self.rng):
            if grammar.growth(there, rewrite) * growth > 0:
                continue
            again = self.tight(grammar.apply(there, [rewrite]).program)
            if np.allclose((grammar.complexity(again), grammar.primitives(again), again.params.size), wanted):
                off = float(((self.coverage(again) - here) ** 2).sum())
                found.append((off if off >= SAME else 0.0, rewrite.rule, again))
        if not found:
            return np.inf, np.inf, None
        found.sort(key=lambda item: (item[0], item[1] not in said.split(", ")))
        back = found[0][0]
        if back == 0:
            return back, back, found[0][1]
        fitted = [(self._fitted(again, ImageLoss.of(here)), rule) for _, rule, again in found[:FINALISTS]]
        mended, rule = min(fitted)
        return back, mended, rule

    def _fitted(self, program: Program[Any], loss: ImageLoss) -> float:
        """Summed squared error (px2) of a program after STEPS steps."""
        first = loss.value(self.grammar.rasterize(program, self.canvas)) * self.canvas.size
        state = self.stepper.init(program)
        for _ in range(STEPS):
            evaluation = loss.evaluate(self.grammar.rasterize(program, self.canvas))
            params, state = self.stepper.step(program, evaluation, state)
            program = program.moved(params)
            if self.stepper.settled(state):
                break
        value = loss.value(self.grammar.rasterize(program, self.canvas))
        params, _ = self.stepper.best(program.params, value, state)
        program = self.tight(program.moved(params))
        return min(first, loss.value(self.grammar.rasterize(program, self.canvas)) * self.canvas.size)

    def shake(self, program: Program[Any], influence: Floats) -> tuple[bool, bool, bool, float]:
        """A program out of order, repaired: whether it was violated, whether repair found nothing more to do, whether
        it bounds a region then, and by how much repair changed the shape (px2)."""
        wild = self.tight(self.moved(program, influence, SHAKEN))
        mended = self.grammar.repair(wild).program
        change = float(((self.coverage(mended) - self.coverage(wild)) ** 2).sum())
        settled = self.grammar.repair(mended).program is mended
        return mended is not wild, settled, self.drawable(mended), change

    def drawable(self, program: Program[Any]) -> bool:
        """Whether the program's outline bounds a region."""
        try:
            return self.grammar.outline(program).area > 0
        except (GeometryError, GrammarError):
            return False


def span(pixels: Any, every: Any) -> float:
    """Root mean square distance of some pixels (height, width) from their centre, against that of ``every``."""
    part, whole = (np.argwhere(mask).astype(float) for mask in (pixels, every))
    if len(part) < 2 or len(whole) < 2:
        return 0.0
    return float(np.sqrt(part.var(axis=0).sum() / max(whole.var(axis=0).sum(), 1e-12)))


def _any(rewrites: Sequence[Rewrite], rng: np.random.Generator) -> Rewrite:
    return rewrites[int(rng.integers(len(rewrites)))]
