"""RJMCMC for the Tree grammar: its context-free branching system, annealed towards a picture."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from math import inf

import numpy as np

from d4cad.baselines.rjmcmc import Annealing, BranchingSystem, Derivation, Moves, State, step
from d4cad.canvas import Canvas
from d4cad.descent import Record
from d4cad.grammars.tree import Structure, Tree
from d4cad.grammars.tree.structure import program_of, table_of
from d4cad.objectives.image import ImageLoss
from d4cad.program import Floats, Program

CHILDREN = (0.05, 0.83, 0.12)
"""Probabilities of no, one and two children: 60 nodes on average within DEPTH."""
DEPTH = 30
"""Longest way from the root, in branches: across the canvas and some more."""

SCHEDULE = Annealing(300.0, 3.0)
"""For 256x256 pixels."""
MOVES = Moves(focus=1.05)


def branching_system(program: Program[Structure]) -> BranchingSystem:
    """The system that derives what hangs on the root of trees with these limits: lengths, angles and, where leaves have
    sizes of their own, sizes."""
    limits = program.structure.limits
    ranges = [(0.0, limits.length), (-limits.angle, limits.angle)]
    if limits.sized:
        ranges.append((0.0, limits.size))
    low, high = zip(*ranges, strict=True)
    return BranchingSystem((CHILDREN,) * DEPTH, low, high)


def grown(derivation: Derivation, axiom: Program[Structure]) -> Program[Structure]:
    """The derivation on the axiom's root, in its limits and leaves."""
    first = table_of(axiom)[:1]
    sizes = derivation.numbers[:, 2:] if derivation.numbers.shape[1] > 2 else np.full((derivation.size, 1), first[0, 2])
    rows = np.concatenate([derivation.numbers[:, :2], sizes], axis=1)
    structure = replace(axiom.structure, parents=(-1, *(derivation.parents + 1).tolist()))
    return program_of(structure, np.concatenate([first, rows]))


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """What a run found: the best program, its mean squared error, and how that fell."""

    program: Program[Structure]
    loss: float
    history: tuple[Record, ...]


def anneal(
    target: Floats,
    canvas: Canvas,
    grammar: Tree,
    rng: np.random.Generator,
    *,
    steps: int | None = None,
    seconds: float = inf,
    annealing: Annealing = SCHEDULE,
    moves: Moves = MOVES,
    watch: Callable[[Record], None] | None = None,
) -> Found:
    """Anneal a tree towards a target (height, width), row 0 lowest, for so many steps or seconds.

    The energy is the summed squared error in pixels, and ``annealing`` counts in that. There is no price of a node:
    the system's own density is the prior, as in the paper (SPEC 8). The start and every improvement of the best are
    records.
    """
    axiom = grammar.axiom(canvas)
    loss = ImageLoss.of(target)
    system = branching_system(axiom)

    def energy(derivation: Derivation) -> float:
        return loss.value(grammar.rasterize(grown(derivation, axiom), canvas)) * canvas.size

    started = time.perf_counter()
    derivation = system.derive(0, rng)
    here = best = State(derivation, energy(derivation))
    history = [Record(0, best.energy / canvas.size, best.derivation.size + 1, 0, 0.0)]
    done, share = 0, 0.0
    while share < 1 and (steps is None or done < steps):
        here = step(here, system, energy, annealing.at(share), moves, rng)
        done += 1
        now = time.perf_counter() - started
        share = max(now / seconds, done / steps if steps else 0.0)
        if here.energy < best.energy:
            best = here
            history.append(Record(done, best.energy / canvas.size, best.derivation.size + 1, 1, now))
            if watch is not None:
                watch(history[-1])
    return Found(grown(best.derivation, axiom), best.energy / canvas.size, tuple(history))
