"""Structural problems: how they become grids, how they are read and written, and what is refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from d4cad.beams.connection import require_carried, require_supported
from d4cad.beams.library import BRIDGE, CANTILEVER, L_BRACKET, MBB, MBB_HALF, PROBLEMS, find_problem
from d4cad.beams.problem import Load, Material, Place, Problem, Support
from d4cad.beams.reading import parse_problem, read_problem
from d4cad.beams.writing import toml_of
from d4cad.errors import InputError
from d4cad.sketch import Loop, Sketch

GOOD = """\
name = "hook"
volume = 0.4
thickness = 8

[domain]
size = [40, 20]
element = 2.0

[material]
young = 70e3
poisson = 0.33
yield = 250

[[support]]
from = [0, 0]
to = [0, 20]

[[support]]
at = [20, 0]
fix = "y"

[[load]]
from = [40, 8]
to = [40, 12]
force = [0, -200]

[[load]]
at = [20, 20]
force = [50, 0]
case = "wind"

[[cut]]
box = [30, 14, 40, 20]

[[void]]
circle = [10, 10, 3]

[[solid]]
circle = [10, 10, 5]
"""


def rectangle(x0: float, y0: float, x1: float, y1: float) -> Sketch:
    return Sketch.from_loops([Loop.polyline([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])], "mm")


def test_toml_is_what_it_says() -> None:
    problem = parse_problem(GOOD)
    assert problem.name == "hook"
    assert problem.size == (40, 20)
    assert problem.material == Material(70e3, 0.33, 250)
    assert problem.thickness == 8
    assert problem.supports == (Support(Place((0, 0), (0, 20))), Support(Place((20, 0), (20, 0)), "y"))
    assert problem.loads[1] == Load(Place((20, 20), (20, 20)), (50, 0), "wind")
    assert problem.cases == ("", "wind")
    assert problem.force == 250
    assert problem.voids == (Place((10, 10), (10, 10), 3),)
    assert parse_problem(GOOD, volume=0.25).volume == 0.25


def test_masks_and_volume() -> None:
    domain = parse_problem(GOOD).domain()
    assert domain.shape == (10, 20)
    assert domain.inside.sum() == 200 - 15
    assert domain.void.sum() == 4  # elements whose centre is within 3 mm of (10, 10)
    assert domain.solid.sum() == 16 - 4  # within 5 mm, the void excepted
    assert not (domain.solid & domain.void).any()
    assert domain.volume == pytest.approx(0.4 * 185)
    assert domain.mirrored == (False, False)


@pytest.mark.parametrize("refinement", [0.5, 1.0, 2.0])
def test_loads_are_shared_evenly(refinement: float) -> None:
    """The end nodes of a patch have half a share: forces and their moment do not depend on the grid."""
    domain = CANTILEVER.domain(refinement)
    grid, loads = domain.elastic.grid, domain.elastic.loads
    nodes = grid.nodes[-1]
    forces = loads[2 * nodes + 1, 0]
    assert loads.sum() == pytest.approx(-1)
    assert loads[2 * grid.nodes].sum() == 0
    loaded = np.flatnonzero(forces)
    assert loaded[0] / refinement == 28
    assert loaded[-1] / refinement == 32
    assert forces[loaded[0]] == forces[loaded[-1]] == pytest.approx(forces[loaded[1]] / 2)
    assert forces @ np.arange(nodes.size) / refinement == pytest.approx(-30)


def test_cases_are_columns_and_share_the_total_force() -> None:
    loads = parse_problem(GOOD).domain().elastic.loads
    assert loads.shape[1] == 2
    assert loads.sum(axis=0) == pytest.approx([-0.8, 0.2])


@pytest.mark.parametrize(
    ("problem", "mirrored"),
    [
        (CANTILEVER, (False, True)),
        (MBB, (True, False)),
        (MBB_HALF, (False, False)),
        (L_BRACKET, (False, False)),
        (BRIDGE, (True, False)),
    ],
)
def test_mirrors(problem: Problem, mirrored: tuple[bool, bool]) -> None:
    """A load across the mirror axis pulls on one half as it pushes on the other: the design is symmetric still."""
    assert problem.domain().mirrored == mirrored


def test_a_hole_breaks_the_mirror() -> None:
    hole = Place((30, 40), (30, 40), 5.0)
    assert replace(CANTILEVER, voids=(hole,)).domain().mirrored == (False, False)
    both = replace(CANTILEVER, voids=(hole, Place((30, 20), (30, 20), 5.0)))
    assert both.domain().mirrored == (False, True)


@given(
    st.floats(0.01, 0.99),
    st.floats(1, 1e6),
    st.floats(-0.9, 0.49),
    st.lists(st.tuples(st.floats(0, 100), st.floats(0, 100), st.floats(0.1, 9)), max_size=3),
    st.text("ab \"\\'é\n\x7f😀", max_size=6),
)
def test_written_problems_read_back(
    volume: float, young: float, poisson: float, circles: list[tuple[float, float, float]], name: str
) -> None:
    places = tuple(Place((x, y), (x, y), r) for x, y, r in circles)
    problem = replace(
        L_BRACKET, name=name, volume=volume, material=Material(young, poisson), voids=places, solids=places[:1]
    )
    assert parse_problem(toml_of(problem)) == problem


@pytest.mark.parametrize("problem", [*PROBLEMS.values(), parse_problem(GOOD)], ids=lambda problem: problem.name)
def test_the_library_can_be_written_and_is_supported(problem: Problem) -> None:
    assert parse_problem(toml_of(problem)) == problem
    require_supported(problem)


def test_deep_nesting_is_refused() -> None:
    with pytest.raises(InputError, match="it is nested too deeply"):
        parse_problem(f"name = {'[' * 20_000}{']' * 20_000}")


BAD = [
    ("young = 70e3", "young = -5", "line 10: Young's modulus must be a positive number of MPa, got -5"),
    ("poisson = 0.33", "poisson = 0.5", "line 11: Poisson's ratio must lie between -1 and 0.5, got 0.5"),
    ("poisson = 0.33", 'poisson = "steel"', "line 11: poisson must be a number, got 'steel'"),
    ("yield = 250", "yield = 0", "line 12: the yield strength must be a positive number of MPa, got 0"),
    ("volume = 0.4", "volume = 0", "line 2: the volume must be a share between 0 and 1 of the domain, got 0"),
    ("volume = 0.4", "volume = 1", "line 2: the volume must be a share between 0 and 1 of the domain, got 1"),
    ("volume = 0.4", "", "it states no volume, the share of the domain that may be material"),
    ("volume = 0.4", "volume = true", "line 2: volume must be a number, got True"),
    ("volume = 0.4", "volumes = 0.4", "line 2: unknown key 'volumes'"),
    ("thickness = 8", "thickness = -1", "line 3: the thickness must be a positive number of mm, got -1"),
    ("size = [40, 20]", "size = [40]", r"line 6: size must be 2 numbers, got \[40\]"),
    ("size = [40, 20]", "size = [40, -20]", "line 6: the domain's size must be two positive numbers of mm"),
    ("element = 2.0", "element = 11", "line 7: an element must be .* at most a quarter of the domain's shorter side"),
    ("element = 2.0", "elements = 2", "line 7: unknown key 'elements'"),
    ("[domain]", "[domian]", "line 5: unknown key 'domian'"),
    ("[[support]]\nfrom", "[[suport]]\nfrom", "line 14: unknown key 'suport'"),
    ('fix = "y"', 'fix = "z"', 'line 20: fix must be "x", "y" or "xy", got \'z\''),
    ("force = [50, 0]", "froce = [50, 0]", "line 29: unknown key 'froce'"),
    ("force = [50, 0]", "force = 50", "line 29: force must be 2 numbers, got 50"),
    ("at = [20, 20]", "from = [20, 20]", "line 27: a place is one of"),
    ("box = [30, 14, 40, 20]", "box = [30, 14, 20, 20]", "line 33: box must be"),
    ("circle = [10, 10, 3]", "circle = [10, 10, -3]", "line 36: the radius of a circle must be positive, got -3"),
    ("from = [0, 0]\nto = [0, 20]", "at = [-9, 0]", r"line 15: the support at \(-9, 0\) mm lies outside of the domain"),
    (
        "from = [40, 8]\nto = [40, 12]",
        "from = [48, 8]\nto = [48, 12]",
        "line 23: the load at .* lies outside of .* 40 x 20",
    ),
    ("circle = [10, 10, 5]", "circle = [10, 30, 5]", "line 39: the solid at the circle .* lies outside"),
    ("[material]", "[[material]]", r"line 9: material must be a table, written as \[material\]"),
    ("[[load]]\nfrom", "[load]\nfrom", "it is not TOML"),
    ("volume = 0.4", "volume = ", "it is not TOML: .*line 2"),
]


@pytest.mark.parametrize(("good", "bad", "message"), BAD, ids=[f"{bad!r}" for _, bad, _ in BAD])
def test_what_is_wrong_is_told_with_its_line(good: str, bad: str, message: str, tmp_path: Path) -> None:
    assert good in GOOD
    path = tmp_path / "hook.toml"
    path.write_text(GOOD.replace(good, bad, 1))
    with pytest.raises(InputError, match=message) as caught:
        read_problem(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def without(head: str) -> str:
    """The good text without the tables of that kind."""
    blocks = GOOD.split("\n\n")
    return "\n\n".join(block for block in blocks if not block.startswith(f"[[{head}]]"))


def test_a_volume_from_outside_has_no_line() -> None:
    with pytest.raises(InputError, match=r"^the volume must be a share"):
        parse_problem(GOOD, volume=2.0)


def test_problems_in_python_are_checked_too() -> None:
    with pytest.raises(InputError, match="must be finite"):
        replace(CANTILEVER, loads=(Load(Place((120, 30), (120, 30)), (0, float("nan"))),))
    with pytest.raises(InputError, match=r"the support at \(0, 0\) mm must fix"):
        replace(CANTILEVER, supports=(Support(Place((0, 0), (0, 0)), "xz"),))


def test_no_support_and_no_load() -> None:
    with pytest.raises(InputError, match="there is no support"):
        parse_problem(without("support"))
    with pytest.raises(InputError, match="there is no load"):
        parse_problem(without("load"))
    with pytest.raises(InputError, match=r"it has no \[domain\] table"):
        parse_problem("volume = 0.4")


PLACED = [
    ({"loads": (Load(Place((130, 0), (130, 5)), (0, -1.0)),)}, r"the load at the segment from \(130, 0\) .* outside"),
    ({"supports": (Support(Place((0, -9), (0, -9))),)}, r"the support at \(0, -9\) mm lies outside"),
    (
        {"loads": (Load(Place((110, 30), (110, 30)), (0, -1.0)),), "cuts": (Place((100, 20), (120, 40), box=True),)},
        r"the load at \(110, 30\) mm touches no material",
    ),
    (
        {"loads": (Load(Place((60, 30), (60, 30)), (0, -1.0)),), "voids": (Place((60, 30), (60, 30), 5.0),)},
        r"the load at \(60, 30\) mm touches no material",
    ),
    ({"supports": (Support(Place((0, 0), (0, 60)), "x"),)}, "move as a whole"),
    ({"solids": (Place((0, 0), (120, 40), box=True),)}, "the solid regions alone are 0.667 of the domain"),
    ({"voids": (Place((0, 0), (120, 27), box=True), Place((0, 33), (120, 60), box=True))}, "leave no room"),
    ({"element": 0.7}, "no whole number of elements"),
]


@pytest.mark.parametrize(("change", "message"), PLACED)
def test_places_that_cannot_be(change: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        replace(CANTILEVER, **change).domain()  # type: ignore[arg-type]


def test_a_domain_in_two_pieces_is_a_mechanism() -> None:
    gap = replace(CANTILEVER, cuts=(Place((60, 0), (64, 60), box=True),), volume=0.3)
    with pytest.raises(InputError, match=r"no support holds .* domain .* at the load at the segment from \(120, 28\)"):
        require_supported(gap)
    empty = replace(CANTILEVER, voids=(Place((60, 0), (64, 60), box=True),), volume=0.3)
    with pytest.raises(InputError, match="mechanism"):
        require_supported(empty)


def test_a_piece_on_rollers_is_a_mechanism() -> None:
    """The supports hold the whole, but not the piece that carries the load."""
    rollers = replace(
        CANTILEVER,
        supports=(Support(Place((0, 0), (0, 60))), Support(Place((70, 0), (120, 0)), "y")),
        cuts=(Place((60, 0), (64, 60), box=True),),
        volume=0.3,
    )
    with pytest.raises(InputError, match="mechanism"):
        require_supported(rollers)


def test_parts_must_carry_their_load() -> None:
    coarse = replace(CANTILEVER, element=4.0)
    require_carried(coarse, rectangle(0, 20, 120, 40))
    with pytest.raises(InputError, match="does not touch the part"):
        require_carried(coarse, rectangle(0, 0, 120, 20))
    with pytest.raises(InputError, match="no support holds the part"):
        require_carried(coarse, rectangle(10, 20, 120, 40))
    corner = Sketch((*rectangle(0, 0, 60, 30).faces, *rectangle(60, 30, 120, 60).faces), "mm")
    with pytest.raises(InputError, match="no support holds the part"):
        require_carried(coarse, corner)


def test_names_of_problems(tmp_path: Path) -> None:
    assert find_problem("mbb", 0.4) == replace(MBB, volume=0.4)
    with pytest.raises(InputError, match=r"no problem 'bracket': expected one of cantilever, .* or a .toml file"):
        find_problem("bracket")
    with pytest.raises(InputError, match="there is no problem file"):
        find_problem(str(tmp_path / "none.toml"))
    with pytest.raises(InputError, match="is a folder"):
        find_problem(str(tmp_path))
    (tmp_path / "picture.toml").write_bytes(b"\x89PNG\xff\xfe")
    with pytest.raises(InputError, match="it is not text"):
        find_problem(str(tmp_path / "picture.toml"))
