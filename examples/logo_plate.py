"""A picture becomes a sign: its shape raised on a base plate, as STEP for CAD and STL for the printer.

python examples/logo_plate.py [FOLDER]
"""

from __future__ import annotations

import sys
from pathlib import Path

import d4cad
from d4cad.exporters import Form
from d4cad.exporters.form import Emboss

PICTURE = Path(__file__).parent / "pictures" / "letter.png"


def main(out: Path = Path("out")) -> dict[str, float]:
    """Writes logo_plate.step and logo_plate.stl; volumes in mm3 of plate and logo."""
    out.mkdir(parents=True, exist_ok=True)
    logo = d4cad.fit_image(PICTURE)
    form = Form(relief=Emboss(height=1.2, base=2.0, margin=4.0))
    for extension in ("step", "stl"):
        logo.save(out / f"logo_plate.{extension}", width=40, thickness=2.0, form=form)
    sketch = logo.sketch(width=40)
    x0, y0, x1, y1 = sketch.bounds
    return {"plate": (x1 - x0 + 8) * (y1 - y0 + 8) * 2.0, "logo": sketch.area * 1.2}


if __name__ == "__main__":
    print(main(*map(Path, sys.argv[1:])))
