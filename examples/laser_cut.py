"""A picture becomes a file for a laser cutter, its kerf made up for, after a check whether it can be cut at all.

python examples/laser_cut.py [FOLDER]
"""

from __future__ import annotations

import sys
from pathlib import Path

import d4cad
from d4cad.exporters import checks

PICTURE = Path(__file__).parent / "pictures" / "gear.png"
KERF = 0.15


def main(out: Path = Path("out")) -> dict[str, float]:
    """Writes gear.dxf and gear.svg; the narrowest wall in mm, and how many checks failed."""
    out.mkdir(parents=True, exist_ok=True)
    gear = d4cad.fit_image(PICTURE)
    sketch = gear.sketch(width=50)
    laser = checks.process("laser")
    report = checks.check(sketch, laser.limits.given(kerf=KERF, bed=(300.0, 200.0)), laser.checks)
    gear.save(out / "gear.dxf", width=50, kerf=KERF)
    gear.save(out / "gear.svg", width=50, kerf=KERF, style="cut")
    wall = next(finding.measured for finding in report.findings if finding.name == "minimum wall")
    failed = sum(finding.status is checks.Status.FAILED for finding in report.findings)
    return {"wall": wall or 0.0, "failed": failed, "area": sketch.area}


if __name__ == "__main__":
    print(main(*map(Path, sys.argv[1:])))
