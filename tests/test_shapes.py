"""Generated shapes keep what their module promises, by checks that share no code with it."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from d4cad import shapes
from d4cad.errors import InputError
from d4cad.shapes import DIFFICULTIES, generate
from d4cad.sketch import Loop, Sketch

Floats = NDArray[np.float64]

SEEDS = {4: 6, 8: 25, 40: 8, 95: 3}
CASES = [(primitives, seed) for primitives, seeds in SEEDS.items() for seed in range(seeds)]


def sketch_of(primitives: int, seed: int) -> Sketch:
    return generate(np.random.default_rng([primitives, seed]), primitives)


@pytest.fixture(scope="module")
def sketches() -> dict[tuple[int, int], Sketch]:
    return {case: sketch_of(*case) for case in CASES}


def arc_points(p: Floats, q: Floats, bulge: float, n: int) -> Floats:
    """n points from p towards q by the textbook centre and radius."""
    t = np.arange(n)[:, None] / n
    if bulge == 0:
        return np.asarray(p + t * (q - p))
    chord, normal = q - p, np.array([p[1] - q[1], q[0] - p[0]])
    centre = (p + q) / 2 + normal * (1 - bulge**2) / (4 * bulge)
    start = np.arctan2(*(p - centre)[::-1])
    angles = start + t[:, 0] * 4 * np.arctan(bulge)
    radius = np.hypot(*chord) * (1 + bulge**2) / (4 * abs(bulge))
    return np.asarray(centre + radius * np.stack([np.cos(angles), np.sin(angles)], axis=1))


def polygon(loop: Loop, n: int = 24) -> Floats:
    points = np.array(loop.points)
    ends = np.roll(points, -1, axis=0)
    parts = [
        arc_points(p, q, b, n if b else max(2, int(np.hypot(*(q - p)) / 0.02)))
        for p, q, b in zip(points, ends, loop.bulges, strict=True)
    ]
    return np.concatenate(parts)


def crossings(sketch: Sketch) -> int:
    """Pairs of sides of the dense polygons that cross properly."""
    loops = [polygon(loop) for loop in sketch.loops]
    a = np.concatenate(loops)
    b = np.concatenate([np.roll(p, -1, axis=0) for p in loops])

    def side(p: Floats, q: Floats, r: Floats) -> Floats:
        u, v = q - p, r - p
        return np.asarray(np.sign(u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]))

    c, d = a[None], b[None]
    a, b = a[:, None], b[:, None]
    apart = (side(a, b, c) * side(a, b, d) < 0) & (side(c, d, a) * side(c, d, b) < 0)
    return int(apart.sum())


@pytest.mark.parametrize("case", CASES)
def test_number_and_reach(sketches: dict[tuple[int, int], Sketch], case: tuple[int, int]) -> None:
    sketch = sketches[case]
    assert abs(sketch.primitives - case[0]) <= 0.2 * case[0]
    assert max(map(abs, sketch.bounds)) <= shapes.REACH + 1e-3


@pytest.mark.parametrize("case", CASES)
def test_nothing_crosses(sketches: dict[tuple[int, int], Sketch], case: tuple[int, int]) -> None:
    assert crossings(sketches[case]) == 0


@pytest.mark.parametrize("case", CASES)
def test_no_vertex_can_be_left_out(sketches: dict[tuple[int, int], Sketch], case: tuple[int, int]) -> None:
    sketch = sketches[case]
    assert sketch.simplified(1e-3).primitives == sketch.primitives


@pytest.mark.parametrize("case", CASES)
def test_features_can_be_seen(sketches: dict[tuple[int, int], Sketch], case: tuple[int, int]) -> None:
    """At 256 pixels over 3 world units: edges of 5 pixels, arcs of 1.2 pixels, loops 6 pixels apart."""
    pixel = 3 / 256
    traces = [polygon(loop, 60) for loop in sketches[case].loops]
    for loop in sketches[case].loops:
        points = np.array(loop.points)
        chords = np.hypot(*(np.roll(points, -1, axis=0) - points).T)
        assert chords.min() >= 5 * pixel - 1e-9
        sagittas = np.abs(loop.bulges) * chords / 2
        assert np.all((sagittas == 0) | (sagittas >= 1.2 * pixel - 1e-9))
    for i, one in enumerate(traces):
        for other in traces[:i]:
            gap = np.hypot(*(one[:, None] - other[None]).transpose(2, 0, 1)).min()
            assert gap >= 6 * pixel - 1e-3


def test_same_seed_same_shape() -> None:
    assert sketch_of(40, 3) == sketch_of(40, 3)
    assert sketch_of(40, 3) != sketch_of(40, 4)


def test_all_kinds_occur(sketches: dict[tuple[int, int], Sketch]) -> None:
    """Lines, arcs both ways, tangent arcs, circles, holes, several faces and islands, straight and turned."""
    loops = [loop for sketch in sketches.values() for loop in sketch.loops]
    bulges = np.concatenate([loop.bulges for loop in loops])
    assert np.any(bulges == 0)
    assert np.any(bulges > 0)
    assert np.any(bulges < 0)
    assert any(loop.circle for loop in loops)
    assert any(face.holes for sketch in sketches.values() for face in sketch.faces)
    assert any(len(sketch.faces) > 1 for sketch in sketches.values())
    first = [np.array(sketch.loops[0].points) for sketch in sketches.values()]
    aligned = [np.any(np.abs(np.diff(p, axis=0)) < 1e-12) for p in first]
    assert 0.2 < np.mean(aligned) < 0.9


def test_islands_occur() -> None:
    def has_island(sketch: Sketch) -> bool:
        corners = np.array([face.outer.points[0] for face in sketch.faces])
        return any(hole.contains(corners).any() for face in sketch.faces for hole in face.holes)

    assert any(has_island(sketch_of(40, seed)) for seed in range(30))


def test_difficulties() -> None:
    assert DIFFICULTIES == {"easy": 8, "medium": 40, "hard": 95}


@pytest.mark.parametrize("primitives", [-1, 0, 3, 111])
def test_numbers_out_of_range(primitives: int) -> None:
    with pytest.raises(InputError, match=f"expected 4 to 110 primitives, got {primitives}"):
        generate(np.random.default_rng(0), primitives)


def test_every_number_between_is_possible() -> None:
    for primitives in (5, 6, 7, 11, 20, 110):
        count = sketch_of(primitives, 0).primitives
        assert abs(count - primitives) <= 0.2 * primitives
