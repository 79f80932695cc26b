"""A cantilever for a load of 1 kN, from the problem to a STEP file.

python examples/cantilever_to_step.py [FOLDER]
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

from d4cad.beams.design import design_beam
from d4cad.beams.library import find_problem
from d4cad.beams.report import carried, report, text
from d4cad.beams.saving import save


def main(out: Path, element: float = 1.0) -> dict[str, Any]:
    """Writes cantilever.step and cantilever.json to ``out``; returns the report's facts. element: mm."""
    problem = replace(find_problem("cantilever", 0.4), element=element)
    beam = design_beam(problem, simplify=0.01)
    files = [out / "cantilever.step", out / "cantilever.json"]
    for path in files:
        save(beam, path)
    return report(beam, carried(beam), files=files)


if __name__ == "__main__":
    print(text(main(Path(sys.argv[1] if len(sys.argv) > 1 else "."))))
