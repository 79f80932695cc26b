"""Drawings of many short edges made few again: generated parts, flattened and shaken, against what they were made of.

    python benchmarks/simplify.py [--parts 10] [--json FILE]

A part of known lines and arcs, 100 mm wide, becomes polygons within a tenth of the tolerance, whose corners are then
moved at random by up to a share of the tolerance. A part counts as recovered if it has its number of primitives again,
loop by loop. The last line is one outline of 2000 points, and 20000.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np

from d4cad.deviation import drawn_apart
from d4cad.edges import points_along
from d4cad.loop import Loop
from d4cad.segmentation import segment
from d4cad.shapes import DIFFICULTIES, generate
from d4cad.simplification import simplified
from d4cad.sketch import Sketch

TOLERANCE = 0.05
"""mm."""
FLATNESS = 0.1
WIDTH = 100.0
JITTERS = (0.0, 0.2, 0.5, 0.8)


class Row(NamedTuple):
    """Parts of one difficulty and jitter. Distances as shares of the tolerance, time in ms of CPU per part."""

    difficulty: str
    jitter: float
    before: int
    after: int
    true: int
    recovered: float
    deviation: float
    from_truth: float
    milliseconds: float


def shaken(part: Sketch, jitter: float, rng: np.random.Generator) -> Sketch:
    """The part as polygons whose corners are moved by up to a share of the tolerance."""
    loops = []
    for corners in part.polygon(FLATNESS * TOLERANCE):
        size, angle = rng.uniform(0, jitter * TOLERANCE, len(corners)), rng.uniform(0, 2 * np.pi, len(corners))
        moved = corners + size[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        loops.append(Loop.from_arrays(moved, np.zeros(len(moved))))
    return Sketch.from_loops(loops, "mm")


def measured(difficulty: str, jitter: float, parts: int) -> Row:
    """``parts`` parts of one difficulty."""
    before = after = true = good = 0
    deviation = from_truth = seconds = 0.0
    for seed in range(parts):
        rng = np.random.default_rng([seed, DIFFICULTIES[difficulty]])
        part = generate(rng, DIFFICULTIES[difficulty])
        xmin, _, xmax, _ = part.bounds
        part = part.scaled(WIDTH / (xmax - xmin))
        given = shaken(part, jitter, rng)
        start = time.process_time()
        found = simplified(given, TOLERANCE)
        seconds += time.process_time() - start
        before, after, true = before + given.primitives, after + found.primitives, true + part.primitives
        good += [len(loop.points) for loop in found.loops] == [len(loop.points) for loop in part.loops]
        deviation = max(deviation, drawn_apart(given.loops, found.loops) / TOLERANCE)
        from_truth = max(from_truth, drawn_apart(part.loops, found.loops) / TOLERANCE)
    return Row(
        difficulty, jitter, before, after, true, good / parts, deviation, from_truth, 1e3 * seconds / parts
    )  # fmt: skip


def outline(n: int) -> float:
    """ms of CPU for one noisy outline of n points: a wavy ring of arcs."""
    part = generate(np.random.default_rng(3), 40).scaled(30).loops[0]
    e, place = part.edges, np.arange(n) / n * len(part.points)
    z = points_along(e.take(place.astype(int)), place % 1)
    noise = np.random.default_rng(0).uniform(-0.3, 0.3, (n, 2)) * TOLERANCE
    points = np.stack([z.real, z.imag], axis=1) + noise
    start = time.process_time()
    segment(points, TOLERANCE)
    return 1e3 * (time.process_time() - start)


def main() -> None:
    parser = argparse.ArgumentParser(description="recovery of lines and arcs from flattened, shaken outlines")
    parser.add_argument("--parts", type=int, default=10, help="parts of each difficulty and jitter")
    parser.add_argument("--json", type=Path, help="where to write the figures")
    chosen = parser.parse_args()
    segment(np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]]), 0.01)  # compiles
    print("difficulty jitter  before -> after (true)  recovered  off by  off truth by  ms each")
    rows = []
    for difficulty in DIFFICULTIES:
        for jitter in JITTERS:
            row = measured(difficulty, jitter, chosen.parts)
            rows.append(row)
            print(
                f"{row.difficulty:10s} {row.jitter:6.1f}  {row.before:6d} -> {row.after:5d} ({row.true:4d})  "
                f"{row.recovered:9.0%}  {row.deviation:6.3f}  {row.from_truth:12.3f}  {row.milliseconds:7.0f}"
            )
    times = {n: outline(n) for n in (2000, 20000)}
    print(", ".join(f"{n} points: {t:.0f} ms" for n, t in times.items()))
    if chosen.json:
        figures = {"parts": [row._asdict() for row in rows], "outline_ms": times}
        chosen.json.write_text(json.dumps(figures), encoding="utf-8")


if __name__ == "__main__":
    main()
