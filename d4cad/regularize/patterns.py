"""Relations that might hold between many edges at once: mirror axes, repeated loops, bolt circles and rows of holes."""

from __future__ import annotations

from collections.abc import Iterator
from math import log, pi

import numpy as np

from d4cad.edges import Complexes
from d4cad.regularize.candidates import LIKELY, SELDOM, USUAL
from d4cad.regularize.measures import Measures
from d4cad.regularize.parameters import Parameters
from d4cad.regularize.selection import Candidate
from d4cad.relations import Relation

NEAR = 2.0
"""Pixels by which a point may be off from where a pattern has it; the evidence decides, this only finds pairs."""
BENT = 0.15
"""The same for bulges."""
MOST_HOLES = 40
"""Bolt circles and rows are looked for among so many circles of one radius at most."""
BOLTS = range(3, 13)


def pattern_candidates(layout: Parameters, at: Measures, pixel: float) -> list[Candidate]:
    """Candidates of patterns at these measures; ``pixel``: a pixel in the sketch's unit."""
    reach = NEAR * pixel
    return [
        *_symmetric(layout, at, reach),
        *_congruent(layout, at, reach),
        *_bolt_circles(layout, at, reach),
        *_rows(layout, at, reach),
    ]


def _points(at: Measures) -> Complexes:
    return np.asarray(at.x.value + 1j * at.y.value)


def _loops(layout: Parameters) -> list[tuple[int, int, bool]]:
    """First edge, number of edges, and whether it is a circle, of each loop."""
    return list(zip(layout.starts[:-1], layout.sizes, layout.circles.tolist(), strict=True))


def _symmetric(layout: Parameters, at: Measures, reach: float) -> Iterator[Candidate]:
    """Mirror axes: of everything, else of what shares one; and the axes of each loop by itself."""
    z = _points(at)
    axes: list[tuple[complex, float, float | None]] = []
    own: list[tuple[float | None, list[tuple[int, int]]]] = []
    for start, size, ring in _loops(layout):
        if ring:
            continue
        for shift in range(size):
            pairs = _folded(layout, at, z, start, size, shift, reach)
            if pairs is None:
                continue
            middle, angle = _axis(z, pairs)
            fixed = next((a for a in (0.0, pi / 2) if abs(_turn(angle - a)) * _reach_of(z, pairs) < reach), None)
            axes.append((middle, angle if fixed is None else fixed, fixed))
            own.append((fixed, pairs))
    box = complex(np.ptp(at.px.value), np.ptp(at.py.value)) / 2 + complex(at.px.value.min(), at.py.value.min())
    axes += [(box, 0.0, 0.0), (box, pi / 2, pi / 2)]
    whole: dict[tuple[tuple[int, int], ...], float | None] = {}
    for middle, angle, fixed in axes:
        pairs = _mirrored(layout, at, z, middle, angle, reach)
        moved = [pair for pair in pairs if pair[0] != pair[1]]
        if moved and len({_loop_of(layout, k) for pair in pairs for k in pair}) > 1:
            whole.setdefault(tuple(pairs), fixed)
    # The whole first, then the loops by themselves, in case the whole is not to be believed.
    found = [*whole.items(), *((tuple(pairs), fixed) for fixed, pairs in own)]
    for listed, fixed in dict(found).items():
        refs = tuple(layout.refs[k] for pair in listed for k in pair)
        yield Candidate(Relation("symmetric", refs, fixed), USUAL + log(len(found)))


def _loop_of(layout: Parameters, edge: int) -> int:
    return layout.refs[edge][0]


def _turn(angle: float) -> float:
    return (angle + pi / 2) % pi - pi / 2


def _reach_of(z: Complexes, pairs: list[tuple[int, int]]) -> float:
    ends = z[[k for pair in pairs for k in pair]]
    return float(np.abs(ends - ends.mean()).max())


def _axis(z: Complexes, pairs: list[tuple[int, int]]) -> tuple[complex, float]:
    """A point and the angle of the axis that mirrors pairs: across the mean of their doubled directions."""
    a, b = (z[[pair[k] for pair in pairs]] for k in (0, 1))
    across = np.sum((b - a) ** 2)
    return complex(np.mean((a + b) / 2)), float(np.angle(across) / 2 + pi / 2)


