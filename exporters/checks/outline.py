"""Checks of the outline itself: loops that cross, narrow places, inside corners, small features, kerf, bodies."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from d4cad.booleans import difference
from d4cad.cutting import near_pairs
from d4cad.edges import Complexes, Edges, Floats, boxes, chords, lengths, meetings, neighbour_meetings, points_along
from d4cad.exporters.checks.inscribed import inscribed
from d4cad.exporters.checks.limits import Limits
from d4cad.exporters.checks.report import Finding, Place, Status, judged, not_checked
from d4cad.exporters.checks.spans import STEP, Spans, edges_and_corners, spans
from d4cad.exporters.checks.spans import places as separate
from d4cad.exporters.kerf import compensated
from d4cad.loop import ROUNDING, Loop
from d4cad.offsets import offset
from d4cad.sketch import Sketch

PLACES = 12
"""A finding names this many places at most."""

KINK = np.radians(1.0)
"""A boundary that turns less than this at a vertex is smooth there, as far as a cutter is concerned."""

ENOUGH = 1 - 1e-6
"""Measured values may fall short of a limit by rounding."""


def self_intersection(loops: Sequence[Loop]) -> Finding:
    """Where loops cross or touch themselves or each other: looked at before any library mends it in silence."""
    e, _ = edges_and_corners(loops)
    where = [complex(x) for x in _meetings(loops, e)]
    name = "self-intersection"
    if not where:
        return Finding(name, Status.PASSED, "no loop crosses or touches itself or another", 0.0, 0.0, "")
    places = tuple(Place(x.real, x.imag) for x in where[:PLACES])
    text = f"loops cross or touch at {_count(len(where), 'place')}, first at {_at(places[0])}"
    return Finding(name, Status.FAILED, text, float(len(where)), 0.0, "", places)


def _meetings(loops: Sequence[Loop], e: Edges) -> Complexes:
    """Places where edges meet other than at the vertex they share, each once."""
    sizes = np.array([len(loop.points) for loop in loops])
    begin = np.repeat(np.cumsum(sizes) - sizes, sizes)
    following = begin + (np.arange(e.b.size) - begin + 1) % np.repeat(sizes, sizes)
    box = boxes(e)
    extent = float((box[:, 2:].max(axis=0) - box[:, :2].min(axis=0)).max())
    chord = chords(e)
    touch = min(ROUNDING * extent, 0.1 * float(chord[chord > 0].min(initial=extent)))
    beside, where = neighbour_meetings(e, e.take(following), touch)
    i, j = near_pairs(box, touch)
    distinct = (following[i] != j) & (following[j] != i)
    met, there = meetings(e.take(i[distinct]), e.take(j[distinct]), touch)
    found = np.concatenate([where[beside], there[met]])
    return np.array([x for k, x in enumerate(found) if np.all(np.abs(found[:k] - x) > 1e-6 * extent)], dtype=complex)


def minimum_wall(sketch: Sketch, limits: Limits) -> Finding:
    """The least width of material between sides that face each other."""
    found = _widths(sketch.loops, limits.min_wall or 0.0)
    return _narrow("minimum wall", "wall", found, limits.min_wall, _step(sketch))


def minimum_gap(sketch: Sketch, limits: Limits) -> Finding:
    """The least width of the space between: of holes, slots, and between bodies. A cutter must pass, so that without a
    limit of its own the tool's diameter is one."""
    limit = limits.tool_diameter if limits.min_gap is None else limits.min_gap
    return _narrow("minimum gap", "gap", _gaps(sketch, limit or 0.0), limit, _step(sketch))


def _gaps(sketch: Sketch, limit: float) -> Spans:
    return _widths([loop.reversed() for loop in sketch.loops], limit)


def _widths(loops: Sequence[Loop], limit: float) -> Spans:
    """The least width to the left of loops, if there is any, and all that are below the limit; the least first."""
    facing = spans(loops, limit)
    alone = inscribed(loops, facing, max(limit, float(facing.length.min(initial=0.0))))
    both = Spans(*(np.concatenate(pair) for pair in zip(alone, facing, strict=True)))
    return both.take(np.argsort(both.length, kind="stable")) if alone.length.size else facing


