"""Displacements and stresses against theory, narrow members, SIMP, and what a report says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from d4cad.beams.library import CANTILEVER
from d4cad.beams.occupancy import solid_elements
from d4cad.beams.problem import Load, Material, Place, Problem, Support
from d4cad.beams.simp import compared, simp, thresholded
from d4cad.beams.stress import Analysis, analysed, element_stress, minimum_member, peak_stress, von_mises
from d4cad.errors import InputError
from d4cad.objectives.fem import Grid
from d4cad.sketch import Circle, Loop, Sketch

# A sheet of aluminium pulled to the right: 60 x 60 x 2 mm, 1200 N.
SHEET = Problem(
    "sheet", (60, 60), 1.0, 0.9,
    supports=(Support(Place((0, 0), (0, 60)), "x"), Support(Place((0, 0), (0, 0)), "y")),
    loads=(Load(Place((60, 0), (60, 60)), (1200.0, 0)),),
    material=Material(70e3, 0.33, 250.0), thickness=2.0,
)  # fmt: skip


def box(x0: float, y0: float, x1: float, y1: float) -> Loop:
    return Loop.polyline([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])


def part(*loops: Loop) -> Sketch:
    return Sketch.from_loops(loops, "mm")


def test_elements_by_their_centres() -> None:
    found = solid_elements(part(box(1, 1, 3.4, 2.6)), Grid(4, 5), 1.0)
    assert np.argwhere(found).tolist() == [[1, 1], [1, 2], [2, 1], [2, 2]]
    assert not solid_elements(Sketch((), "mm"), Grid(4, 5), 1.0).any()


@given(st.floats(5, 25), st.floats(-5, 35), st.floats(-5, 25), st.floats(0.3, 0.8))
def test_elements_of_a_ring(radius: float, x: float, y: float, inner: float) -> None:
    """Also where the part reaches beyond the grid."""
    ring = part(Circle((x, y), radius).loop(), Circle((x, y), inner * radius).loop())
    found = solid_elements(ring, Grid(20, 30), 1.0)
    i, j = np.meshgrid(np.arange(30) + 0.5, np.arange(20) + 0.5)
    distance = np.hypot(i - x, j - y)
    clear = (np.abs(distance - radius) > 1e-9) & (np.abs(distance - inner * radius) > 1e-9)
    assert np.array_equal(found[clear], ((distance < radius) & (distance > inner * radius))[clear])


def test_tension_in_real_units() -> None:
    """10 MPa make 60 mm longer by 10 / 70e3 of that; the load's work counts that whole way."""
    found = analysed(SHEET, part(box(0, 0, 60, 60)), 1)
    assert found.von_mises == pytest.approx(10.0)
    stretch, shrink = 60 * 10 / 70e3, 0.33 * 60 * 10 / 70e3
    assert found.displacement[-1, 0] == pytest.approx(stretch)
    assert found.displacement.max() == pytest.approx(np.hypot(stretch, shrink))
    assert found.work == pytest.approx(1200 * stretch)
    assert found.compliance == pytest.approx(1.0)
    assert peak_stress(found)[0] == pytest.approx(10.0)


def test_stress_of_constant_strain() -> None:
    """Pure shear by 0.001: G times that, von Mises sqrt(3) times that."""
    corners = np.array([[0, 0], [2, 0], [2, 2], [0, 2.0]])
    moved = np.stack([0.001 * corners[:, 1], np.zeros(4)], axis=1).ravel()
    stress = element_stress(SHEET, moved[None, :, None], 2.0)
    shear = 70e3 / (2 * 1.33) * 0.001
    assert stress[0, :, 0] == pytest.approx([0, 0, shear], abs=1e-9)
    assert von_mises(stress)[0, 0] == pytest.approx(np.sqrt(3) * shear)


def test_hole_in_a_sheet_has_three_times_the_stress() -> None:
    """Kirsch 1898: at r beside a hole of radius a 1 + (a / r)^2 / 2 + 3 (a / r)^4 / 2 times that far away.

    Here r is that of the window's centre.
    """
    sheet = replace(SHEET, element=2.0)
    found = analysed(sheet, part(box(0, 0, 60, 60), Circle((30, 30), 4.0).loop()), 6)
    stress, (x, y) = peak_stress(found, 2)
    share = (4 / abs(y - 30)) ** 2
    assert stress == pytest.approx(10 * (1 + share / 2 + 1.5 * share**2), rel=0.06)
    assert x == pytest.approx(30, abs=1)
    assert abs(y - 30) == pytest.approx(4, abs=0.7)