def _folded(
    layout: Parameters, at: Measures, z: Complexes, start: int, size: int, shift: int, reach: float
) -> list[tuple[int, int]] | None:
    """The pairs i, shift - i of a loop's vertices, if they mirror each other to within ``reach``."""
    first = (shift - np.arange(size)) % size
    edges = (shift - 1 - np.arange(size)) % size
    arcs, bulge = layout.arcs[start : start + size], at.bulge.value[start : start + size]
    if np.any(arcs[edges] != arcs) or np.any(np.abs(bulge[edges] - bulge) > BENT):
        return None
    length = np.exp(at.chord.value[start : start + size])
    if np.any(np.abs(length[edges] - length) > 2 * reach):
        return None
    pairs = [(start + i, start + int(j)) for i, j in enumerate(first) if i <= j]
    if all(a == b for a, b in pairs):
        return None
    middle, angle = _axis(z, pairs)
    a, b = (z[[pair[k] for pair in pairs]] for k in (0, 1))
    return pairs if np.all(np.abs(_mirror(a, middle, angle) - b) <= reach) else None


def _mirror(z: Complexes, middle: complex, angle: float) -> Complexes:
    return np.asarray(middle + np.conj(z - middle) * np.exp(2j * angle))


def _mirrored(
    layout: Parameters, at: Measures, z: Complexes, middle: complex, angle: float, reach: float
) -> list[tuple[int, int]]:
    """Pairs of all the loops that an axis takes to themselves or to each other."""
    loops, pairs, taken = _loops(layout), [], set()
    image = _mirror(z, middle, angle)
    for k, (start, size, ring) in enumerate(loops):
        if k in taken:
            continue
        for j in range(k, len(loops)):
            other, count, round_ = loops[j]
            if j in taken or (count, round_) != (size, ring):
                continue
            match = _ring_match if ring else _loop_match
            found = match(layout, at, z, image, start, other, size, reach)
            if found is not None:
                pairs += found
                taken |= {k, j}
                break
    return sorted(pairs)


def _ring_match(
    layout: Parameters, at: Measures, z: Complexes, image: Complexes, a: int, b: int, size: int, reach: float
) -> list[tuple[int, int]] | None:
    sizes = np.exp(at.radius.value[[a, b]])
    return [(a, b)] if abs(image[a] - z[b]) <= reach and abs(sizes[0] - sizes[1]) <= reach else None


def _loop_match(
    layout: Parameters, at: Measures, z: Complexes, image: Complexes, a: int, b: int, size: int, reach: float
) -> list[tuple[int, int]] | None:
    first = int(np.argmin(np.abs(z[b : b + size] - image[a])))
    to = b + (first - np.arange(size)) % size
    edges = b + (first - 1 - np.arange(size)) % size
    own = slice(a, a + size)
    near = np.all(np.abs(z[to] - image[own]) <= reach) and np.all(layout.arcs[edges] == layout.arcs[own])
    if not near or np.any(np.abs(at.bulge.value[edges] - at.bulge.value[own]) > BENT):
        return None
    return [(a + i, int(j)) for i, j in enumerate(to) if a != b or a + i <= j]


def _congruent(layout: Parameters, at: Measures, reach: float) -> Iterator[Candidate]:
    """Loops, circles apart, of one shape: each with the first like it, the best of all turns; and with itself, turned
    by the least part of a full turn.
    """
    leaders: list[int] = []
    loops = _loops(layout)
    for k, (start, size, ring) in enumerate(loops):
        if ring:
            continue
        part = next((s for s in range(1, size) if size % s == 0 and _fits(layout, at, start, start, size, s, reach)), 0)
        if part:
            yield _repeated(layout, start, start, size, part, loops)
        for leader in leaders:
            first, count, _ = loops[leader]
            shifts = range(size) if count == size else ()
            off = [_off(layout, at, first, start, size, shift) for shift in shifts]
            if off and min(off) < reach:
                yield _repeated(layout, first, start, size, int(np.argmin(off)), loops)
                break
        else:
            leaders.append(k)


