"""Seconds that exact booleans and offsets take on wavy rings of lines and arcs, and manifold3d on polygons of them.

python benchmarks/booleans.py [--edges 100 500 1000]
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import manifold3d
import numpy as np

from d4cad.booleans import difference, intersection, union
from d4cad.offsets import offset
from d4cad.sketch import Loop, Sketch


def ring(edges: int, phase: float) -> Sketch:
    """About 2 wide, with nine waves: every other edge an arc."""
    angle = np.arange(edges) * 2 * np.pi / edges
    z = (1 + 0.15 * np.sin(9 * angle + phase)) * np.exp(1j * angle)
    bulges = np.where(np.arange(edges) % 2, 0.1, 0.0)
    return Sketch.from_loops([Loop.from_arrays(np.stack([z.real, z.imag], axis=1), bulges)], "mm")


def timed(work: Callable[[], object]) -> float:
    """The best of three runs."""
    seconds = []
    for _ in range(3):
        begin = time.perf_counter()
        work()
        seconds.append(time.perf_counter() - begin)
    return min(seconds)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--edges", type=int, nargs="+", default=[100, 500, 1000])
    print("edges   union   difference   intersection   offset out   offset in   manifold3d union, polygons to 1e-4")
    for edges in parser.parse_args().edges:
        a, b = ring(edges, 0.0), ring(edges, 1.0)
        p, q = (manifold3d.CrossSection(s.polygon(1e-4)) for s in (a, b))
        works: list[Callable[[], object]] = [
            lambda a=a, b=b: union(a, b),
            lambda a=a, b=b: difference(a, b),
            lambda a=a, b=b: intersection(a, b),
            lambda a=a: offset(a, 0.03),
            lambda a=a: offset(a, -0.03),
            lambda p=p, q=q: (p + q).area(),
        ]
        print(f"{edges:5d} " + " ".join(f"{timed(work):10.4f}" for work in works))


if __name__ == "__main__":
    main()
