"""The MBB beam as a union of turned rectangles: a truss whose members are flat bars with their sizes and angles.

python examples/mbb_of_rectangles.py [FOLDER]
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

from d4cad.beams.design import design_beam
from d4cad.beams.library import find_problem
from d4cad.beams.pictures import design_panel, problem_panel, write_picture
from d4cad.beams.report import carried, report, text
from d4cad.beams.saving import save


def main(out: Path, element: float = 1.0) -> dict[str, Any]:
    """Writes mbb.step, .json and .png to ``out``; returns the report's facts and its bars. element: mm.

    bars: (length, width, degrees from the x axis) of each bar of the left half, which the right half mirrors.
    """
    problem = replace(find_problem("mbb", 0.5), element=element)
    beam = design_beam(problem, grammar="union-rect")
    fine = carried(beam)
    files = [out / "mbb.step", out / "mbb.json"]
    for path in files:
        save(beam, path)
    picture = out / "mbb.png"
    write_picture(picture, [problem_panel(problem), design_panel(problem, beam.outline, fine)])
    return {**report(beam, fine, files=[*files, picture])}


if __name__ == "__main__":
    print(text(main(Path(sys.argv[1] if len(sys.argv) > 1 else "."))))
