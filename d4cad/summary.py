"""What a finished fit is, in a few facts."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from d4cad.fit import Fit
from d4cad.outputs import is_solid
from d4cad.placement import Placement
from d4cad.sketch import Sketch


def census(sketch: Sketch) -> dict[str, int]:
    """Numbers of lines, arcs and full circles; a circle's edges are not counted as arcs."""
    circles = sum(loop.circle is not None for loop in sketch.loops)
    edges = [bulge for loop in sketch.loops if loop.circle is None for bulge in loop.bulges]
    arcs = sum(bulge != 0 for bulge in edges)
    return {"lines": len(edges) - arcs, "arcs": arcs, "circles": circles}


def summary(fit: Fit, placement: Placement, files: Sequence[Path]) -> dict[str, Any]:
    """Facts as JSON values. Sizes in mm, psnr in dB, times in seconds."""
    sketch = placement.place(fit.outline, fit.canvas)
    xmin, ymin, xmax, ymax = sketch.bounds
    return {
        "picture": fit.settings.get("picture"),
        "drawing": fit.settings.get("drawing"),
        "grammar": fit.grammar.name,
        "method": fit.settings.get("method"),
        "seed": fit.settings.get("seed"),
        "primitives": fit.primitives,
        **census(sketch),
        "faces": len(sketch.faces),
        "holes": sum(len(face.holes) for face in sketch.faces),
        "psnr": fit.psnr,
        "size_mm": [xmax - xmin, ymax - ymin],
        "area_mm2": sketch.area,
        "stop": fit.stop.name.lower(),
        "stop_reason": fit.stop.value,
        "cpu_s": fit.seconds,
        "wall_s": fit.wall,
        "rounds": len(fit.history),
        "notes": list(fit.notes(placement, solid=any(is_solid(path) for path in files))),
        "files": [str(path) for path in files],
    }


def text(facts: dict[str, Any]) -> str:
    """The facts for people, a few lines."""
    kinds = [_count(facts[key], key[:-1]) for key in ("lines", "arcs", "circles") if facts[key]]
    if facts["circles"]:
        kinds[-1] += " of 2 arcs"
    width, height = facts["size_mm"]
    fitted = facts["drawing"] is None
    quality = f", {facts['psnr']:.1f} dB" if fitted else ""
    lines = [
        f"{_count(facts['primitives'], 'primitive')} ({', '.join(kinds)}){quality}",
        f"{width:.6g} x {height:.6g} mm",
        *([f"stopped after {facts['wall_s']:.2f} s: {facts['stop_reason']}"] if fitted else []),
        *(f"note: {note}" for note in facts["notes"]),
        *(f"wrote {path}" for path in facts["files"]),
    ]
    return "\n".join(lines)


def _count(n: int, noun: str) -> str:
    return f"{n} {noun}{'' if n == 1 else 's'}"
