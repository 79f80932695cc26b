"""Speed of the Tree kernels, one core: raster with slopes and Gauss-Newton matrix, a step, and a round of trials."""

from __future__ import annotations

import time
from collections.abc import Callable
from statistics import median

import numpy as np

from d4cad.canvas import Canvas
from d4cad.fitting import fit_coverage
from d4cad.grammars.tree import Tree, bounds
from d4cad.objectives.image import ImageLoss
from d4cad.program import Floats
from d4cad.steppers import LevenbergMarquardt


def milliseconds(work: Callable[[], object], repeats: int) -> float:
    """Median time of one call, the first left out."""
    work()
    times = []
    for _ in range(repeats):
        started = time.perf_counter()
        work()
        times.append(time.perf_counter() - started)
    return 1000 * median(times)


def ring(canvas: Canvas) -> Floats:
    """A ring of a fifth of the canvas, as coverage."""
    rows, cols = np.mgrid[: canvas.height, : canvas.width] + 0.5
    away = np.hypot(rows - canvas.height / 2, cols - canvas.width / 2) / canvas.width
    d = canvas.width * np.maximum(away - 0.35, 0.24 - away)
    return np.asarray(np.clip(0.5 - d / (2 * canvas.ramp), 0, 1))


def main() -> None:
    canvas = Canvas.square(256)
    grammar = Tree()
    found = fit_coverage(ring(canvas), canvas, grammar="tree")
    program = found.program
    count, size = found.primitives, program.params.size
    print(f"a fit of {count} nodes, {size} parameters: {found.psnr:.1f} dB, {found.seconds:.2f} s")
    for side in (256, 2048):
        here = Canvas.square(side)
        loss = ImageLoss.of(ring(here))
        took = milliseconds(lambda c=here, t=loss: t.evaluate(grammar.rasterize(program, c)), 50)  # type: ignore[misc]
        print(f"value, gradient and Gauss-Newton matrix, {side}x{side}: {took:.3f} ms")
    loss = ImageLoss.of(ring(canvas))
    evaluation = loss.evaluate(grammar.rasterize(program, canvas))
    stepper = LevenbergMarquardt(bounds=bounds)
    took = milliseconds(lambda: stepper.step(program, evaluation, stepper.init(program)), 50)
    print(f"Levenberg-Marquardt step from them: {took:.3f} ms")
    demand = loss.demand(grammar.rasterize(program, canvas))
    rewrites = grammar.rewrites(program, demand, canvas, np.random.default_rng(0))
    took = milliseconds(lambda: grammar.local_trials(program, rewrites, loss, canvas, 1e-5, 6), 20)
    print(f"round of {len(rewrites)} proposals of at most 6 steps: {took:.1f} ms")


if __name__ == "__main__":
    main()
