"""What a designed part is worth: stiffness, volume, narrowest member, displacement and stress in real units."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from d4cad.beams.connection import require_carried
from d4cad.beams.design import Beam
from d4cad.beams.outline import shape
from d4cad.beams.problem import Place
from d4cad.beams.simp import compared
from d4cad.beams.stress import Analysis, analysed, minimum_member, peak_stress
from d4cad.booleans import difference, intersection
from d4cad.errors import InputError
from d4cad.summary import census, kinds

ALARM = 1.25
"""Compliance of the finished part over that of the soft density which the search saw, from which on it is told."""

BROKEN = 1000.0
"""The same, from which on the part is taken for one in pieces: void is 1e-9 as stiff as material."""


def report(beam: Beam, fine: Analysis, *, simp: bool = False, files: Sequence[Path] = ()) -> dict[str, Any]:
    """Facts as JSON values; mm, N, MPa and CPU seconds.

    fine: the part on the 4x grid, from :func:`d4cad.beams.stress.analysed`. compliance, compliance_fine: with load,
    stiffness and thickness 1, on the design's grid and on the fine one, elements solid or empty; None where the grid is
    too coarse for the part to carry the load on it. volume: share of the domain, exact. simp: whether to run SIMP at
    the same volume too.
    """
    problem, notes = beam.problem, []
    try:
        compliance: float | None = analysed(problem, beam.outline, 1).compliance
    except InputError:
        compliance = None
        notes.append("on the design's grid the part does not carry the load: its members are thinner than elements")
    if fine.compliance > ALARM * beam.compliance:
        notes.append(
            f"the part gives way {fine.compliance / beam.compliance:.2g} times as far as the search saw: slits or "
            "members narrower than an element; a smaller element sees them"
        )
    notes += [f"{place} must be solid but touches nothing that carries the load: left out" for place in _lost(beam)]
    area = float(problem.domain(4).inside.sum()) * fine.side**2
    stress, (x, y) = peak_stress(fine)
    strength = problem.material.strength
    return {
        "problem": problem.name,
        "size_mm": list(problem.size),
        "element_mm": problem.element,
        "thickness_mm": problem.thickness,
        "primitives": beam.primitives,
        **census(beam.outline),
        "faces": len(beam.outline.faces),
        "holes": sum(len(face.holes) for face in beam.outline.faces),
        "volume": beam.outline.area / area,
        "volume_asked": problem.volume,
        "compliance": compliance,
        "compliance_fine": fine.compliance,
        "work_nmm": fine.work,
        "max_displacement_mm": float(fine.displacement.max()),
        "max_von_mises_mpa": stress,
        "max_von_mises_at_mm": [x, y],
        "safety_factor": None if strength is None else strength / stress,
        "minimum_member_mm": minimum_member(fine),
        "simp": _simp(beam, fine.compliance) if simp else None,
        "stop": beam.stop.name.lower(),
        "stop_reason": beam.stop.value,
        "rounds": len(beam.history),
        "cpu_s": beam.seconds,
        "notes": notes,
        "files": [str(path) for path in files],
    }


def _lost(beam: Beam) -> list[Place]:
    """Solid regions that the part has not got."""
    problem, found = beam.problem, []
    for place in problem.solids:
        wanted = shape(place)
        for hole in (*problem.voids, *problem.cuts):
            wanted = difference(wanted, shape(hole))
        if intersection(wanted, beam.outline).area < 1e-3 * wanted.area:
            found.append(place)
    return found


def carried(beam: Beam) -> Analysis:
    """The part on the fine grid. Raises InputError if the part does not carry a load to a support, which it names, or
    gives way as what is broken does."""
    require_carried(beam.problem, beam.outline)
    fine = analysed(beam.problem, beam.outline)
    if fine.compliance > BROKEN * beam.compliance:
        times = f"{fine.compliance / beam.compliance:.2g} times"
        raise InputError(
            f"the part that was found does not carry its load: it gives way {times} as far as the "
            "search saw; more volume or smaller elements leave it whole"
        )
    return fine


def _simp(beam: Beam, compliance: float) -> dict[str, Any]:
    """The rival's facts; ratio: this part's compliance over the rival's, both on the fine grid, None if it broke."""
    rival = compared(beam.problem)
    return {
        "compliance": None if rival.design is None else rival.design.compliance,
        "compliance_fine": None if rival.fine is None else rival.fine.compliance,
        "compliance_grey": rival.run.model,
        "iterations": rival.run.iterations,
        "cpu_s": rival.run.seconds,
        "ratio": None if rival.fine is None else compliance / rival.fine.compliance,
    }


def text(facts: dict[str, Any]) -> str:
    """The facts for people, a few lines."""
    design = "none" if facts["compliance"] is None else f"{facts['compliance']:.4g}"
    x, y = facts["max_von_mises_at_mm"]
    width, height = facts["size_mm"]
    safety = "" if facts["safety_factor"] is None else f", {facts['safety_factor']:.2g} times below yield"
    lines = [
        f"{facts['problem']}: {facts['primitives']} primitives ({kinds(facts)}), {facts['holes']} "
        f"{'hole' if facts['holes'] == 1 else 'holes'}",
        f"domain {width:g} x {height:g} mm, {facts['thickness_mm']:g} mm thick, volume {facts['volume']:.4f} of it "
        f"({facts['volume_asked']:g} asked)",
        f"compliance {facts['compliance_fine']:.4g} on elements of {facts['element_mm'] / 4:g} mm, {design} on those "
        f"of {facts['element_mm']:g} mm (load, stiffness and thickness 1)",
        f"work of the load {facts['work_nmm']:.4g} N mm, largest displacement {facts['max_displacement_mm']:.3g} mm",
        f"largest von Mises stress {facts['max_von_mises_mpa']:.3g} MPa near ({x:g}, {y:g}) mm{safety}",
        f"narrowest member {facts['minimum_member_mm']:.3g} mm",
    ]
    if facts["simp"] is not None:
        rival = facts["simp"]
        found = (
            "its part carries no load"
            if rival["ratio"] is None
            else f"compliance {rival['compliance_fine']:.4g}, of which this part has {rival['ratio']:.3f}"
        )
        lines.append(
            f"SIMP at the same volume: {found} ({rival['iterations']} iterations, {rival['cpu_s']:.1f} s of CPU)"
        )
    return "\n".join(
        [
            *lines,
            f"stopped after {facts['cpu_s']:.1f} s of CPU: {facts['stop_reason']}",
            *(f"note: {note}" for note in facts["notes"]),
            *(f"wrote {path}" for path in facts["files"]),
        ]
    )
