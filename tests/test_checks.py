"""Fabrication checks: known answers, places, exit codes, and what cannot be checked."""

from __future__ import annotations

import json
import sys
from importlib import import_module
from math import cos, inf, nan, pi, radians, sin, sqrt, tan
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image
from typer.testing import CliRunner, Result

from d4cad import io
from d4cad.cli import app
from d4cad.errors import ExportError, InputError
from d4cad.exporters import mesh
from d4cad.exporters.checks import (
    CHECKS,
    PROCESSES,
    Finding,
    Limits,
    Report,
    Status,
    check,
    check_loops,
    machine,
    process,
)
from d4cad.exporters.checks.inscribed import inscribed
from d4cad.exporters.checks.picture import write_picture
from d4cad.exporters.checks.spans import places, spans
from d4cad.fitting import fit_image
from d4cad.offsets import offset
from d4cad.placement import Placement
from d4cad.shapes import generate
from d4cad.sketch import Circle, Loop, Sketch

calm = settings(max_examples=12, deadline=None)
BULGE = tan(pi / 8)


def part(*loops: Loop) -> Sketch:
    return Sketch.from_loops(loops, "mm")


def box(x0: float, y0: float, x1: float, y1: float) -> Loop:
    return Loop.polyline([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])


def disc(r: float, x: float = 0, y: float = 0) -> Loop:
    return Circle((x, y), r).loop()


def fan(n: int, *radii: float) -> Loop:
    """A polygon whose n corners lie on circles of these radii in turn."""
    return Loop.polyline(
        [(radii[k % len(radii)] * cos(2 * pi * k / n), radii[k % len(radii)] * sin(2 * pi * k / n)) for k in range(n)]
    )


def slot(x0: float, x1: float, y: float, r: float) -> Loop:
    return Loop(((x0, y - r), (x1, y - r), (x1, y + r), (x0, y + r)), (0, 1, 0, 1))


def found(name: str, sketch: Sketch, others: tuple[Sketch, ...] = (), **limits: Any) -> Finding:
    (finding,) = check(sketch, Limits(**limits), [name], others).findings
    return finding


FRAME = part(box(0, 0, 30, 20), box(2, 3, 26, 17))
SLOTTED = part(box(0, 0, 40, 16), slot(10, 30, 8, 1.6))
DUMBBELL = part(
    Loop.polyline(
        [(0, 0), (4, 0), (4, 1.5), (6, 1.5), (6, 0), (10, 0), (10, 4), (6, 4), (6, 2.5), (4, 2.5), (4, 4), (0, 4)]
    )
)
TAB = part(Loop.polyline([(0, 0), (20, 0), (20, 10), (10.5, 10), (10.5, 15), (10, 15), (10, 10), (0, 10)]))
TAPERED = part(Loop.polyline([(0, 0), (20, 0), (20, 10), (11, 10), (10.6, 15), (9.4, 15), (9, 10), (0, 10)]))
NOTCHES = part(Loop.polyline([(0, 0), (4, 0), (5, 1.7), (6, 0), (10, 0), (10, 4), (6, 4), (5, 2.3), (4, 4), (0, 4)]))
ELL = part(Loop.polyline([(0, 0), (30, 0), (30, 10), (10, 10), (10, 30), (0, 30)]))

WALLS = [
    (FRAME, 2.0),
    (SLOTTED, 6.4),
    (DUMBBELL, 1.0),
    (TAB, 0.5),  # shrinking it changes no topology
    (part(disc(5)), 10.0),
    (part(disc(5), disc(3)), 2.0),
    (part(disc(5), disc(3, 1)), 1.0),  # eccentric: where the ring is thinnest
    (part(box(0, 0, 40, 30), disc(1, 10, 15), disc(1, 12.8, 15)), 0.8),
    (part(box(0, 0, 400, 300), disc(0.5, 200, 150), disc(0.5, 203, 150)), 2.0),  # pinholes far from all else
    (NOTCHES, 0.6),  # between two reflex corners
    (part(fan(10, 1, 2)), 2 * sin(radians(72))),  # a star is as thin as between its inner corners
    (part(fan(6, 2)), 2 * sqrt(3)),
    (TAPERED, 1.2),  # nearly parallel sides: its narrow end
]