def _step(sketch: Sketch) -> float:
    """Spans of one place are not further apart."""
    xmin, ymin, xmax, ymax = sketch.bounds
    return 3 * STEP * max(xmax - xmin, ymax - ymin)


def _narrow(name: str, noun: str, found: Spans, limit: float | None, step: float) -> Finding:
    if not found.length.size:
        status = Status.NOT_CHECKED if limit is None else Status.PASSED
        return Finding(name, status, f"there is no {noun}: no two sides face each other", None, limit)
    measured = float(found.length[0])
    if limit is None:
        places = _places(found.take([0]))
        text = f"no limit was given; the narrowest {noun} is {measured:.3f} mm at {_at(places[0])}"
        return Finding(name, Status.NOT_CHECKED, text, measured, None, places=places)
    if measured >= limit * ENOUGH:
        places = _places(found.take([0]))
        text = f"the narrowest {noun} is {measured:.3f} mm at {_at(places[0])}"
        return Finding(name, Status.PASSED, text, measured, limit, places=places)
    places = _places(separate(found.take(np.flatnonzero(found.length < limit * ENOUGH)), 2 * limit + step))
    text = f"a {noun} of {measured:.3f} mm at {_at(places[0])} is narrower than {limit:g} mm"
    if len(places) > 1:
        text += f"; {_count(len(places), 'such place')} in all"
    details = {"places": float(len(places))}
    return Finding(name, Status.FAILED, text, measured, limit, "mm", places[:PLACES], details)


def _places(found: Spans) -> tuple[Place, ...]:
    rows = zip(found.p.tolist(), found.q.tolist(), found.length.tolist(), strict=True)
    return tuple(Place(((p + q) / 2).real, ((p + q) / 2).imag, length, (q.real, q.imag)) for p, q, length in rows)


def inside_corners(sketch: Sketch, limits: Limits) -> Finding:
    """Inside corners, sharp or round, that are too narrow for the cutter, and the area it leaves there."""
    name = "inside corners"
    if limits.tool_diameter is None:
        return not_checked(name, "no tool diameter was given")
    limit = limits.tool_diameter / 2
    where, size = _inside_radii(sketch.loops)
    if not size.size:
        return Finding(name, Status.PASSED, "there are no inside corners", None, limit)
    order = np.argsort(size, kind="stable")
    tight = order[size[order] < limit * ENOUGH]
    least = float(size.min())
    if not tight.size:
        first = Place(where[order[0]].real, where[order[0]].imag, least)
        text = f"the smallest inside radius is {least:.3f} mm at {_at(first)}"
        return Finding(name, Status.PASSED, text, least, limit, places=(first,))
    reach = limit * ENOUGH  # a slot as wide as the cutter is open to it
    left = difference(offset(offset(sketch, reach), -reach), sketch).area
    places = tuple(Place(where[k].real, where[k].imag, float(size[k])) for k in tight[:PLACES])
    text = (
        f"a cutter of {limits.tool_diameter:g} mm is too wide for {_count(tight.size, 'inside corner')}, "
        f"the tightest of radius {least:.3f} mm at {_at(places[0])}; it leaves {left:.4g} mm2"
    )
    details = {"corners": float(tight.size), "left_area_mm2": left}
    return Finding(name, Status.FAILED, text, least, limit, "mm", places, details)


def _inside_radii(loops: Sequence[Loop]) -> tuple[Complexes, Floats]:
    """Places and radii of all inside corners, 0 for sharp ones; a round hole is one, at its centre."""
    circles = [loop.circle for loop in loops if loop.area < 0]
    holes = [circle for circle in circles if circle is not None]
    where = [np.array([complex(*circle.center) for circle in holes], dtype=np.complex128)]
    size = [np.array([circle.radius for circle in holes], dtype=np.float64)]
    others = [loop for loop in loops if loop.area > 0 or loop.circle is None]
    if others:
        e, (come, go) = edges_and_corners(others)
        sharp = e.z0[np.angle(go / come) < -KINK]
        arcs = e.take(np.flatnonzero(e.b < 0))
        where += [sharp, points_along(arcs, np.full(1, 0.5))]
        size += [np.zeros(sharp.size), chords(arcs) * (1 + arcs.b**2) / (4 * np.abs(arcs.b))]
    return np.concatenate(where), np.concatenate(size)


