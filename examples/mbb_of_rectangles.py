"""The MBB beam as a union of turned rectangles: a truss whose members are flat bars with their sizes and angles.

python examples/mbb_of_rectangles.py [FOLDER]
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from d4cad.beams.design import design_beam
from d4cad.beams.library import find_problem
from d4cad.beams.pictures import design_panel, problem_panel, write_picture
from d4cad.beams.report import carried, report, text
from d4cad.beams.saving import save


def main(out: Path, element: float = 3.0) -> dict[str, Any]:
    """Writes mbb.step, .json and .png to ``out``; returns the report's facts and the bars of the half that the other
    half mirrors: length and width in mm, and degrees from the x axis. element: mm.
    """
    problem = replace(find_problem("mbb", 0.5), element=element)
    beam = design_beam(problem, grammar="union-rect")
    fine = carried(beam)
    files = [out / "mbb.step", out / "mbb.json"]
    for path in files:
        save(beam, path)
    picture = out / "mbb.png"
    write_picture(picture, [problem_panel(problem), design_panel(problem, beam.outline, fine)])
    rectangles = beam.program.params.reshape(-1, 5)  # centre, half-sizes, angle; world units and radians
    sizes = rectangles[:, 2:4] * 2 * problem.element / beam.canvas.pixel
    along = rectangles[:, 4] + np.pi / 2 * (sizes[:, 1] > sizes[:, 0])
    bars = [
        (float(size.max()), float(size.min()), float(np.degrees(angle)) % 180)
        for size, angle in zip(sizes, along, strict=True)
    ]
    return {**report(beam, fine, files=[*files, picture]), "bars": bars}


if __name__ == "__main__":
    facts = main(Path(sys.argv[1] if len(sys.argv) > 1 else "."))
    print(text(facts))
    for length, width, angle in sorted(facts["bars"], reverse=True):
        print(f"bar {length:.1f} x {width:.1f} mm at {angle:.0f} degrees")