@pytest.mark.parametrize(("sketch", "width"), WALLS)
def test_minimum_wall(sketch: Sketch, width: float) -> None:
    finding = found("minimum wall", sketch, min_wall=width - 0.01)
    assert finding.measured == pytest.approx(width, abs=0.01)
    assert finding.status is Status.PASSED
    failing = found("minimum wall", sketch, min_wall=width + 0.02)
    assert failing.status is Status.FAILED
    place = failing.places[0]
    assert place.to is not None
    x, y = place.to
    assert 2 * np.hypot(place.x - x, place.y - y) == pytest.approx(failing.measured)


def test_parallel_walls_are_exact() -> None:
    for sketch, width in WALLS[:9]:
        assert found("minimum wall", sketch, min_wall=0.1).measured == pytest.approx(width, abs=1e-7)


@pytest.mark.parametrize("sketch", [FRAME, DUMBBELL, part(disc(5), disc(3, 1)), NOTCHES])
def test_minimum_wall_agrees_with_manifold3d(sketch: Sketch) -> None:
    """The distance at which shrinking a fine polygon first changes its topology, by bisection."""
    manifold3d = import_module("manifold3d")
    section = manifold3d.CrossSection(sketch.polygon(1e-5), manifold3d.FillRule.EvenOdd)

    def census(width: float) -> tuple[int, int]:
        rest = section.offset(-width / 2, manifold3d.JoinType.Round, 2.0, 2048)
        return (0 if rest.is_empty() else len(rest.decompose())), rest.num_contour()

    low, high = 0.0, 8.0
    while high - low > 1e-3:
        middle = (low + high) / 2
        low, high = (middle, high) if census(middle) == census(0.0) else (low, middle)
    assert found("minimum wall", sketch, min_wall=0.1).measured == pytest.approx(low, abs=5e-3)


def test_sharp_corners_are_no_thin_walls() -> None:
    triangle = part(Loop.polyline([(0, 0), (10, 0), (0, 10)]))
    assert found("minimum wall", triangle, min_wall=1.0).status is Status.PASSED
    rounded = Loop(((0.1, 0), (9.9, 0), (10, 0.1), (10, 9.9), (9.9, 10), (0.1, 10), (0, 9.9), (0, 0.1)), (0, BULGE) * 4)
    assert found("minimum wall", part(rounded), min_wall=9.0).measured == pytest.approx(10)
    spike = part(Loop.polyline([(0, 0), (10, 0), (0, 1)]))  # sharper than 20 degrees
    assert found("minimum wall", spike, min_wall=0.5).status is Status.FAILED


@pytest.mark.parametrize(
    ("sketch", "width"),
    [
        (FRAME, 14.0),
        (SLOTTED, 3.2),
        (DUMBBELL, 2.0),
        (part(disc(5), disc(2)), 4.0),
        (part(box(0, 0, 9, 9), box(9.25, 0, 20, 9)), 0.25),
        (part(disc(1), disc(1, 2.75)), 0.75),
    ],
)
def test_minimum_gap(sketch: Sketch, width: float) -> None:
    finding = found("minimum gap", sketch, min_gap=width + 0.02)
    assert finding.status is Status.FAILED
    assert finding.measured == pytest.approx(width, abs=1e-7)
    assert found("minimum gap", sketch, min_gap=width).status is Status.PASSED
    assert found("minimum gap", sketch, tool_diameter=width + 0.02).status is Status.FAILED


