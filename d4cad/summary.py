"""What a finished fit is, in a few facts."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from d4cad.exporters.form import PLAIN, Form
from d4cad.fit import Fit, decibels
from d4cad.outputs import has_thickness
from d4cad.placement import Placement
from d4cad.relations import to_json as relations_json
from d4cad.sketch import Sketch
from d4cad.snapping import Snap


def census(sketch: Sketch) -> dict[str, int]:
    """Numbers of lines, arcs and full circles; a circle's edges are not counted as arcs."""
    circles = sum(loop.circle is not None for loop in sketch.loops)
    edges = [bulge for loop in sketch.loops if loop.circle is None for bulge in loop.bulges]
    arcs = sum(bulge != 0 for bulge in edges)
    return {"lines": len(edges) - arcs, "arcs": arcs, "circles": circles}


def summary(fit: Fit, placement: Placement, files: Sequence[Path], form: Form = PLAIN) -> dict[str, Any]:
    """Facts as JSON values. Sizes in mm, psnr in dB, times in seconds. form: of the solids that take one."""
    sketch = placement.place(fit.outline, fit.canvas)
    factor = placement.factor(fit.outline, fit.canvas)
    xmin, ymin, xmax, ymax = sketch.bounds
    return {
        "picture": fit.settings.get("picture"),
        "drawing": fit.settings.get("drawing"),
        "grammar": fit.grammar.name,
        "method": fit.settings.get("method"),
        "seed": fit.settings.get("seed"),
        "counted": fit.counted or "primitive",
        "primitives": fit.primitives,
        **census(sketch),
        "faces": len(sketch.faces),
        "holes": sum(len(face.holes) for face in sketch.faces),
        "psnr": fit.psnr,
        "fidelity": _fidelity(fit, placement),
        "size_mm": [xmax - xmin, ymax - ymin],
        "area_mm2": sketch.area,
        "stop": fit.stop.name.lower(),
        "stop_reason": fit.stop.value,
        "cpu_s": fit.seconds,
        "wall_s": fit.wall,
        "rounds": len(fit.history),
        "snap": None if fit.snap is None else snap_facts(fit.snap, fit.canvas.pixel, factor),
        "relations": relations_json(sketch.relations, sketch.dimensions)["relations"],
        "dimensions": {dimension.name: dimension.value for dimension in sketch.dimensions},
        "notes": list(fit.notes(placement, solid=any(has_thickness(path, form) for path in files))),
        "files": [str(path) for path in files],
    }


def snap_facts(snap: Snap, pixel: float, factor: float) -> dict[str, Any]:
    """What was snapped and by how much. pixel: world units. factor: mm per world unit."""
    counts: dict[str, int] = {}
    for relation in snap.relations:
        counts[relation.kind] = counts.get(relation.kind, 0) + 1
    return {
        "counts": counts,
        "parameters": snap.freed,
        "largest_move_px": snap.moved / pixel,
        "largest_move_mm": snap.moved * factor,
        "psnr_before": decibels(snap.before),
        "psnr_after": decibels(snap.after),
    }


def _fidelity(fit: Fit, placement: Placement) -> dict[str, Any] | None:
    """Distances from the picture's edge and warnings; None without a picture or an edge."""
    if fit.target is None or not (fit.target > 0.5).any():
        return None
    from d4cad.reporting import fidelity

    return fidelity(fit, placement)[0].facts()


def text(facts: dict[str, Any]) -> str:
    """The facts for people, a few lines."""
    width, height = facts["size_mm"]
    fitted = facts["drawing"] is None
    quality = f", {facts['psnr']:.1f} dB" if fitted else ""
    lines = [
        f"{_count(facts['primitives'], facts['counted'])} ({kinds(facts)}){quality}",
        f"{width:.6g} x {height:.6g} mm{_off(facts['fidelity'])}",
        *_snapped(facts["snap"]),
        *([f"stopped after {facts['wall_s']:.2f} s: {facts['stop_reason']}"] if fitted else []),
        *(f"warning: {warning}" for warning in (facts["fidelity"] or {}).get("warnings", ())),
        *(f"note: {note}" for note in facts["notes"]),
        *(f"wrote {path}" for path in facts["files"]),
    ]
    return "\n".join(lines)


def _off(fidelity: dict[str, Any] | None) -> str:
    if fidelity is None:
        return ""
    return (
        f", at most {fidelity['largest_px']:.2g} px ({fidelity['largest_mm']:.2g} mm) off the picture's edge, "
        f"{fidelity['mean_px']:.2g} px on average"
    )


def kinds(facts: dict[str, Any]) -> str:
    """Lines, arcs and circles of a census in words."""
    found = [_count(facts[key], key[:-1]) for key in ("lines", "arcs", "circles") if facts[key]]
    if facts["circles"]:
        found[-1] += " of 2 arcs"
    return ", ".join(found)


def _snapped(snap: dict[str, Any] | None) -> list[str]:
    """What was snapped, in a line or two."""
    if snap is None or not snap["counts"]:
        return [] if snap is None else ["snapped nothing: no relation is likely enough"]
    counts = ", ".join(f"{count} {kind.replace('_', ' ')}" for kind, count in snap["counts"].items())
    return [
        f"snapped {sum(snap['counts'].values())} relations: {counts}",
        f"  the largest move is {snap['largest_move_px']:.2g} px ({snap['largest_move_mm']:.2g} mm), "
        f"{snap['psnr_before']:.1f} -> {snap['psnr_after']:.1f} dB",
    ]


def _count(n: int, noun: str) -> str:
    return f"{n} {noun}{'' if n == 1 else 's'}"
