"""The pictures of docs/beams.md.

python docs/images/draw_beams.py [cantilever|l-bracket|mbb|paper ...]
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

from d4cad.beams.design import Beam, design_beam
from d4cad.beams.library import find_problem
from d4cad.beams.paper import paper_beam
from d4cad.beams.pictures import design_panel, history_panel, problem_panel, write_picture
from d4cad.beams.report import carried

HERE = Path(__file__).parent
DPI = 80


def draw(name: str, beam: Beam, *, history: bool = False, problem: bool = True) -> None:
    """Problem, design and search, one above the other."""
    panels = [problem_panel(beam.problem)] if problem else []
    panels.append(design_panel(beam.problem, beam.outline, carried(beam)))
    if history:
        panels.append(history_panel(beam.history))
    write_picture(HERE / f"beam_{name}.png", panels, DPI)


def main(names: list[str]) -> None:
    if "cantilever" in names:
        draw("cantilever", design_beam(find_problem("cantilever", 0.4), simplify=0.01), history=True)
    if "l-bracket" in names:
        draw("l-bracket", design_beam(find_problem("l-bracket", 0.4), simplify=0.01))
    if "mbb" in names:
        mbb = replace(find_problem("mbb", 0.5), element=3.0)
        draw("mbb", design_beam(mbb, grammar="union-rect"), problem=False)
    if "paper" in names:
        draw("paper", paper_beam("cantilever"), problem=False)


if __name__ == "__main__":
    main(sys.argv[1:] or ["cantilever", "l-bracket", "mbb", "paper"])