def test_a_triangle_has_its_inscribed_circle() -> None:
    """As a body and as a hole: r = area / (half the perimeter)."""
    sides, radius = (3.0, 4.0, 5.0), 1.0
    triangle = Loop.polyline([(10, 10), (10 + sides[0], 10), (10, 10 + sides[1])])
    wall = found("minimum wall", part(triangle), min_wall=2.5)
    gap = found("minimum gap", part(box(0, 0, 30, 30), triangle), min_gap=2.5)
    for finding in (wall, gap):
        assert finding.status is Status.FAILED
        assert finding.measured == pytest.approx(2 * radius, abs=1e-3)
        assert (finding.places[0].x, finding.places[0].y) == pytest.approx((11, 11), abs=1e-2)
    assert found("minimum wall", part(triangle), min_wall=1.99).status is Status.PASSED


def test_nothing_faces_anything() -> None:
    assert found("minimum gap", part(disc(5)), min_gap=1.0).measured is None
    assert found("minimum gap", part(disc(5)), min_gap=1.0).status is Status.PASSED


@calm
@given(st.integers(0, 10**6), st.sampled_from([8, 25, 60]))
def test_narrower_offsets_change_no_topology(seed: int, primitives: int) -> None:
    """Up to half the least width nothing parts or vanishes, where a part shrinks, and nothing merges where it grows."""
    sketch = generate(np.random.default_rng(seed), primitives).scaled(50)
    census = [len(sketch.faces), len(sketch.loops)]
    for sign, loops in ((-1, list(sketch.loops)), (1, [loop.reversed() for loop in sketch.loops])):
        facing = spans(loops)
        width = float(facing.length.min(initial=20.0))
        radius = float(inscribed(loops, facing, width).length.min(initial=width)) / 2
        changed = offset(sketch, sign * 0.999 * radius)
        assert [len(changed.faces), len(changed.loops)] == census


@calm
@given(st.integers(0, 10**6), st.sampled_from([0.5, 1.0, 2.0]))
def test_a_slit_is_found(seed: int, width: float) -> None:
    """A slot cut into a generated part at random, and nothing else that narrow."""
    rng = np.random.default_rng(seed)
    cut = slot(0.0, 5.0, 0.0, width / 2)
    z = cut.edges.z0 * np.exp(1j * rng.uniform(0, 7))
    loop = Loop.from_arrays(np.stack([z.real, z.imag], axis=1), cut.edges.b)
    finding = found("minimum gap", part(fan(9, 30), loop), min_gap=width + 0.1)
    assert finding.measured == pytest.approx(width, abs=1e-6)
    assert len(finding.places) == 1


def test_places_of_one_wall_are_one() -> None:
    narrow = spans(FRAME.loops, 3.5)
    kept = places(narrow, 8.0)
    assert np.all(np.diff(kept.length) >= -1e-9)
    assert 1 <= kept.p.size <= 3
    assert kept.length[0] == pytest.approx(2.0)


@pytest.mark.parametrize("radius", [0.5, 1.5, 3.0])
def test_inside_corner(radius: float) -> None:
    """A cutter of radius r leaves (1 - pi/4) r^2 in a corner of 90 degrees."""
    finding = found("inside corners", ELL, tool_diameter=2 * radius)
    assert finding.status is Status.FAILED
    assert (finding.measured, finding.limit) == (0.0, radius)
    (place,) = finding.places
    assert (place.x, place.y) == (10, 10)
    assert finding.details["left_area_mm2"] == pytest.approx((1 - pi / 4) * radius**2, rel=1e-4)


def test_round_inside_corners() -> None:
    """Exact radii; a hole counts once, at its centre; a slot as wide as the cutter is open to it."""
    rounded = Loop(((0, 0), (30, 0), (30, 10), (12, 10), (10, 12), (10, 30), (0, 30)), (0, 0, 0, -BULGE, 0, 0, 0))
    sketch = part(rounded, disc(1.0, 5, 5))
    assert found("inside corners", part(rounded), tool_diameter=4.0).status is Status.PASSED
    finding = found("inside corners", sketch, tool_diameter=4.5)
    assert [(round(p.x, 6), round(p.y, 6)) for p in finding.places] == [(5, 5), (10.585786, 10.585786)]
    assert [p.value for p in finding.places] == pytest.approx([1.0, 2.0])
    notch = part(Loop.polyline([(0, 0), (30, 0), (30, 20), (18, 20), (18, 10), (15, 10), (15, 20), (0, 20)]))
    left = found("inside corners", notch, tool_diameter=3.0).details["left_area_mm2"]
    assert left == pytest.approx(2 * (1 - pi / 4) * 2.25, rel=1e-3)
    assert found("inside corners", part(disc(5)), tool_diameter=3.0).measured is None


