"""A picture of a gasket inside a build123d model: its outline extruded, and a ring of bolt holes cut by build123d.

python examples/gasket_bolt_holes.py [FOLDER]
"""

from __future__ import annotations

import sys
from pathlib import Path

from build123d import BuildPart, BuildSketch, Circle, Mode, PolarLocations, export_step, extrude

import d4cad
from d4cad.exporters.build123d import ProgramSketch

PICTURE = Path(__file__).parent / "pictures" / "gasket.png"
BOLTS, RING, DIAMETER, THICKNESS = 6, 16.5, 1.6, 2.0


def main(out: Path = Path("out")) -> dict[str, float]:
    """Writes gasket.step; its volume in mm3, and that of the gasket in the picture."""
    out.mkdir(parents=True, exist_ok=True)
    outline = d4cad.fit_image(PICTURE).sketch(width=60, origin="center")
    with BuildPart() as gasket:
        with BuildSketch():
            ProgramSketch(outline)
            with PolarLocations(RING, BOLTS):
                Circle(DIAMETER / 2, mode=Mode.SUBTRACT)
        extrude(amount=THICKNESS)
    export_step(gasket.part, out / "gasket.step")
    return {"volume": gasket.part.volume, "without holes": outline.area * THICKNESS}


if __name__ == "__main__":
    print(main(*map(Path, sys.argv[1:])))
