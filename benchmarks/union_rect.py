"""Speed of the Union-Rect kernels, one core: raster with slopes and Gauss-Newton matrix, and a round of trials."""

from __future__ import annotations

import time
from collections.abc import Callable
from statistics import median

import numpy as np

from d4cad.canvas import Canvas
from d4cad.grammars.union_rect import UnionRect
from d4cad.grammars.union_rect.structure import program_of
from d4cad.objectives.image import ImageLoss

COUNT = 11
TRIALS = 64


def milliseconds(work: Callable[[], object], repeats: int) -> float:
    """Median time of one call, the first left out."""
    work()
    times = []
    for _ in range(repeats):
        started = time.perf_counter()
        work()
        times.append(time.perf_counter() - started)
    return 1000 * median(times)


def main() -> None:
    rng = np.random.default_rng(0)
    rects = np.c_[rng.uniform(-0.8, 0.8, (COUNT, 2)), rng.uniform(0.1, 0.5, (COUNT, 2)), rng.uniform(0, np.pi, COUNT)]
    program = program_of(rects)
    for side in (256, 2048):
        canvas = Canvas.square(side)
        grammar = UnionRect(canvas.pixel)
        near = program.moved(program.params + rng.normal(0, 2 * canvas.pixel, program.params.size))
        loss = ImageLoss.of(grammar.rasterize(near, canvas).coverage)
        took = milliseconds(lambda g=grammar, c=canvas, t=loss: t.evaluate(g.rasterize(program, c)), 100)  # type: ignore[misc]
        print(f"value, gradient and Gauss-Newton matrix, {side}x{side}, {COUNT} rectangles: {took:.3f} ms")
    canvas = Canvas.square(256)
    grammar = UnionRect(canvas.pixel)
    loss = ImageLoss.of(grammar.rasterize(near, canvas).coverage)
    demand = loss.demand(grammar.rasterize(program, canvas))
    rewrites = grammar.rewrites(program, demand, canvas, rng)[:TRIALS]
    took = milliseconds(lambda: grammar.local_trials(program, rewrites, loss, canvas, 1e-5, 4), 20)
    print(f"round of {len(rewrites)} proposals of at most 4 steps, 256x256: {took:.1f} ms")


if __name__ == "__main__":
    main()