def test_kerf() -> None:
    assert found("kerf", FRAME, kerf=0.2).status is Status.PASSED
    path = found("kerf", FRAME, kerf=0.2).details["path_length_mm"]
    assert path == pytest.approx(100 + 2 * pi * 0.1 + 76 - 0.8)
    pinned = part(box(0, 0, 30, 20), disc(0.05, 5, 5), slot(10, 20, 10, 0.09), disc(2, 25, 5))
    finding = found("kerf", pinned, kerf=0.2)
    assert finding.status is Status.FAILED
    assert finding.details["loops_lost"] == 2
    assert finding.measured == pytest.approx(0.1)
    assert (finding.places[0].x, finding.places[0].y) == pytest.approx((5, 5))
    slit = part(Loop.polyline([(0, 0), (30, 0), (30, 20), (15.1, 20), (15.1, 5), (15, 5), (15, 20), (0, 20)]))
    assert found("kerf", slit, kerf=0.15).status is Status.FAILED
    assert found("kerf", slit, kerf=0.09).status is Status.PASSED


def test_smallest_feature() -> None:
    sketch = part(box(0, 0, 30, 20), disc(0.4, 5, 5))
    finding = found("smallest feature", sketch, min_feature=1.0)
    assert finding.status is Status.FAILED
    assert finding.measured == pytest.approx(0.8)
    assert "hole" in finding.message
    chamfered = part(Loop.polyline([(0.1, 0), (30, 0), (30, 20), (0, 20), (0, 0.1)]))
    finding = found("smallest feature", chamfered, min_feature=0.2)
    assert finding.measured == pytest.approx(0.1 * sqrt(2))
    assert (finding.places[0].x, finding.places[0].y) == pytest.approx((0.05, 0.05))
    assert found("smallest feature", chamfered, min_feature=0.1).status is Status.PASSED


def test_bodies() -> None:
    two = part(box(0, 0, 9, 9), box(10, 0, 20, 9))
    assert found("bodies", two, bodies=1).status is Status.FAILED
    assert found("bodies", two, bodies=2).status is Status.PASSED
    assert found("bodies", two).measured == 2


@pytest.mark.parametrize(
    "sketch", [FRAME, SLOTTED, part(disc(5)), part(box(0, 0, 9, 9), disc(1, 20, 0), disc(2, 4, 4))]
)
def test_watertight(sketch: Sketch) -> None:
    finding = found("watertight", sketch, thickness=4.0)
    assert finding.status is Status.PASSED
    assert finding.details["volume_mm3"] == pytest.approx(4 * sketch.area, rel=1e-2)
    assert finding.details["genus"] == len(sketch.loops) - 2 * len(sketch.faces) + 1


def test_a_mesh_with_a_hole_is_not_watertight(monkeypatch: pytest.MonkeyPatch) -> None:
    vertices, triangles = mesh.mesh(FRAME, 3.0)
    monkeypatch.setattr(machine, "extruded", lambda *_: (vertices, triangles[1:]))
    finding = found("watertight", FRAME)
    assert finding.status is Status.FAILED
    assert "is watertight" in finding.message


@pytest.mark.parametrize("engine", ["trimesh", "manifold3d"])
def test_a_missing_engine_is_not_a_pass(engine: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, engine, None)
    finding = found("watertight", FRAME)
    assert (finding.status, finding.message) == (Status.NOT_CHECKED, f"{engine} is not installed")
    assert check(FRAME, Limits(), ["watertight"]).passed  # and not a failure either


