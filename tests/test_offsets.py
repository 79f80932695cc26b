"""Offsets on lines and arcs: known areas, exact distances, and agreement with manifold3d and OCCT."""

from __future__ import annotations

from importlib import import_module
from math import inf, nan, pi, tan

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from d4cad.booleans import difference
from d4cad.edges import Edges, distances, points_along
from d4cad.errors import GeometryError
from d4cad.exporters.kerf import compensated
from d4cad.exporters.occ import faces
from d4cad.offsets import offset
from d4cad.shapes import generate
from d4cad.sketch import Circle, Loop, Sketch

calm = settings(max_examples=15, deadline=None)


def part(*loops: Loop) -> Sketch:
    return Sketch.from_loops(loops, "mm")


def box(x0: float, y0: float, x1: float, y1: float) -> Loop:
    return Loop.polyline([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])


def disc(r: float) -> Loop:
    return Circle((0, 0), r).loop()


SQUARE, RING = part(box(0, 0, 4, 4)), part(disc(5), disc(2))
HOLED = part(box(0, 0, 10, 10), box(4, 4, 6, 6))
ELL = part(Loop.polyline([(0, 0), (6, 0), (6, 2), (2, 2), (2, 6), (0, 6)]))
DUMBBELL = part(
    Loop.polyline(
        [(0, 0), (4, 0), (4, 1.5), (6, 1.5), (6, 0), (10, 0), (10, 4), (6, 4), (6, 2.5), (4, 2.5), (4, 4), (0, 4)]
    )
)
SLOTTED = part(Loop.polyline([(0, 0), (10, 0), (10, 4), (6, 4), (6, 1), (4, 1), (4, 4), (0, 4)]))
ROUNDED = part(Loop(((0, 0), (4, 0), (4, 2), (0, 2)), (0, 1, 0, 1)))
PACMAN = part(Loop(((0, 0), (3, 0), (0, -3)), (0, tan(3 * pi / 8), 0)))


KNOWN = [
    (SQUARE, 1, 32 + pi, 1, 0),
    (SQUARE, -1, 4, 1, 0),
    (SQUARE, -2, 0, 0, 0),
    (SQUARE, -3, 0, 0, 0),
    (part(disc(2)), 1, 9 * pi, 1, 0),
    (part(disc(2)), -1, pi, 1, 0),
    (part(disc(2)), -2, 0, 0, 0),
    (RING, 1, 35 * pi, 1, 1),
    (RING, -1, 7 * pi, 1, 1),
    (RING, -1.5, 0, 0, 0),
    (RING, 2, 49 * pi, 1, 0),
    (RING, 2.5, 7.5**2 * pi, 1, 0),
    # a reflex corner counts once where it grows, and is round where it shrinks
    (ELL, 1, 20 + 24 - 1 + 5 * pi / 4, 1, 0),
    (ELL, -0.5, 9.25 - pi / 16, 1, 0),
    # a hole vanishes at half its width
    (HOLED, 0.5, 120 + pi / 4 - 1, 1, 1),
    (HOLED, 1, 140 + pi, 1, 0),
    (HOLED, 1.5, 160 + 2.25 * pi, 1, 0),
    # a wall of 1 vanishes and leaves two bodies
    (DUMBBELL, -0.25, 2 * 3.5**2 + 1.25 + 0.25 - pi / 16, 1, 0),
    (DUMBBELL, -0.5, 2 * 9 + 1 - pi / 4, 2, 0),
    # a slot of 2 closes, but for what is left between two round corners
    (SLOTTED, 1, 66 + 1.5 * pi, 1, 0),
    (ROUNDED, 0.5, 12 + pi * 2.25, 1, 0),
    (ROUNDED, -0.5, 4 + pi * 0.25, 1, 0),
    (PACMAN, 1, 12.5 * pi + 5, 1, 0),
]


@pytest.mark.parametrize(("sketch", "distance", "area", "bodies", "holes"), KNOWN)
def test_known_areas(sketch: Sketch, distance: float, area: float, bodies: int, holes: int) -> None:
    found = offset(sketch, distance)
    assert found.area == pytest.approx(area, abs=1e-4 if bodies == 2 else 1e-9)  # where bodies part, corners draw back
    assert (len(found.faces), sum(len(face.holes) for face in found.faces)) == (bodies, holes)


def test_no_edge_more_than_needed() -> None:
    """Four lines and four quarter circles; two semicircles; and a slot that closed leaves no trace of its walls."""
    assert offset(SQUARE, 1).primitives == 8
    assert offset(part(disc(2)), 1).primitives == 2
    assert offset(SLOTTED, 1).primitives == 11
    assert offset(SQUARE, 0) is SQUARE


