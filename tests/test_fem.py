"""Plane stress on a grid against what is known exactly."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from d4cad.errors import InputError
from d4cad.objectives.fem import Bools, Grid, PlaneStress, element_stiffness
from d4cad.objectives.solid import grown, solve_solid
from d4cad.program import Floats

NU = 0.3


def places(grid: Grid) -> tuple[Floats, Floats]:
    """Coordinates (dofs / 2,) of the nodes by their numbers."""
    i, j = np.meshgrid(np.arange(grid.width + 1.0), np.arange(grid.height + 1.0), indexing="ij")
    x, y = np.empty(grid.size // 2), np.empty(grid.size // 2)
    x[grid.nodes.ravel()], y[grid.nodes.ravel()] = i.ravel(), j.ravel()
    return x, y


def edge_load(grid: Grid, column: int, way: int, total: float) -> Floats:
    """A load spread over a column of nodes, consistent with an even traction."""
    loads = np.zeros((grid.size, 1))
    nodes = grid.nodes[column]
    loads[2 * nodes + way, 0] = total / grid.height
    loads[2 * nodes[[0, -1]] + way, 0] /= 2
    return loads


def clamped(grid: Grid) -> Bools:
    fixed = np.zeros(grid.size, dtype=np.bool_)
    fixed[2 * grid.nodes[0]] = fixed[2 * grid.nodes[0] + 1] = True
    return fixed


def roller(grid: Grid) -> Bools:
    """The left side cannot move in x, its lowest node neither in y."""
    fixed = np.zeros(grid.size, dtype=np.bool_)
    fixed[2 * grid.nodes[0]] = True
    fixed[2 * grid.nodes[0, 0] + 1] = True
    return fixed


@given(st.floats(-0.9, 0.49))
def test_element_feels_no_rigid_motion(nu: float) -> None:
    stiffness = element_stiffness(nu)
    x, y = np.array([0, 1, 1, 0.0]), np.array([0, 0, 1, 1.0])
    for u, v in ((np.ones(4), np.zeros(4)), (np.zeros(4), np.ones(4)), (-y, x)):
        assert np.abs(stiffness @ np.stack([u, v], axis=1).ravel()).max() < 1e-12 / (1 - nu * nu)
    assert np.array_equal(stiffness, stiffness.T)
    assert np.sum(np.linalg.eigvalsh(stiffness) > 1e-9) == 5


@pytest.mark.parametrize("nu", [0.5, 0.7, -1.0, float("nan")])
def test_no_material_has_such_a_poisson_ratio(nu: float) -> None:
    with pytest.raises(InputError, match=r"between -1 and 0\.5"):
        element_stiffness(nu)


@pytest.mark.parametrize("shape", [(3, 5), (5, 3), (4, 4)])
def test_patch(shape: tuple[int, int]) -> None:
    """A linear displacement on the border is the solution inside, for any constant strain."""
    grid = Grid(*shape)
    x, y = places(grid)
    u, v = 0.1 + 0.02 * x - 0.03 * y, -0.2 + 0.05 * x + 0.07 * y
    exact = np.stack([u, v], axis=1).ravel()
    elastic = PlaneStress.of(grid, roller(grid), edge_load(grid, -1, 0, 1.0), NU)
    force = np.zeros(grid.size)
    np.add.at(force, elastic.dofs, exact[elastic.dofs] @ elastic.stiffness)
    inner = (x > 0) & (x < grid.width) & (y > 0) & (y < grid.height)
    assert np.abs(force.reshape(-1, 2)[inner]).max() < 1e-14
    # uniform stress times the traction's arm: x forces on the right side as of sigma = C : epsilon
    sigma = (0.02 + NU * 0.07) / (1 - NU * NU)
    assert force[2 * grid.nodes[-1]].sum() == pytest.approx(sigma * grid.height)


@pytest.mark.parametrize("shape", [(4, 10), (10, 4)])
def test_bar_in_tension(shape: tuple[int, int]) -> None:
    """sigma = F / A, elongation F L / (E A) and contraction nu times that, exactly, on any grid."""
    grid = Grid(*shape)
    young = np.full(shape, 2.5)
    response = PlaneStress.of(grid, roller(grid), edge_load(grid, -1, 0, 3.0), NU).solve(young)
    stretch = 3.0 * grid.width / (2.5 * grid.height)
    u = response.displacement[:, 0]
    assert u[2 * grid.nodes[-1]] == pytest.approx(stretch)
    assert u[2 * grid.nodes[:, -1] + 1] == pytest.approx(-NU * 3.0 / 2.5)
    assert response.compliance == pytest.approx(3.0 * stretch)
    assert response.energy * young == pytest.approx(response.compliance / young.size)


def test_cantilever_converges_to_beam_theory() -> None:
    """Timoshenko: F L^3 / (3 E I) + 6 F L / (5 G A), for a beam of 10 x 1 and F = 1."""
    length, depth, shear = 10.0, 1.0, 1 / (2 * (1 + NU))
    theory = length**3 / (3 * depth**3 / 12) + 6 * length / (5 * shear * depth)
    errors = []
    for n in (2, 4, 8):
        grid = Grid(n, 10 * n)
        elastic = PlaneStress.of(grid, clamped(grid), edge_load(grid, -1, 1, 1.0), NU)
        errors.append(abs(elastic.solve(np.ones((n, 10 * n))).compliance / theory - 1))
    assert errors[0] > errors[1] > errors[2]
    assert errors[2] < 0.015


@given(st.integers(0, 2**32 - 1))
def test_numbering_does_not_matter(seed: int) -> None:
    """A tall grid is the transposed problem of a wide one."""
    rng = np.random.default_rng(seed)
    young = rng.uniform(0.1, 1.0, (3, 6))
    wide, tall = Grid(3, 6), Grid(6, 3)
    lying = PlaneStress.of(wide, clamped(wide), edge_load(wide, -1, 1, 1.0), NU)
    fixed, loads = np.zeros(tall.size, dtype=np.bool_), np.zeros((tall.size, 1))
    for way in (0, 1):
        fixed[2 * tall.nodes + way] = lying.fixed[2 * wide.nodes.T + 1 - way]
        loads[2 * tall.nodes + way] = lying.loads[2 * wide.nodes.T + 1 - way]
    standing = PlaneStress.of(tall, fixed, loads, NU)
    a, b = lying.solve(young), standing.solve(np.ascontiguousarray(young.T))
    assert a.compliance == pytest.approx(b.compliance, rel=1e-10)
    assert pytest.approx(b.energy, rel=1e-8) == a.energy.T


@given(st.integers(0, 2**32 - 1))
def test_energies_sum_to_compliance_and_are_its_derivative(seed: int) -> None:
    rng = np.random.default_rng(seed)
    grid = Grid(4, 5)
    young = rng.uniform(0.2, 1.0, (4, 5))
    loads = np.concatenate([edge_load(grid, -1, 1, 1.0), edge_load(grid, 3, 0, -0.5)], axis=1)
    elastic = PlaneStress.of(grid, clamped(grid), loads, NU)
    response = elastic.solve(young)
    assert np.sum(young * response.energy) == pytest.approx(response.compliance)
    way = rng.normal(size=young.shape)
    there, back = (elastic.solve(young + sign * 1e-5 * way).compliance for sign in (1, -1))
    assert (there - back) / 2e-5 == pytest.approx(-np.sum(way * response.energy), rel=1e-6, abs=1e-6)


def test_load_cases_add_up() -> None:
    grid = Grid(4, 6)
    first, second = edge_load(grid, -1, 1, 1.0), edge_load(grid, 4, 1, 2.0)
    young = np.ones((4, 6))

    def compliance(loads: Floats) -> float:
        return PlaneStress.of(grid, clamped(grid), loads, NU).solve(young).compliance

    both = compliance(np.concatenate([first, second], axis=1))
    assert both == pytest.approx(compliance(first) + compliance(second))
    assert compliance(first + second) != pytest.approx(both, rel=1e-3)


@pytest.mark.parametrize("ways", [(), (0,), (1,)])
def test_supports_that_let_go_are_refused(ways: tuple[int, ...]) -> None:
    grid = Grid(3, 3)
    fixed = np.zeros(grid.size, dtype=np.bool_)
    for way in ways:
        fixed[2 * grid.nodes[0] + way] = True
    with pytest.raises(InputError, match="move as a whole"):
        PlaneStress.of(grid, fixed, edge_load(grid, -1, 1, 1.0), NU)


def test_one_node_does_not_hold_against_turning() -> None:
    grid = Grid(3, 3)
    fixed = np.zeros(grid.size, dtype=np.bool_)
    fixed[[2 * grid.nodes[0, 0], 2 * grid.nodes[0, 0] + 1]] = True
    with pytest.raises(InputError, match="against turning"):
        PlaneStress.of(grid, fixed, edge_load(grid, -1, 1, 1.0), NU)


def test_loads_that_do_nothing_are_refused() -> None:
    grid = Grid(3, 3)
    with pytest.raises(InputError, match="no load"):
        PlaneStress.of(grid, clamped(grid), np.zeros((grid.size, 1)), NU)
    with pytest.raises(InputError, match="on a support"):
        PlaneStress.of(grid, clamped(grid), edge_load(grid, 0, 1, 1.0), NU)


def test_stiffness_of_nothing_is_a_mechanism() -> None:
    grid = Grid(3, 3)
    elastic = PlaneStress.of(grid, clamped(grid), edge_load(grid, -1, 1, 1.0), NU)
    with pytest.raises(InputError, match="mechanism"):
        elastic.solve(np.zeros((3, 3)))


def test_solid_part_is_the_whole_grid_with_weak_elements() -> None:
    """A frame with a loose block inside: the block carries nothing."""
    solid = np.ones((12, 20), dtype=np.bool_)
    solid[3:9, 3:17] = False
    solid[5:7, 8:12] = True
    grid = Grid(12, 20)
    elastic = PlaneStress.of(grid, clamped(grid), edge_load(grid, -1, 1, 1.0), NU)
    whole = elastic.solve(np.where(solid, 1.0, 1e-9))
    part = solve_solid(elastic, solid)
    assert part.compliance == pytest.approx(whole.compliance, rel=1e-6)
    carrying = solid & (whole.energy > 1e-6)
    assert part.energy[carrying] == pytest.approx(whole.energy[carrying], rel=1e-5)
    assert np.abs(part.energy[5:7, 8:12]).max() < 1e-9
    assert grown(solid).sum() > solid.sum()


def test_corner_contact_is_no_singular_matrix() -> None:
    """Two blocks that meet in one node: a hinge, held from turning by the weak elements only."""
    solid = np.zeros((4, 8), dtype=np.bool_)
    solid[:2, :4] = solid[2:, 4:] = True
    grid = Grid(4, 8)
    loads = np.zeros((grid.size, 1))
    loads[2 * grid.nodes[-1, 3] + 1] = -1.0
    response = solve_solid(PlaneStress.of(grid, clamped(grid), loads, NU), solid)
    assert response.compliance > 1e6


def test_loaded_piece_without_support_is_refused() -> None:
    solid = np.ones((6, 12), dtype=np.bool_)
    solid[:, 4:8] = False
    grid = Grid(6, 12)
    with pytest.raises(InputError, match="do not hold"):
        solve_solid(PlaneStress.of(grid, clamped(grid), edge_load(grid, -1, 1, 1.0), NU), solid)