def kerf(sketch: Sketch, limits: Limits) -> Finding:
    """Whether the outline survives a beam of the kerf's width: what is narrower than the cut is lost."""
    name = "kerf"
    if limits.kerf is None:
        return not_checked(name, "no kerf was given")
    path = compensated(sketch, limits.kerf)
    lost = len(sketch.loops) - len(path.loops)
    gaps = _gaps(sketch, limits.kerf)
    least = float(gaps.length[0]) if gaps.length.size else None
    narrow = gaps.take(np.flatnonzero(gaps.length <= limits.kerf / ENOUGH))
    details = {"loops": float(len(sketch.loops)), "loops_lost": float(lost), "path_length_mm": path.length}
    if not narrow.length.size and lost == 0:
        text = f"all {_count(len(path.loops), 'loop')} of the outline survive, grown by half the kerf"
        if len(path.loops) == 1:
            text = "the outline survives, grown by half the kerf"
        return Finding(name, Status.PASSED, text, least, limits.kerf, details=details)
    places = _places(separate(narrow, 2 * limits.kerf + _step(sketch)))[:PLACES]
    where = f" at {_at(places[0])}" if places else ""
    text = f"a cut of {limits.kerf:g} mm is wider than what it should leave open{where}; {_count(lost, 'loop')} lost"
    return Finding(name, Status.FAILED, text, least, limits.kerf, "mm", places, details)


def smallest_feature(sketch: Sketch, limits: Limits) -> Finding:
    """The shortest edge or the smallest full circle."""
    name, noun = "smallest feature", "edge"
    sizes: list[tuple[float, str, complex]] = []
    for loop in sketch.loops:
        circle = loop.circle
        if circle is not None:
            noun = "hole" if loop.area < 0 else "disc"
            sizes.append((2 * circle.radius, noun, complex(*circle.center)))
            continue
        e = loop.edges
        middles = points_along(e, np.full(e.b.size, 0.5))
        sizes += [(float(s), "edge", complex(z)) for s, z in zip(lengths(e), middles, strict=True)]
    sizes.sort(key=lambda item: item[0])
    size, noun, z = sizes[0]
    first = Place(z.real, z.imag, size)
    text = f"the smallest {noun} is {size:.3f} mm at {_at(first)}"
    limit = limits.min_feature
    if limit is None:
        return Finding(name, Status.NOT_CHECKED, f"no limit was given; {text}", size, None, places=(first,))
    small = tuple(Place(z.real, z.imag, s) for s, _, z in sizes if s < limit * ENOUGH)
    if not small:
        return Finding(name, Status.PASSED, text, size, limit, places=(first,))
    details = {"count": float(len(small))}
    text += f", and {_count(len(small), 'feature')} in all below {limit:g} mm"
    return Finding(name, Status.FAILED, text, size, limit, "mm", small[:PLACES], details)


def bodies(sketch: Sketch, limits: Limits) -> Finding:
    """The number of separate bodies."""
    count = len(sketch.faces)
    text = f"the outline has {'1 body' if count == 1 else f'{count} bodies'}"
    ok = limits.bodies is None or count == limits.bodies
    places = tuple(Place(*face.outer.points[0]) for face in sketch.faces) if not ok else ()
    if not ok:
        text += f", expected {limits.bodies}"
    limit = None if limits.bodies is None else float(limits.bodies)
    return Finding("bodies", judged(ok), text, float(count), limit, "", places[:PLACES])


def _at(place: Place) -> str:
    return f"({place.x:.2f}, {place.y:.2f})"


def _count(n: int, noun: str) -> str:
    return f"{n} {noun}" if n == 1 else f"{n} {noun}s"
