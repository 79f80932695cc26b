"""Exported unions of rectangles and of leaves: valid in build123d and CadQuery, and as large as their rasters?

`python benchmarks/unions.py DATA [--limit N]` fits the first N shapes of each set in the folder DATA with UR-F and
Tr-F, method fast, from the axiom in the paper's raster, and measures the exported faces.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

import numpy as np

from d4cad.bench import coverage, shapes, true_outline
from d4cad.canvas import Canvas
from d4cad.exporters.build123d import to_build123d
from d4cad.exporters.cadquery import to_cadquery
from d4cad.fit import Fit
from d4cad.fitting import fit_coverage

LIBRARIES = ("build123d", "cadquery")
ALLOWED = 1e-3
"""Relative difference of areas that is reported with its shape."""
SIDE = 4096
"""Pixels along the raster that areas are compared with."""


def raster_area(fit: Fit) -> float:
    """Area in world units of the program's raster."""
    fine = Canvas.square(SIDE)
    return float(fit.grammar.rasterize(fit.program, fine).coverage.sum()) * fine.pixel**2


def measured(fit: Fit) -> dict[str, Any]:
    """Validity and relative error of the area in both libraries, and of the outline."""
    scale = fit.canvas.pixel
    truth = raster_area(fit) / scale**2
    sketch = fit.sketch(scale=1.0)
    one, other = to_build123d(sketch), to_cadquery(sketch)
    return {
        "build123d": all(face.is_valid for face in one.faces()),
        "cadquery": all(face.isValid() for face in other.faces().vals()),
        "build123d area": one.area / truth - 1,
        "cadquery area": sum(face.Area() for face in other.faces().vals()) / truth - 1,
        "faces": len(sketch.faces),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", type=Path)
    parser.add_argument("--limit", type=int, default=8)
    parser.add_argument("--grammar", action="append")
    given = parser.parse_args()
    for grammar in given.grammar or ("union-rect", "tree"):
        rows, started = [], time.perf_counter()
        for case in shapes(given.data, given.limit):
            canvas = Canvas.square()
            fit = fit_coverage(coverage(true_outline(case), canvas), canvas, grammar=grammar, snap=False)
            rows.append(measured(fit))
            areas = max(abs(rows[-1][f"{library} area"]) for library in LIBRARIES)
            if areas > ALLOWED or not all(rows[-1][library] for library in LIBRARIES):
                print(f"  {case.set} {case.index}: {rows[-1]}")
        for library in LIBRARIES:
            off = np.abs([row[f"{library} area"] for row in rows])
            valid = sum(row[library] for row in rows)
            print(
                f"{grammar}, {library}: {valid} of {len(rows)} valid; area off by {100 * np.median(off):.4f} % "
                f"(median), {100 * off.max():.4f} % (most), {int((off <= ALLOWED).sum())} of {len(rows)} within 0.1 %"
            )
        print(f"{grammar}: {time.perf_counter() - started:.0f} s")


if __name__ == "__main__":
    main()
