"""The pictures of docs/beams.md.

python docs/images/draw_beams.py
"""

from __future__ import annotations

from pathlib import Path

from d4cad.beams.design import design_beam
from d4cad.beams.library import find_problem
from d4cad.beams.pictures import design_panel, history_panel, problem_panel, write_picture
from d4cad.beams.report import carried

HERE = Path(__file__).parent
DPI = 80


def main() -> None:
    for name, volume in (("cantilever", 0.4), ("l-bracket", 0.4)):
        problem = find_problem(name, volume)
        beam = design_beam(problem, simplify=0.01)
        panels = [problem_panel(problem), design_panel(problem, beam.outline, carried(beam))]
        if name == "cantilever":
            panels.append(history_panel(beam.history))
        write_picture(HERE / f"beam_{name}.png", panels, DPI)


if __name__ == "__main__":
    main()