def test_thickness_force_and_material_scale() -> None:
    whole = part(box(0, 0, 60, 60))
    base = analysed(replace(SHEET, element=6.0), whole, 1)
    thick = analysed(replace(SHEET, element=6.0, thickness=4.0), whole, 1)
    stiff = analysed(replace(SHEET, element=6.0, material=Material(140e3, 0.33)), whole, 1)
    strong = analysed(replace(SHEET, element=6.0, loads=(replace(SHEET.loads[0], force=(2400.0, 0)),)), whole, 1)
    for other, stress, move in ((thick, 0.5, 0.5), (stiff, 1, 0.5), (strong, 2, 2)):
        assert other.compliance == pytest.approx(base.compliance)
        assert other.von_mises == pytest.approx(stress * base.von_mises)
        assert other.displacement == pytest.approx(move * base.displacement)


def test_the_worst_of_the_load_cases_counts() -> None:
    pull, push = SHEET.loads[0], replace(SHEET.loads[0], force=(-600.0, 0), case="push")
    found = analysed(replace(SHEET, element=6.0, loads=(pull, push)), part(box(0, 0, 60, 60)), 1)
    assert found.von_mises == pytest.approx(10.0)
    assert found.work == pytest.approx((1200 * 10 + 600 * 5) * 60 / 70e3)


def test_a_loose_part_is_refused() -> None:
    with pytest.raises(InputError, match="do not hold"):
        analysed(SHEET, part(box(10, 0, 60, 60)), 1)


def members(*holes: Loop) -> float:
    solid = solid_elements(part(box(0, 0, 60, 40), *holes), Grid(160, 240), 0.25)
    return minimum_member(Analysis(solid, 0.25, 1.0, 1.0, np.zeros((241, 161)), np.zeros(solid.shape)))


@given(st.floats(1.0, 6.0), st.floats(7.0, 12.0))
def test_narrowest_member(narrow: float, wide: float) -> None:
    """Two holes with a web between them, the rest wider: the web's width within 1.5 fine elements."""
    left, right = box(wide, wide, 30 - narrow / 2, 40 - wide), box(30 + narrow / 2, wide, 60 - wide, 40 - wide)
    assert members(left, right) == pytest.approx(narrow, abs=0.375)


def test_members_of_solid_and_wedged_parts() -> None:
    assert members() == pytest.approx(40, abs=0.3)
    # a wedge's tip is no member, the wall of 2 mm beside the hole is
    solid = solid_elements(
        part(Loop.polyline([(0, 0), (60, 0), (0, 40)]), Circle((12, 14), 8).loop()), Grid(160, 240), 0.25
    )
    found = minimum_member(Analysis(solid, 0.25, 1.0, 1.0, np.zeros((241, 161)), np.zeros(solid.shape)))
    assert found == pytest.approx(4.0, abs=0.3)


def test_members_of_a_dumbbell() -> None:
    """No hole: shrinking takes the neck away and leaves two pieces."""
    bell = Loop.polyline([(2, 2), (20, 2), (20, 18), (40, 18), (40, 2), (58, 2), (58, 38), (40, 38), (40, 22), (20, 22),
                          (20, 38), (2, 38)])  # fmt: skip
    solid = solid_elements(part(bell), Grid(160, 240), 0.25)
    found = minimum_member(Analysis(solid, 0.25, 1.0, 1.0, np.zeros((241, 161)), np.zeros(solid.shape)))
    assert found == pytest.approx(4.0, abs=0.3)


def test_simp_is_a_stiff_symmetric_design() -> None:
    problem = replace(CANTILEVER, element=2.0, volume=0.4)
    domain = problem.domain()
    rival = compared(problem, iterations=40)
    run, design, fine = rival.run, rival.design, rival.fine
    assert design is not None
    assert fine is not None
    assert run.density.sum() == pytest.approx(domain.volume, rel=1e-3)
    assert run.density == pytest.approx(run.density[::-1], abs=1e-6)
    assert fine.volume == round(0.4 * 120 * 240)
    full = domain.elastic.solve(np.ones(domain.shape)).compliance
    even = domain.elastic.solve(np.full(domain.shape, 0.4**3)).compliance
    assert full < fine.compliance < run.model < even / 3
    assert design.compliance == pytest.approx(fine.compliance, rel=0.2)


def test_simp_keeps_fixed_regions() -> None:
    problem = replace(
        CANTILEVER, element=4.0, volume=0.5, solids=(Place((60, 30), (60, 30), 12.0),),
        voids=(Place((60, 30), (60, 30), 6.0),), cuts=(Place((80, 40), (120, 60), box=True),),
    )  # fmt: skip
    domain, fine = problem.domain(), problem.domain(4)
    run = simp(domain, iterations=5)
    assert np.all(run.density[domain.solid] == 1)
    assert np.all(run.density[domain.void | ~domain.inside] == 0)
    solid = thresholded(problem, run.density)
    assert np.all(solid[fine.solid])
    assert not np.any(solid[fine.void | ~fine.inside])
    assert solid.sum() == round(fine.volume)


def test_a_broken_rival_is_told() -> None:
    """After one iteration the density is nearly even: its level set is a scatter."""
    rival = compared(replace(CANTILEVER, element=4.0, volume=0.1), iterations=1)
    assert rival.fine is None
