"""A beam bracket without any picture: exact shapes united and cut, then checked for a milling cutter.

python examples/bracket_from_shapes.py [FOLDER]
"""

from __future__ import annotations

import sys
from pathlib import Path

from d4cad import Sketch, exporters
from d4cad.booleans import difference, union
from d4cad.exporters import checks
from d4cad.features import Circle, Rectangle, Slot
from d4cad.offsets import offset

FILLET = 4.0
THICKNESS = 8.0


def main(out: Path = Path("out")) -> dict[str, float]:
    """Writes bracket.step; its area in mm2, and the smallest radius that is inside (the smallest bolt hole), in mm."""
    out.mkdir(parents=True, exist_ok=True)
    wall = Sketch.from_loops([Rectangle((6, 40), 12, 80).loop()], "mm")
    arm = Sketch.from_loops([Slot((45, 40), 90, 20).loop()], "mm")
    body = union(wall, arm)
    body = offset(offset(body, FILLET), -FILLET)  # rounds inside corners, and leaves the outside ones sharp
    holes = Sketch.from_loops([Circle((80, 40), 5).loop(), *(Circle((6, y), 2.75).loop() for y in (12, 68))], "mm")
    bracket = difference(body, holes)
    exporters.write(bracket, out / "bracket.step", thickness=THICKNESS, name="beam bracket", color="steelblue")
    report = checks.check(bracket, checks.Limits(thickness=THICKNESS, tool_diameter=5.0), ["inside corners"])
    return {"area": bracket.area, "inside radius": report.findings[0].measured or 0.0}


if __name__ == "__main__":
    print(main(*map(Path, sys.argv[1:])))
