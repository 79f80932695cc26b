"""Seconds that each fabrication check takes, on generated parts of a given number of primitives.

    python benchmarks/checks.py [--primitives 110] [--parts 5]

Every check is made once on each part before it is timed; the median and the longest time over the parts are printed.
`d4cad.shapes.generate` makes up to 110 primitives; a part of more is two beside each other, made one by a bridge.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from d4cad.booleans import union
from d4cad.exporters.checks import CHECKS, Limits, check
from d4cad.shapes import generate
from d4cad.sketch import Loop, Sketch

LIMITS = Limits(3.0, 4.0, 4.0, 3.0, 3.0, 0.15, (220.0, 200.0), 1)
"""So strict that most checks fail and look for all the places."""


def part(seed: int, primitives: int) -> Sketch:
    """About 100 mm wide."""
    rng = np.random.default_rng(seed)
    if primitives <= 110:
        return generate(rng, primitives).scaled(45.0)
    half = [generate(rng, primitives // 2).scaled(45.0) for _ in range(2)]
    bridge = Sketch.from_loops([Loop.polyline([(0, -3), (110, -3), (110, 3), (0, 3)])], "mm")
    return union(half[0], half[1].translated(110, 0), bridge)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--primitives", type=int, default=130)
    parser.add_argument("--parts", type=int, default=5)
    options = parser.parse_args()
    parts = [part(seed, options.primitives) for seed in range(options.parts)]
    other = Sketch.from_loops([Loop.polyline([(300, 0), (310, 0), (310, 10), (300, 10)])], "mm")
    print(f"{'check':18s} median s   longest s   ({options.parts} parts of {[p.primitives for p in parts]} primitives)")
    for name in CHECKS:
        seconds = []
        for sketch in parts:
            check(sketch, LIMITS, [name], [other])
            begin = time.perf_counter()
            check(sketch, LIMITS, [name], [other])
            seconds.append(time.perf_counter() - begin)
        print(f"{name:18s} {np.median(seconds):8.3f} {max(seconds):11.3f}")


if __name__ == "__main__":
    main()