def test_bed() -> None:
    bar = part(box(0, 0, 100, 10))
    assert found("bed", bar, bed=(110.0, 20.0)).details["angle_deg"] == 0
    upright = found("bed", bar, bed=(12.0, 101.0))
    assert upright.status is Status.PASSED
    assert upright.details["angle_deg"] == pytest.approx(90, abs=3)
    diagonal = 110 / sqrt(2)  # at 45 degrees width and height are equal
    fits = found("bed", bar, bed=(diagonal + 0.01, diagonal + 0.01))
    assert fits.status is Status.PASSED
    assert fits.details["angle_deg"] % 90 == pytest.approx(45, abs=0.1)
    tight = found("bed", bar, bed=(diagonal - 0.01, diagonal - 0.01))
    assert tight.status is Status.FAILED
    assert tight.measured == pytest.approx(diagonal / (diagonal - 0.01), abs=1e-6)
    assert found("bed", part(disc(5)), bed=(9.99, 20.0)).status is Status.FAILED
    assert found("bed", part(disc(5)), bed=(10.0, 10.0)).status is Status.PASSED
    assert found("bed", bar).status is Status.NOT_CHECKED


def test_interference_and_clearance() -> None:
    plate, peg = part(box(0, 0, 20, 10), disc(3, 5, 5)), part(disc(2.5, 5, 5))
    finding = found("interference", plate, (peg,), thickness=2.0)
    assert (finding.status, finding.measured) == (Status.PASSED, 0)
    clear = found("clearance", plate, (peg,), min_gap=0.6)
    assert clear.status is Status.FAILED
    assert clear.measured == pytest.approx(0.5)
    assert found("clearance", plate, (peg,), min_gap=0.5).status is Status.PASSED
    thick = part(disc(4, 5, 5))
    finding = found("interference", plate, (thick,), thickness=2.0)
    assert finding.status is Status.FAILED
    assert finding.measured == pytest.approx(7 * pi)
    assert finding.details["volume_mm3"] == pytest.approx(14 * pi)
    assert found("clearance", plate, (thick,), min_gap=0.1).measured == 0
    beside = part(box(20.25, 0, 30, 10))
    assert found("clearance", plate, (peg, beside), min_gap=0.1).measured == pytest.approx(0.25)
    rounds = part(disc(1)), part(disc(2, 3, 4))  # along the line through the centres
    assert found("clearance", rounds[0], (rounds[1],), min_gap=0.1).measured == pytest.approx(2)
    assert found("clearance", plate).status is Status.NOT_CHECKED


def test_interference_agrees_with_manifold3d() -> None:
    manifold3d = import_module("manifold3d")
    a, b = (generate(np.random.default_rng(k), 20).scaled(30) for k in (1, 2))
    solids = [manifold3d.CrossSection(s.polygon(1e-5), manifold3d.FillRule.EvenOdd).extrude(3.0) for s in (a, b)]
    finding = found("interference", a, (b,))
    assert finding.details["volume_mm3"] == pytest.approx((solids[0] ^ solids[1]).volume(), rel=1e-5)


BOWTIE = Loop.polyline([(0, 0), (10, 10), (10, 0), (0, 10)])


@pytest.mark.parametrize(
    ("loops", "where"),
    [
        ([BOWTIE], [(5, 5)]),
        ([box(0, 0, 10, 10), box(5, 5, 15, 15)], [(5, 10), (10, 5)]),
        ([box(0, 0, 10, 10), disc(5, 5, 5)], [(0, 5), (5, 0), (5, 10), (10, 5)]),
        ([disc(5), disc(5, 10)], [(5, 0)]),
    ],
)
def test_self_intersection(loops: list[Loop], where: list[tuple[float, float]]) -> None:
    report = check_loops(loops, Limits(min_wall=1.0), ["minimum wall", "self-intersection"])
    finding = report["self-intersection"]
    assert finding.status is Status.FAILED
    assert sorted((round(p.x, 6), round(p.y, 6)) for p in finding.places) == where
    assert report["minimum wall"].status is Status.NOT_CHECKED
    assert not report.passed
    assert report.failed == (finding,)


