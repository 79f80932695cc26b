"""What a loop is called: known answers, every placement, and what has no name."""

from __future__ import annotations

from math import cos, pi, radians, sin, sqrt, tan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from d4cad.errors import GeometryError
from d4cad.features import Circle, Feature, Rectangle, RegularPolygon, RoundedRectangle, Slot, feature
from d4cad.loop import Loop

Q = tan(pi / 8)

KNOWN: dict[str, tuple[Loop, Feature]] = {
    "circle of two": (Circle((3, 4), 2.5).loop(), Circle((3, 4), 2.5)),
    "circle of four": (Loop(((1, 0), (0, 1), (-1, 0), (0, -1)), (Q,) * 4), Circle((0, 0), 1)),
    "square": (Loop.polyline([(0, 0), (4, 0), (4, 4), (0, 4)]), Rectangle((2, 2), 4, 4)),
    "rectangle": (Loop.polyline([(4, 0), (4, 9), (0, 9), (0, 0)]), Rectangle((2, 4.5), 4, 9)),
    "a vertex too many": (Loop.polyline([(0, 0), (1, 0), (4, 0), (4, 9), (0, 9)]), Rectangle((2, 4.5), 4, 9)),
    "diamond": (Loop.polyline([(1, 0), (0, 1), (-1, 0), (0, -1)]), Rectangle((0, 0), sqrt(2), sqrt(2), pi / 4)),
    "slot": (Loop(((0, 0), (6, 0), (6, 2), (0, 2)), (0, 1, 0, 1)), Slot((3, 1), 8, 2)),
    "upright slot": (Loop(((0, 6), (0, 0), (2, 0), (2, 6)), (0, 1, 0, 1)), Slot((1, 3), 8, 2, pi / 2)),
    "short slot": (Loop(((0, 0), (1, 0), (1, 9), (0, 9)), (0, 1, 0, 1)), Slot((0.5, 4.5), 10, 9)),
    "rounded": (
        Loop(((1, 0), (9, 0), (10, 1), (10, 4), (9, 5), (1, 5), (0, 4), (0, 1)), (0, Q) * 4),
        RoundedRectangle((5, 2.5), 10, 5, 1),
    ),
    "hexagon": (
        Loop.polyline([(5 * cos(radians(60 * k)), 5 * sin(radians(60 * k))) for k in range(6)]),
        RegularPolygon((0, 0), 5, 6),
    ),
    "triangle": (
        Loop.polyline([(0, 0), (2, 0), (1, sqrt(3))]),
        RegularPolygon((1, sqrt(3) / 3), 2 / sqrt(3), 3, pi / 2),
    ),
}

NAMELESS = {
    "trapezium": Loop.polyline([(0, 0), (4, 0), (3, 2), (1, 2)]),
    "parallelogram": Loop.polyline([(0, 0), (4, 0), (5, 2), (1, 2)]),
    "an L": Loop.polyline([(0, 0), (4, 0), (4, 1), (1, 1), (1, 4), (0, 4)]),
    "half disc": Loop(((0, 0), (2, 0)), (0, 1)),
    "lens": Loop(((0, 0), (2, 0)), (0.5, 0.5)),
    "stadium of flat ends": Loop(((0, 0), (6, 0), (6, 2), (0, 2)), (0, 0.9, 0, 0.9)),
    "bone": Loop(((0, 0), (6, 0), (6, 2), (0, 2)), (0, -1, 0, 1)),
    "two radii": Loop(((1, 0), (8, 0), (10, 2), (10, 4), (9, 5), (1, 5), (0, 4), (0, 1)), (0, Q) * 4),
    "hollow corners": Loop(((1, 0), (9, 0), (10, 1), (10, 4), (9, 5), (1, 5), (0, 4), (0, 1)), (0, -Q) * 4),
    "almost a rectangle": Loop.polyline([(0, 0), (4, 0), (4, 2), (5e-6, 2)]),
    "equal sides, not equal angles": Loop.polyline([(0, 0), (2, 0), (2, 2), (1, 2 + sqrt(3)), (0, 2)]),
}

length = st.floats(0.5, 50)
place = st.tuples(st.floats(-200, 200), st.floats(-200, 200))
shapes = st.one_of(
    st.builds(Circle, place, length),
    st.builds(Rectangle, place, length, length, st.floats(-0.78, 0.78)),
    st.builds(lambda c, w, h, f, a: RoundedRectangle(c, w, h, f * min(w, h), a), place, length, length,
              st.floats(0.05, 0.45), st.floats(-0.78, 0.78)),
    st.builds(lambda c, reach, w, a: Slot(c, w + reach, w, a), place, length, length, st.floats(-1.57, 1.57)),
    st.builds(RegularPolygon, place, length, st.sampled_from([3, 5, 6, 7, 8, 12]), st.floats(0, 0.5)),
)  # fmt: skip


def values(found: Feature) -> list[float]:
    x, y = found.center
    return [x, y, *(getattr(found, name) for name in type(found).__dataclass_fields__ if name != "center")]


@pytest.mark.parametrize("name", KNOWN)
def test_known(name: str) -> None:
    loop, expected = KNOWN[name]
    for turned in (loop, loop.reversed()):
        found = feature(turned)
        assert type(found) is type(expected)
        assert found is not None
        assert values(found) == pytest.approx(values(expected), abs=1e-12)


@pytest.mark.parametrize("name", NAMELESS)
def test_nameless(name: str) -> None:
    assert feature(NAMELESS[name]) is None
    assert feature(NAMELESS[name].reversed()) is None


@given(shapes, st.integers(0, 11), st.booleans())
def test_every_shape_is_known_again_wherever_it_lies(shape: Feature, first: int, clockwise: bool) -> None:
    loop = shape.loop(clockwise)
    assert (loop.area < 0) == clockwise
    k = first % len(loop.points)
    found = feature(Loop(loop.points[k:] + loop.points[:k], loop.bulges[k:] + loop.bulges[:k]))
    assert type(found) is type(shape)
    assert found is not None
    again = found.loop(clockwise)
    assert again.area == pytest.approx(loop.area, rel=1e-9)
    assert again.bounds == pytest.approx(loop.bounds, abs=1e-8)
    if isinstance(shape, (Circle, Slot)):
        assert values(found)[2:] == pytest.approx(values(shape)[2:], abs=1e-7)


@given(shapes, st.integers(0, 11), st.floats(0, 2 * pi), st.floats(-7, -2))
def test_a_name_is_never_false(shape: Feature, which: int, way: float, size: float) -> None:
    """A vertex moves: a slot's along its side, say, leaves it a slot to within 1e-6; most moves leave no name."""
    loop = shape.loop()
    k = which % len(loop.points)
    points = list(loop.points)
    points[k] = (points[k][0] + 10**size * cos(way), points[k][1] + 10**size * sin(way))
    moved = Loop(tuple(points), loop.bulges)
    found = feature(moved)
    if found is None:
        assert 10**size > 2e-7  # a smaller move stays within the tolerance, whatever the shape
    else:
        assert found.loop().area == pytest.approx(moved.area, abs=1e-6 * moved.length)
        assert found.loop().bounds == pytest.approx(moved.bounds, abs=1.1e-6)


def test_tolerance() -> None:
    rough = Loop.polyline([(0, 0), (4, 1e-4), (4, 2), (0, 2)])
    assert feature(rough) is None
    found = feature(rough, 1e-3)
    assert isinstance(found, Rectangle)
    assert found.width == pytest.approx(4, abs=1e-4)
    for bad in (0.0, -1.0, float("nan")):
        with pytest.raises(GeometryError, match="must be positive"):
            feature(rough, bad)
