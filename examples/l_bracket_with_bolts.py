"""A bracket that two bolts hold and a third one loads: bolt holes stay empty, rings around them stay solid.

    python examples/l_bracket_with_bolts.py [FOLDER]

The same problem as TOML is below: the file that `d4cad beam l_bracket.toml -o l_bracket.step` takes.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

from d4cad.beams.design import design_beam
from d4cad.beams.pictures import design_panel, problem_panel, write_picture
from d4cad.beams.reading import parse_problem
from d4cad.beams.report import carried, report, text
from d4cad.beams.saving import save

PROBLEM = """\
name = "l-bracket-with-bolts"
volume = 0.42
thickness = 8

[domain]
size = [100, 100]
element = 1

[material]
young = 70e3      # aluminium 6061-T6, MPa
poisson = 0.33
yield = 240

[[cut]]           # the L
box = [40, 40, 100, 100]

[[solid]]         # a ring of material around each bolt
circle = [12, 88, 7.5]
[[solid]]
circle = [28, 88, 7.5]
[[solid]]
circle = [90, 30, 7.5]

[[void]]          # the holes
circle = [12, 88, 4]
[[void]]
circle = [28, 88, 4]
[[void]]
circle = [90, 30, 4]

[[support]]       # the two upper bolts hold the walls of their holes
circle = [12, 88, 4]
[[support]]
circle = [28, 88, 4]

[[load]]          # the third bolt pulls down on the lower half of its hole
box = [87, 25.5, 93, 26.5]
force = [0, -800]
"""


def main(out: Path, element: float = 1.0) -> dict[str, Any]:
    """Writes l_bracket.step, .json and .png to ``out``; returns the report's facts. element: mm."""
    problem = replace(parse_problem(PROBLEM), element=element)
    beam = design_beam(problem)
    fine = carried(beam)
    files = [out / "l_bracket.step", out / "l_bracket.json"]
    for path in files:
        save(beam, path)
    picture = out / "l_bracket.png"
    write_picture(picture, [problem_panel(problem), design_panel(problem, beam.outline, fine)])
    return report(beam, fine, files=[*files, picture])


if __name__ == "__main__":
    print(text(main(Path(sys.argv[1] if len(sys.argv) > 1 else "."))))
