"""A drawing full of tiny segments, as tracers and font tools leave them, redrawn with the few lines and arcs it means.

python examples/simplify_dxf.py [FOLDER]
"""

from __future__ import annotations

import sys
from math import cos, pi, sin
from pathlib import Path

import ezdxf

from d4cad import Sketch, exporters, importers
from d4cad.features import Circle, RoundedRectangle
from d4cad.simplification import simplified

TOLERANCE = 0.02


def messy(path: Path) -> None:
    """A plate of 60 x 40 mm with round corners and a bore, in hundreds of segments, and a spline."""
    drawing = ezdxf.new(units=ezdxf.units.MM)
    for loop in (RoundedRectangle((30, 20), 60, 40, 8).loop(), Circle((20, 20), 9).loop()):
        drawing.modelspace().add_lwpolyline(loop.polygon(0.002), close=True)
    ring = [(44 + 6 * cos(k * pi / 12), 20 + 6 * sin(k * pi / 12)) for k in range(25)]
    drawing.modelspace().add_spline(ring)
    drawing.saveas(path)


def main(out: Path = Path("out")) -> dict[str, float]:
    """Writes messy.dxf and clean.dxf; the number of segments before and primitives after, and the area in mm2."""
    out.mkdir(parents=True, exist_ok=True)
    messy(out / "messy.dxf")
    drawing = importers.read(out / "messy.dxf", tolerance=TOLERANCE / 20)
    clean: Sketch = simplified(drawing.sketch, TOLERANCE)
    exporters.write(clean, out / "clean.dxf")
    return {"before": drawing.segments, "after": clean.primitives, "area": clean.area}


if __name__ == "__main__":
    print(main(*map(Path, sys.argv[1:])))
