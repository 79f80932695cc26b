"""What a user asks of a finished outline: only lines or arcs, fewer of them, no small radii, no small features."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from math import inf
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import NDArray

from d4cad.descent import Stop
from d4cad.deviation import drawn_apart
from d4cad.errors import D4cadError, GeometryError, InputError
from d4cad.fidelity import left_by
from d4cad.fit import Fit, decibels
from d4cad.fitting import fit_image, regularised
from d4cad.joining import joined
from d4cad.placement import Placement
from d4cad.protocols import Tracer
from d4cad.reduction import length
from d4cad.simplification import simplified
from d4cad.sketch import Loop, Sketch

CHORDS = 0.25
"""Pixels by which the lines that replace arcs may leave them where no tolerance is given."""
SHARES = (1.0, 0.7, 0.4, 0.2)
"""Shares of a tolerance tried in turn, until the outline stays within it of the picture's edge."""
FLAT = 0.01
"""Sagitta in pixels of the arcs that replace lines: less than any picture shows."""
CORNER = np.radians(10.0)
"""A neighbour that meets an arc within this angle of its tangent goes on straight to the corner that replaces it."""

LINE_RULES = frozenset(("merge-line", "close", "remove-loop"))


@dataclass(frozen=True, slots=True)
class Finish:
    """What to do with an outline after the fit.

    Lengths are mm, or text with a unit such as "0.5px" or "0.1mm". tolerance: how far the outline may leave the
    picture's edge for the sake of fewer primitives. lines_only, arcs_only: kinds of edges. min_radius: arcs of less
    radius become corners or lines. min_feature: loops of less extent go. Raises InputError for both kinds only.
    """

    tolerance: str | float | None = None
    lines_only: bool = False
    arcs_only: bool = False
    min_radius: str | float | None = None
    min_feature: str | float | None = None

    def __post_init__(self) -> None:
        if self.lines_only and self.arcs_only:
            raise InputError("expected lines only or arcs only, got both")
        for name, value in self.sizes.items():
            length(value, 1.0, name.replace("_", " "))

    @property
    def sizes(self) -> dict[str, str | float]:
        """The lengths that are given, by name."""
        found = {"tolerance": self.tolerance, "min_radius": self.min_radius, "min_feature": self.min_feature}
        return {name: value for name, value in found.items() if value is not None}


def fit_finished(
    image: str | PathLike[str] | NDArray[Any],
    finish: Finish,
    size: Placement,
    *,
    snap: bool | None = None,
    method: str = "fast",
    **options: Any,
) -> Fit:
    """Fit a picture, finish its outline, and only then look for relations, which finishing would break.

    size: as far as it is given. The rest as for :func:`d4cad.fitting.fit_image`; raises as that and :func:`finished`.
    """
    if finish == Finish():
        return fit_image(image, method=method, snap=snap, size=size, **options)
    fit = fit_image(image, method=method, snap=False, **options)
    fit = finished(fit, finish, fit.placement(size.width, size.scale, size.dpi))
    wanted = method != "paper" if snap is None else snap
    return regularised(fit, size) if wanted and fit.stop is not Stop.INTERRUPTED else fit


def finished(fit: Fit, finish: Finish, placement: Placement | None = None) -> Fit:
    """The fit with its outline finished, its notes saying what was done and by how much the outline moved.

    placement: what tells the size of a pixel in mm, by default the fit's own. Raises InputError for lengths that leave
    nothing, and for a fit without its picture.
    """
    if finish == Finish():
        return fit
    if fit.target is None:
        raise InputError("an outline is finished beside its picture, and a program file has none")
    mm = pixel_mm(fit, fit.placement() if placement is None else placement)
    sizes = {name: length(value, mm) / mm for name, value in finish.sizes.items()}
    notes: list[str] = []
    steps: list[Callable[[Fit], Fit]] = []
    if "min_feature" in sizes:
        steps.append(lambda f: _without_small(f, sizes["min_feature"], notes))
    if "min_radius" in sizes:
        steps.append(lambda f: _without_tight(f, sizes["min_radius"], notes))
    if finish.lines_only:
        steps.append(lambda f: _of_lines(f, sizes.get("tolerance", CHORDS)))
    elif "tolerance" in sizes:
        steps.append(lambda f: _within(f, sizes["tolerance"]))
    if finish.arcs_only:
        steps.append(_of_arcs)
    found = fit
    for step in steps:
        found = step(found)
    moved = drawn_apart(fit.outline.loops, found.outline.loops) / fit.canvas.pixel
    off = left_by(found.coverage, fit.target)
    how = f"the outline moved by at most {moved:.2g} px and" if moved > 1e-6 else "the outline stays as it was and"
    notes.append(
        f"finished: {fit.primitives} -> {found.primitives} primitives, {how}, drawn alike, leaves the "
        f"picture's edge by at most {off:.2g} px"
    )
    if "tolerance" in sizes and off > sizes["tolerance"]:
        notes.append(f"the tolerance of {sizes['tolerance']:.3g} px could not be kept: it is {off:.2g} px")
    asked = {name: value for name, value in asdict(finish).items() if value}
    return replace(found, settings={**fit.settings, **asked, "notes": [*_texts(fit.settings.get("notes", ())), *notes]})