def test_sound_loops_are_checked_in_full() -> None:
    report = check_loops(FRAME.loops, Limits(min_wall=1.0, min_gap=1.0))
    assert report.passed
    assert [finding.name for finding in report.findings] == list(CHECKS)
    assert report["self-intersection"].status is Status.PASSED
    with pytest.raises(KeyError):
        report["colour"]


def test_processes_name_checks_that_exist() -> None:
    for name, usual in PROCESSES.items():
        assert set(usual.checks) <= set(CHECKS)
        report = check(part(box(0, 0, 60, 40)), usual.limits, usual.checks)
        assert report.passed, name
    with pytest.raises(InputError, match="laser, cnc, fdm, got 'waterjet'"):
        process("waterjet")


@pytest.mark.parametrize(
    "wrong", [{"min_wall": 0.0}, {"kerf": -0.1}, {"tool_diameter": nan}, {"bed": (200.0, inf)}, {"bodies": 0}]
)
def test_limits_must_be_numbers(wrong: dict[str, Any]) -> None:
    with pytest.raises(InputError, match="must be a positive number"):
        Limits(**wrong)


def test_refuses_what_is_no_part() -> None:
    with pytest.raises(InputError, match="scale it first"):
        check(Sketch.from_loops([disc(1)]), Limits())
    with pytest.raises(InputError, match="expected checks among"):
        check(FRAME, Limits(), ["colour"])


def drawn(path: Path, report: Report) -> tuple[int, int]:
    write_picture(path, report)
    with Image.open(path) as image:
        return image.size


def test_picture(tmp_path: Path) -> None:
    report = check(FRAME, Limits(min_wall=2.5), ["minimum wall"])
    assert drawn(tmp_path / "failed.png", report)[0] == 990
    again = tmp_path / "again.png"
    write_picture(again, report)
    assert again.read_bytes() == (tmp_path / "failed.png").read_bytes()
    passing = check(FRAME, Limits(min_wall=0.5), ["minimum wall"])
    write_picture(again, passing)
    marked, clean = (np.array(Image.open(tmp_path / n).convert("RGB")) for n in ("failed.png", "again.png"))
    red = np.array([0xD1, 0x49, 0x5B])
    assert np.any(np.all(marked == red, axis=2))
    assert not np.any(np.all(clean == red, axis=2))
    drawn(tmp_path / "bowtie.png", check_loops([BOWTIE], Limits()))
    write_picture(tmp_path / "plan.svg", report)
    assert "<svg" in (tmp_path / "plan.svg").read_text()
    with pytest.raises(ExportError, match=r"\.png or \.svg"):
        write_picture(tmp_path / "plan.pdf", report)


def program_file(path: Path, *loops: Loop) -> str:
    """A program file whose outline these loops are."""
    neutral = [edge for loop in loops for edge in [Sketch.from_loops([loop], "mm").to_neutral()[0]]] if loops else []
    document = {
        "format": "d4cad-program", "version": 1, "grammar": "arc-line", "structure": [], "params": [],
        "canvas": {"width": 9, "height": 9, "pixel": 1.0, "ramp": 0.5}, "settings": {"placement": {"thickness": 4}},
        "history": [], "stop": "converged", "psnr": 99.0, "primitives": 4, "unit": "mm", "loops": neutral,
    }  # fmt: skip
    path.write_text(json.dumps(document))
    return str(path)


def d4cad(*args: str) -> Result:
    return CliRunner().invoke(app, list(args), env={"COLUMNS": "160"})