@pytest.mark.parametrize("distance", [nan, inf, -inf])
def test_refuses_what_is_no_distance(distance: float) -> None:
    with pytest.raises(GeometryError, match="must be finite"):
        offset(SQUARE, distance)


def test_kerf() -> None:
    """The outer loop grows and the hole shrinks by half the cut; the cut then leaves the part itself."""
    path = compensated(RING, 0.2)
    assert [loop.circle.radius for loop in path.loops if loop.circle] == pytest.approx([5.1, 1.9])
    assert offset(path, -0.1).area == pytest.approx(RING.area)


def edges(sketch: Sketch) -> Edges:
    return Edges(*(np.concatenate([loop.edges[k] for loop in sketch.loops]) for k in range(3)))


@calm
@given(
    st.integers(0, 10**6), st.sampled_from([6, 15, 40]), st.sampled_from([0.01, 0.0625, 0.2]), st.sampled_from([1, -1])
)
def test_every_point_is_at_the_distance(seed: int, primitives: int, distance: float, sign: int) -> None:
    """All along the result: not nearer to the original and not further away, by the formulas of edges.py."""
    sketch = generate(np.random.default_rng(seed), primitives)
    found = offset(sketch, sign * distance)
    if not found.faces:
        return
    q = points_along(edges(found).take((slice(None), None)), np.arange(9) / 8).ravel()
    away = distances(edges(sketch).take((None, slice(None))), q[:, None]).min(axis=1)
    np.testing.assert_allclose(away, distance, rtol=0, atol=1e-9)
    assert difference(*((sketch, found) if sign > 0 else (found, sketch))).area == 0


@calm
@given(st.integers(0, 10**6), st.sampled_from([6, 15]), st.sampled_from([0.01, 0.05]))
def test_opening_takes_off_and_closing_adds(seed: int, primitives: int, distance: float) -> None:
    sketch = generate(np.random.default_rng(seed), primitives)
    opened = offset(offset(sketch, -distance), distance)
    closed = offset(offset(sketch, distance), -distance)
    assert difference(opened, sketch).area == pytest.approx(0, abs=1e-7)
    assert difference(sketch, closed).area == pytest.approx(0, abs=1e-7)
    assert opened.area - 1e-9 <= sketch.area <= closed.area + 1e-9
    assert offset(offset(opened, -distance), distance).area == pytest.approx(opened.area, abs=1e-7)


@calm
@given(st.integers(0, 10**6), st.sampled_from([6, 15, 40]), st.sampled_from([-0.2, -0.03, 0.02, 0.3]))
def test_agrees_with_manifold3d(seed: int, primitives: int, distance: float) -> None:
    manifold3d = import_module("manifold3d")
    sketch = generate(np.random.default_rng(seed), primitives)
    section = manifold3d.CrossSection(sketch.polygon(1e-6), manifold3d.FillRule.EvenOdd)
    section = section.offset(distance, manifold3d.JoinType.Round, 2.0, 4096)
    found = offset(sketch, distance)
    assert found.area == pytest.approx(section.area(), abs=2e-5 * sketch.length)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("distance", [0.02, -0.02])
def test_agrees_with_opencascade(seed: int, distance: float) -> None:
    """Its planar offset of an outer wire with rounded corners, for distances that it copes with."""
    sketch = generate(np.random.default_rng(seed), 6)
    outer = Sketch.from_loops([sketch.faces[0].outer], "mm").scaled(10)
    build, offsets = import_module("OCP.BRepBuilderAPI"), import_module("OCP.BRepOffsetAPI")
    (face,) = faces(outer)
    maker = offsets.BRepOffsetAPI_MakeOffset(face, import_module("OCP.GeomAbs").GeomAbs_JoinType.GeomAbs_Arc)
    maker.Perform(10 * distance)
    wire = import_module("OCP.TopoDS").TopoDS
    explorer = import_module("OCP.TopExp").TopExp_Explorer(
        maker.Shape(), import_module("OCP.TopAbs").TopAbs_ShapeEnum.TopAbs_WIRE
    )
    grown = build.BRepBuilderAPI_MakeFace((getattr(wire, "Wire_s", None) or wire.Wire)(explorer.Current())).Face()
    properties = import_module("OCP.GProp").GProp_GProps()
    import_module("OCP.BRepGProp").BRepGProp.SurfaceProperties_s(grown, properties)
    assert offset(outer, 10 * distance).area == pytest.approx(abs(properties.Mass()), rel=1e-6)
