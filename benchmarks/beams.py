"""The beams of the library at the volumes of the literature: compliance, primitives, time.

    python benchmarks/beams.py [--only cantilever_0.4 ...] [--element 1] [--out DIR] [--beat NUMBERS.json]
                               [--score SCORER.py] [--simp]

Each problem is designed twice, without and with `simplify` at 1%. Compliance is that of the solid/void part on a grid
four times as fine as the design's, with load, stiffness and thickness 1. NUMBERS.json: {"problems": {"cant_0.5":
{"number_to_beat_4x": 59.77}, ...}}. SCORER.py: an independent judge, called as `SCORER.py PROBLEM VOLUME OUTLINE.json`
with an outline {"loops": [...]} in mm, which are the problems' base elements; it prints JSON with c_4x and volume.
OUTLINE files are written to DIR, as are the pictures of the designs.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from d4cad.beams.design import Beam, design_beam
from d4cad.beams.library import find_problem
from d4cad.beams.pictures import design_panel, write_picture
from d4cad.beams.report import carried
from d4cad.beams.simp import compared

CASES = (
    ("cantilever", 0.5), ("cantilever", 0.4), ("cantilever", 0.3), ("mbb-half", 0.5), ("mbb-half", 0.4),
    ("bridge", 0.3), ("l-bracket", 0.4), ("mbb", 0.5),
)  # fmt: skip
JUDGED = {
    "cantilever": "cant", "mbb-half": "mbb_half", "mbb": "mbb_full", "l-bracket": "lbracket", "bridge": "bridge",
}  # fmt: skip
"""Names that the judge and the numbers to beat use."""


@dataclass(frozen=True)
class Row:
    """One design. compliance: on the fine grid. judged: the same by the judge, who also says the volume."""

    compliance: float
    judged: float | None
    volume: float
    primitives: int
    seconds: float


def scored(beam: Beam, name: str, out: Path, score: Path | None) -> Row:
    """Writes the outline and a picture, and measures."""
    problem, fine = beam.problem, carried(beam)
    outline = out / f"{name}.json"
    outline.write_text(json.dumps({"loops": beam.outline.to_neutral()}), encoding="utf-8")
    write_picture(out / f"{name}.png", [design_panel(problem, beam.outline, fine)])
    volume = fine.volume / float(problem.domain(4).inside.sum())
    judged = None
    if score is not None:
        command = [sys.executable, str(score), JUDGED[problem.name], str(problem.volume), str(outline)]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        verdict = json.loads(done.stdout)
        judged, volume = verdict["c_4x"], verdict["volume"]
    return Row(fine.compliance, judged, volume, beam.primitives, beam.seconds)


def line(name: str, full: Row, few: Row, beat: float | None, simp: float | None) -> str:
    """One line of a Markdown table."""

    def value(row: Row) -> str:
        compliance = row.compliance if row.judged is None else row.judged
        ratio = "" if beat is None else f" ({compliance / beat:.3f})"
        return f"{compliance:.2f}{ratio} | {row.volume:.4f} | {row.primitives} | {row.seconds:.0f}"

    best = "" if beat is None else f"{beat:.2f}"
    rival = "" if simp is None else f"{simp:.2f}"
    return f"| {name} | {best} | {rival} | {value(full)} | {value(few)} |"


COLUMNS = (
    "problem", "best known", "SIMP", "compliance (ratio)", "volume", "primitives", "CPU s", "at 1%: compliance",
    "volume", "primitives", "CPU s",
)  # fmt: skip
HEAD = f"| {' | '.join(COLUMNS)} |\n|{'---|' * len(COLUMNS)}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", metavar="PROBLEM_VOLUME")
    parser.add_argument("--element", type=float, default=1.0, metavar="MM")
    parser.add_argument("--out", type=Path, metavar="DIR")
    parser.add_argument("--beat", type=Path, metavar="NUMBERS.json")
    parser.add_argument("--score", type=Path, metavar="SCORER.py")
    parser.add_argument("--simp", action="store_true", help="run SIMP as well")
    asked = parser.parse_args()
    out = asked.out or Path(tempfile.mkdtemp(prefix="beams-"))
    out.mkdir(parents=True, exist_ok=True)
    numbers: Mapping[str, Any] = {} if asked.beat is None else json.loads(asked.beat.read_text())["problems"]
    print(HEAD)
    for problem_name, volume in CASES:
        name = f"{problem_name}_{volume:g}"
        if asked.only and name not in asked.only:
            continue
        problem = replace(find_problem(problem_name, volume), element=asked.element)
        full = scored(design_beam(problem), name, out, asked.score)
        few = scored(design_beam(problem, simplify=0.01), f"{name}_few", out, asked.score)
        rival = compared(problem).fine if asked.simp else None
        simp = None if rival is None else rival.compliance
        beat = numbers.get(f"{JUDGED[problem_name]}_{volume:g}", {}).get("number_to_beat_4x")
        print(line(name, full, few, beat, simp), flush=True)


if __name__ == "__main__":
    main()