def _repeated(
    layout: Parameters, a: int, b: int, size: int, shift: int, loops: list[tuple[int, int, bool]]
) -> Candidate:
    refs = tuple(layout.refs[e] for i in range(size) for e in (a + i, b + (i + shift) % size))
    return Candidate(Relation("congruent", refs), USUAL + log(len(loops)))


def _fits(layout: Parameters, at: Measures, a: int, b: int, size: int, shift: int, reach: float) -> bool:
    return _off(layout, at, a, b, size, shift) < reach


def _off(layout: Parameters, at: Measures, a: int, b: int, size: int, shift: int) -> float:
    """About how far a point is from its likeness, for loops a and b with b turned by ``shift`` edges."""
    own, other = np.arange(a, a + size), b + (np.arange(size) + shift) % size
    if np.any(layout.arcs[own] != layout.arcs[other]):
        return float("inf")
    length, bulge = np.exp(at.chord.value), at.bulge.value
    turn = np.exp(1j * (at.heading.value[layout.following] - at.heading.value))
    short = np.minimum(length[own], length[layout.following[own]])
    off = np.maximum(np.abs(length[own] - length[other]), np.abs(turn[own] - turn[other]) * short / 2)
    return float(np.maximum(off, np.abs(bulge[own] - bulge[other]) * length[own] / 2).max())


def _ring_classes(layout: Parameters, at: Measures, reach: float) -> list[np.ndarray[tuple[int], np.dtype[np.int64]]]:
    """First edges of the full circles, grouped by radius."""
    rings = np.array([start for start, _, ring in _loops(layout) if ring], dtype=np.int64)
    if rings.size < 3:
        return []
    rings = rings[np.argsort(at.radius.value[rings], kind="stable")]
    cuts = np.flatnonzero(np.diff(np.exp(at.radius.value[rings])) > reach / 2) + 1
    return [part for part in np.split(rings, cuts) if 3 <= part.size <= MOST_HOLES]


def _bolt_circles(layout: Parameters, at: Measures, reach: float) -> Iterator[Candidate]:
    """Circles of one radius at the corners of a regular polygon."""
    for part in _ring_classes(layout, at, reach):
        z = _points(at)[part]
        found: dict[frozenset[int], list[int]] = {}
        for i in range(len(z)):
            for j in range(len(z)):
                for count in BOLTS if i != j else ():
                    if count > len(z):
                        break
                    turn = np.exp(2j * pi / count)
                    center = (z[j] - z[i] * turn) / (1 - turn)
                    places = center + (z[i] - center) * turn ** np.arange(count)
                    off = np.abs(z[None, :] - places[:, None])
                    near = off.argmin(axis=1)
                    if off.min(axis=1).max() <= reach and len(set(near.tolist())) == count:
                        found.setdefault(frozenset(near.tolist()), near.tolist())
        used: set[int] = set()
        for members in sorted(found, key=lambda members: (-len(members), sorted(members))):
            if not members & used:
                used |= members
                refs = tuple(layout.refs[part[k]] for k in found[members])
                yield Candidate(Relation("polar", refs), USUAL + log(len(z)))


def _rows(layout: Parameters, at: Measures, reach: float) -> Iterator[Candidate]:
    """Circles of one radius, three or more, evenly along a line."""
    for part in _ring_classes(layout, at, reach):
        z = _points(at)[part]
        found: dict[frozenset[int], list[int]] = {}
        for i in range(len(z)):
            for j in range(len(z)):
                run = [i, j]
                while i != j:
                    off = np.abs(2 * z[run[-1]] - z[run[-2]] - z)
                    k = int(off.argmin())
                    if off[k] > reach or k in run:
                        break
                    run.append(k)
                if len(run) >= 3:
                    found.setdefault(frozenset(run), run)
        maximal = [members for members in found if not any(members < other for other in found)]
        for members in sorted(maximal, key=lambda members: (-len(members), sorted(members))):
            refs = tuple(layout.refs[part[k]] for k in found[members])
            yield Candidate(Relation("row", refs), SELDOM if len(members) == 3 else LIKELY)
