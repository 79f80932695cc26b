"""Speed of the raster: full evaluations, local trial steps, rounds of proposals, and the dense oracle beside them.

    python benchmarks/raster.py [--seconds 2] [--json FILE]

Each figure is the least of many short repeats on one core, because other work on the machine can only add to it. The
shape is a plate of 10 primitives; a round of proposals starts from its Levenberg-Marquardt fit to a plate that has a
notch and a second hole besides, so that proposals have something to gain.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from d4cad.canvas import Canvas
from d4cad.estimators import LocalFit
from d4cad.grammars.arc_line import ArcLine
from d4cad.grammars.arc_line.structure import Structure
from d4cad.objectives.image import ImageLoss
from d4cad.program import Floats, Program, Rewrite
from d4cad.steppers import LevenbergMarquardt

PROPOSALS = 64
STEPS = 4


class Figure(NamedTuple):
    """One line of the table: milliseconds, or a ratio. target: the most it may be, None if not set."""

    name: str
    value: float
    target: float | None


def plate(*details: list[tuple[float, float, float]]) -> Program[Structure]:
    """A rounded plate with a round hole, 10 primitives, and further loops; a bulge of 0 makes a line."""
    outer = [
        (-1.03, -0.71, 0.0), (0.97, -0.79, 0.42), (1.21, -0.48, 0.0), (1.13, 0.52, 0.4),
        (0.82, 0.83, 0.0), (-0.37, 0.87, -0.3), (-0.81, 0.79, 0.0), (-1.17, 0.31, 0.1),
    ]  # fmt: skip
    return program_of(outer, [(0.62, 0.05, -1.0), (0.08, 0.05, -1.0)], *details)


def program_of(*loops: list[tuple[float, float, float]]) -> Program[Structure]:
    """Loops of (x, y, bulge of the edge from there)."""
    edges = [edge for loop in loops for edge in loop]
    structure = Structure(tuple(map(len, loops)), tuple(b != 0 for _, _, b in edges))
    places = [number for x, y, _ in edges for number in (x, y)]
    return Program(structure, np.array([*places, *(b for _, _, b in edges if b != 0)]))


NOTCH = [(-1.3, -0.2, 0.0), (-1.3, -0.05, 0.0), (-0.9, -0.07, 0.5), (-0.9, -0.22, 0.0)]
HOLE = [(-0.2, 0.3, -1.0), (-0.5, 0.3, -1.0)]


def fitted(program: Program[Structure], loss: ImageLoss, canvas: Canvas, steps: int = 30) -> Program[Structure]:
    """The program after Levenberg-Marquardt steps."""
    stepper, grammar = LevenbergMarquardt(), ArcLine()
    state = stepper.init(program)
    for _ in range(steps):
        params, state = stepper.step(program, loss.evaluate(grammar.rasterize(program, canvas)), state)
        program = program.moved(params)
    params, _ = stepper.best(program.params, loss.value(grammar.rasterize(program, canvas)), state)
    return program.moved(params)


def least(work: Callable[[], Any], seconds: float) -> float:
    """Milliseconds that ``work`` takes at best in repeats for about ``seconds``."""
    work()
    best = float("inf")
    end = time.perf_counter() + seconds
    while time.perf_counter() < end:
        start = time.perf_counter()
        work()
        best = min(best, time.perf_counter() - start)
    return 1e3 * best


def evaluation(size: int, seconds: float) -> float:
    """Value, gradient and Gauss-Newton matrix of the plate on a canvas of size x size."""
    canvas, grammar, program = Canvas.square(size), ArcLine(), plate()
    loss = ImageLoss.of(grammar.rasterize(plate(NOTCH, HOLE), canvas).coverage)
    return least(lambda: loss.evaluate(grammar.rasterize(program, canvas)), seconds)


class Round(NamedTuple):
    """A converged program and what may be proposed on it."""

    program: Program[Structure]
    rewrites: list[Rewrite]
    loss: ImageLoss
    canvas: Canvas

    def estimate(self, rewrites: list[Rewrite], steps: int) -> Callable[[], Any]:
        grammar = ArcLine()
        return lambda: LocalFit(steps).estimate(self.program, rewrites, grammar, self.loss, self.canvas, 1e-8)


def converged() -> Round:
    canvas, grammar = Canvas.square(256), ArcLine()
    loss = ImageLoss.of(grammar.rasterize(plate(NOTCH, HOLE), canvas).coverage)
    program = fitted(plate(), loss, canvas)
    rng = np.random.default_rng(0)
    demand: Floats = loss.demand(grammar.rasterize(program, canvas))
    return Round(program, grammar.rewrites(program, demand, canvas, rng), loss, canvas)


def proposals(seconds: float) -> float:
    """A round of 64 proposals drawn from all rewrites, each fitted by 4 local steps."""
    base = converged()
    order = np.random.default_rng(1).permutation(len(base.rewrites))
    return least(base.estimate([base.rewrites[k] for k in np.resize(order, PROPOSALS)], STEPS), seconds)


def trial_step(seconds: float) -> float:
    """One local step, raster and normal equations in its window: splits of every edge with and without their steps.

    The picture is noisy and the base is off by half a pixel, so that every step finds something to do.
    """
    canvas, grammar, rng = Canvas.square(256), ArcLine(), np.random.default_rng(2)
    clean = grammar.rasterize(plate(), canvas).coverage
    loss = ImageLoss.of(clean + rng.normal(scale=0.05, size=clean.shape))
    program = plate()
    program = program.moved(program.params + rng.normal(scale=0.005, size=program.params.size))
    splits = [r for r in grammar.rewrites(program, np.zeros(canvas.shape), canvas, rng) if r.rule == "split"]
    base = Round(program, splits, loss, canvas)
    with_steps, without = (
        sum(least(base.estimate([split], steps), seconds / len(splits)) for split in splits) for steps in (STEPS, 0)
    )
    return (with_steps - without) / (len(splits) * STEPS)


def dense_oracle(seconds: float) -> float | None:
    """Value and gradient of the same plate by the dense torch oracle on one thread; None without torch."""
    try:
        import torch
    except ImportError:
        return None
    from d4cad.grammars.arc_line.structure import to_shape
    from d4cad.raster.oracle import coverage

    torch.set_num_threads(1)
    canvas, grammar = Canvas.square(256), ArcLine()
    target = torch.tensor(grammar.rasterize(plate(NOTCH, HOLE), canvas).coverage)
    shape = to_shape(plate(), 1 / canvas.pixel, 128.0, 128.0)
    leaves = [torch.tensor(part, requires_grad=True) for part in (shape.x, shape.y, shape.b)]
    nxt = torch.tensor(shape.nxt)

    def work() -> None:
        error = ((coverage(*leaves, nxt, 0, 256, 0, 256, canvas.ramp) - target) ** 2).mean()
        torch.autograd.grad(error, leaves)

    return least(work, seconds)


def figures(seconds: float) -> list[Figure]:
    """All measurements, each for about ``seconds``."""
    small, large = evaluation(256, seconds), evaluation(2048, seconds)
    found = [
        Figure("value + gradient + Gauss-Newton, 256x256", small, 0.12),
        Figure("value + gradient + Gauss-Newton, 2048x2048", large, None),
        Figure("ratio of the two", large / small, 12.0),
        Figure("local trial step", trial_step(seconds), 0.025),
        Figure("round of 64 proposals, 4 steps each", proposals(seconds), 8.0),
    ]
    dense = dense_oracle(seconds)
    if dense is not None:
        found.append(Figure("dense torch oracle, value + gradient, 256x256", dense, None))
        found.append(Figure("ratio of the oracle to the raster", dense / small, None))
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description="speed of the raster")
    parser.add_argument("--seconds", type=float, default=2.0, help="time for each figure")
    parser.add_argument("--json", type=Path, help="where to write the figures; printed if not given")
    chosen = parser.parse_args()
    found = figures(chosen.seconds)
    for figure in found:
        target = "" if figure.target is None else f"  (at most {figure.target:g})"
        print(f"{figure.name:48s} {figure.value:9.4f}{target}")
    text = json.dumps({figure.name: {"value": figure.value, "target": figure.target} for figure in found})
    if chosen.json:
        chosen.json.write_text(text, encoding="utf-8")
    else:
        print(text)


if __name__ == "__main__":
    main()
