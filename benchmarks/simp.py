"""SIMP with a density filter on the problems of the library: what the beams are compared with.

    python benchmarks/simp.py [--only cantilever_0.4 ...] [--element 1] [--radius 3] [--iterations 200]

The classical 88-line algorithm is d4cad.beams.simp. Its density is contoured at the problem's volume and scored as any
part is: elements solid or void, on the design's grid and on one four times as fine.
"""

from __future__ import annotations

import argparse
from dataclasses import replace

from d4cad.beams.library import find_problem
from d4cad.beams.simp import compared

CASES = (
    ("cantilever", 0.5), ("cantilever", 0.4), ("cantilever", 0.3), ("mbb-half", 0.5), ("mbb-half", 0.4),
    ("bridge", 0.3), ("l-bracket", 0.4), ("mbb", 0.5),
)  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", metavar="PROBLEM_VOLUME")
    parser.add_argument("--element", type=float, default=1.0, metavar="MM")
    parser.add_argument("--radius", type=float, default=3.0, metavar="ELEMENTS")
    parser.add_argument("--iterations", type=int, default=200)
    asked = parser.parse_args()
    print("| problem | grey | 1x | 4x | iterations | CPU s |\n|---|---|---|---|---|---|")
    for name, volume in CASES:
        if asked.only and f"{name}_{volume:g}" not in asked.only:
            continue
        problem = replace(find_problem(name, volume), element=asked.element)
        rival = compared(problem, asked.radius, asked.iterations)
        coarse, fine = ("broken" if a is None else f"{a.compliance:.2f}" for a in (rival.design, rival.fine))
        run = rival.run
        print(
            f"| {name}_{volume:g} | {run.model:.2f} | {coarse} | {fine} | {run.iterations} | {run.seconds:.1f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