def test_command_exit_codes(tmp_path: Path) -> None:
    frame = program_file(tmp_path / "frame.json", *FRAME.loops)
    good = d4cad("check", frame, "--kerf", "0.1")
    assert good.exit_code == 0, good.output
    assert "the narrowest wall is 2.000 mm" in good.stdout
    bad = d4cad("check", frame, "--min-wall", "2.5", "--tool-diameter", "3", "--picture", str(tmp_path / "bad.png"))
    assert bad.exit_code == 1
    assert "a wall of 2.000 mm" in bad.stdout
    assert "inside corners" in bad.stdout
    assert (tmp_path / "bad.png").exists()
    assert d4cad("check", frame, "--min-wall", "2.5", "-q").stdout == ""


def test_command_json(tmp_path: Path) -> None:
    frame = program_file(tmp_path / "frame.json", *FRAME.loops)
    other = program_file(tmp_path / "other.json", box(29, 0, 40, 10))
    result = d4cad("check", frame, "--process", "fdm", "--with", other, "--bed", "220x220", "--json")
    assert result.exit_code == 1
    facts = json.loads(result.stdout)
    by_name = {finding["name"]: finding for finding in facts["findings"]}
    assert facts["passed"] is False
    assert by_name["watertight"]["details"]["volume_mm3"] == pytest.approx(4 * FRAME.area)
    assert by_name["interference"]["measured"] == pytest.approx(10)
    assert by_name["minimum wall"]["measured"] == pytest.approx(2)
    assert set(by_name["minimum wall"]["places"][0]) == {"x", "y", "value", "to"}


def test_command_needs_a_size(tmp_path: Path) -> None:
    """Program files in world units have one if their picture or placement states it."""
    picture = np.zeros((48, 48))
    picture[14:34, 9:39] = 1
    fit = fit_image(picture)
    path = tmp_path / "world.json"
    io.write(path, fit.document())
    refused = d4cad("check", str(path))
    assert refused.exit_code == 2
    assert "states no size" in refused.stderr
    for place in (Placement(width=60.0), Placement(scale=2.0)):
        io.write(path, fit.document(placement=place))
        facts = json.loads(d4cad("check", str(path), "--json").stdout)
        (wall,) = (f for f in facts["findings"] if f["name"] == "minimum wall")
        assert wall["measured"] == pytest.approx(40, abs=0.1)


def test_command_finds_loops_that_cross(tmp_path: Path) -> None:
    path = tmp_path / "bowtie.json"
    program_file(path, box(0, 0, 10, 10))
    document = json.loads(path.read_text())
    points = [list(p) for p in BOWTIE.points]
    document["loops"] = [
        [{"type": "line", "start": p, "end": q} for p, q in zip(points, points[1:] + points[:1], strict=True)]
    ]
    path.write_text(json.dumps(document))
    result = d4cad("check", str(path))
    assert result.exit_code == 1
    assert "first at (5.00, 5.00)" in result.stdout
    assert "not checked" in result.stdout


def test_command_refuses(tmp_path: Path) -> None:
    frame = program_file(tmp_path / "frame.json", *FRAME.loops)
    picture = str(tmp_path / "never.png")
    for args, sentence in (
        ([str(tmp_path / "absent.json")], "no program file"),
        ([program_file(tmp_path / "empty.json")], "it has no loops"),
        ([frame, "--process", "waterjet"], "process must be one of"),
        ([frame, "--bed", "220"], "--bed must be two numbers"),
        ([frame, "--kerf", "-1"], "limit kerf must be a positive number"),
        ([frame, "--thickness", "0"], "limit thickness must be a positive number"),
        ([frame, "--with", str(tmp_path / "absent.json")], "no program file"),
        ([frame, "--picture", str(tmp_path / "never.pdf")], ".png or .svg"),
    ):
        result = d4cad("check", *args, *([] if "--picture" in args else ["--picture", picture]))
        assert result.exit_code == 2, args
        assert sentence in result.stderr
        assert len(result.stderr.splitlines()) == 1
    assert not list(tmp_path.glob("never*"))