def pixel_mm(fit: Fit, placement: Placement) -> float:
    """Millimetres per pixel of a fit that is placed so."""
    if placement.width is None:
        return placement.pixel_size
    xmin, _, xmax, _ = fit.outline.bounds
    return placement.width / ((xmax - xmin) / fit.canvas.pixel)


def _texts(value: object) -> list[str]:
    return [str(text) for text in value] if isinstance(value, (list, tuple)) else []


def _outlined(fit: Fit, loops: Sequence[Loop]) -> Fit:
    """The fit with other loops, in world units. Raises GeometryError where they cross."""
    if not isinstance(fit.grammar, Tracer):
        raise InputError(f"the grammar {fit.grammar.name} cannot draw a finished outline, only arc-line can")
    outline = Sketch.from_loops(loops, "world")
    found = replace(fit, outline=outline, program=fit.grammar.drawn(outline.loops))
    assert fit.target is not None
    return replace(found, psnr=decibels(float(np.mean((found.coverage - fit.target) ** 2))))


def _without_small(fit: Fit, least: float, notes: list[str]) -> Fit:
    def extent(loop: Loop) -> float:
        xmin, ymin, xmax, ymax = loop.bounds
        return max(xmax - xmin, ymax - ymin) / fit.canvas.pixel

    kept = [loop for loop in fit.outline.loops if extent(loop) >= least]
    if not any(extent(face.outer) >= least for face in fit.outline.faces):
        raise InputError(f"nothing of the part is as large as the least feature, {least:.4g} px")
    gone = len(fit.outline.loops) - len(kept)
    if gone == 0:
        return fit
    notes.append(f"dropped {gone} {'loop' if gone == 1 else 'loops'} under {least:.3g} px")
    return _outlined(fit, kept)


def _without_tight(fit: Fit, least: float, notes: list[str]) -> Fit:
    loops, changed, left = list(fit.outline.loops), 0, 0
    for k, loop in enumerate(loops):
        if loop.circle is not None:
            left += loop.circle.radius < least * fit.canvas.pixel
            continue
        while (tight := _tightest(loops[k], least * fit.canvas.pixel)) is not None:
            before, loops[k] = loops[k], _straightened(loops[k], tight)
            if len(loops[k].points) < 2 or not _bounds_a_region(loops):
                loops[k] = before
                left += 1
                break
            changed += 1
    if changed:
        notes.append(f"replaced {changed} {'arc' if changed == 1 else 'arcs'} of a radius under {least:.3g} px")
    if left:
        notes.append(
            f"kept {left} {'circle or loop' if left == 1 else 'circles or loops'} of a radius under {least:.3g} px"
        )
    return _outlined(fit, loops) if changed else fit


def _bounds_a_region(loops: Sequence[Loop]) -> bool:
    try:
        Sketch.from_loops(loops)
    except GeometryError:
        return False
    return True


def _tightest(loop: Loop, least: float) -> int | None:
    """The arc of the least radius, if it is under ``least``."""
    e = loop.edges
    with np.errstate(divide="ignore"):
        radius = np.abs(e.z1 - e.z0) * (1 + e.b**2) / (4 * np.abs(e.b))
    k = int(np.argmin(radius))
    return k if radius[k] < least * (1 - 1e-9) else None


def _straightened(loop: Loop, k: int) -> Loop:
    """The loop with arc k as the corner in which its tangent neighbours meet, else as its chord."""
    e = loop.edges
    n = e.b.size
    before, after = (k - 1) % n, (k + 1) % n
    half = 2 * np.arctan(e.b[k])
    along = (e.z1[k] - e.z0[k]) / abs(e.z1[k] - e.z0[k])
    into, out = along * np.exp(-1j * half), along * np.exp(1j * half)
    points = np.array([complex(*p) for p in loop.points])
    bulges = np.array(loop.bulges)
    straight = n > 3 and bulges[before] == 0 and bulges[after] == 0 and abs(half) < 0.45 * np.pi
    if straight:
        arriving, leaving = e.z1[before] - e.z0[before], e.z1[after] - e.z0[after]
        straight = abs(np.angle(arriving / into)) < CORNER and abs(np.angle(leaving / out)) < CORNER
    if not straight:
        bulges[k] = 0.0
        return Loop.from_arrays(np.stack([points.real, points.imag], axis=1), bulges)
    # Where the two lines meet: z1[before] + s arriving = z0[after] + t leaving.
    s = ((e.z0[after] - e.z1[before]) * np.conj(leaving)).imag / (arriving * np.conj(leaving)).imag
    points[k] = e.z1[before] + s * arriving
    points, bulges = np.delete(points, after), np.delete(bulges, k)
    return Loop.from_arrays(np.stack([points.real, points.imag], axis=1), bulges)


def _within(fit: Fit, tolerance: float) -> Fit:
    """The fewest edges that simplification finds within ``tolerance`` pixels of the picture's edge."""
    best = fit
    for share in SHARES:
        loops = simplified(fit.outline, share * tolerance * fit.canvas.pixel).loops
        found = _outlined(fit, loops)
        if found.primitives < fit.primitives and left_by(found.coverage, _target(fit)) <= tolerance:
            best = found
            break
    return best


def _of_lines(fit: Fit, tolerance: float) -> Fit:
    """Chords in place of arcs, their ends fitted anew, and those merged that do not pay for themselves.

    Chords that are fitted straddle the arc, so that they may be twice as coarse as inscribed ones; it is measured.
    """
    best, off = None, inf
    for share in (1.8, 1.2, 0.8, 0.4):
        step = share * tolerance * fit.canvas.pixel
        loops = [joined(_polygon(loop, step), 1e-6 * fit.canvas.pixel) for loop in fit.outline.loops]
        try:
            found = _settled(_outlined(fit, loops))
        except GeometryError:
            continue
        left = left_by(found.coverage, _target(fit))
        if best is None or left < off:
            best, off = found, left
        if left <= max(tolerance, left_by(fit.coverage, _target(fit))):
            break
    if best is None:
        raise D4cadError("lines alone cannot draw this outline: its loops are too close to each other")
    return best


def _polygon(loop: Loop, step: float) -> Loop:
    points = loop.polygon(step)
    if len(points) < 3:  # a circle coarser than the tolerance
        points = loop.polygon(step / 8)
    return Loop.from_arrays(points, np.zeros(len(points)))


def _settled(fit: Fit) -> Fit:
    """The places of the vertices of lines fitted to the picture, lines merged that do not pay."""
    from d4cad.descent import descend
    from d4cad.grammars.arc_line import ArcLine
    from d4cad.methods import fast
    from d4cad.objectives.image import ImageLoss

    floor = float(fit.settings.get("floor", 0.03))
    method = fast(fit.canvas, floor)
    method = replace(method, stages=method.stages[-1:])
    grammar = ArcLine(fit.canvas.pixel, rules=LINE_RULES)
    loss = ImageLoss.of(_target(fit))
    found = descend(fit.program, grammar, loss, fit.canvas, method, np.random.default_rng(0))
    return _outlined(fit, grammar.outline(found.program).loops)


def _of_arcs(fit: Fit) -> Fit:
    """Arcs of the least sagitta in place of lines: they bow outwards."""
    least = 2 * FLAT * fit.canvas.pixel
    loops = []
    for loop in fit.outline.loops:
        chord = np.abs(loop.edges.z1 - loop.edges.z0)
        bulges = np.array(loop.bulges)
        points = np.array(loop.points)
        loops.append(Loop.from_arrays(points, np.where(bulges == 0, least / chord, bulges)))
    return _outlined(fit, loops)


def _target(fit: Fit) -> np.ndarray:
    if fit.target is None:
        raise InputError("an outline is finished beside its picture, and a program file has none")
    return fit.target
