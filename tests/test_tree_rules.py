"""The Tree grammar's rewrites: effect, guard, inverse, and how far they reach."""

from __future__ import annotations

from math import atan, cos, hypot, pi, sin, sqrt

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from d4cad.canvas import Canvas
from d4cad.grammars.tree import FACTS, Limits, Structure, Tree
from d4cad.grammars.tree.kinematics import poses_of
from d4cad.grammars.tree.places import DemandPlaces, UniformPlaces
from d4cad.grammars.tree.rules import Nodes, chain_lengths, chain_to, drop_small, joined, remove_branch
from d4cad.grammars.tree.structure import program_of, table_of
from d4cad.objectives.image import ImageLoss
from d4cad.program import Floats, Program, Rewrite

CANVAS = Canvas.square(96)
ANGLE = pi / 12
LIMITS = Limits()
NOTHING = np.zeros(CANVAS.shape)


def tree(
    parents: tuple[int, ...], rows: list[tuple[float, float, float]], limits: Limits = LIMITS
) -> Program[Structure]:
    return program_of(Structure(parents, (0.01, -0.3), limits), np.array([(0.0, 0.0, 0.05), *rows]))


@st.composite
def trees(draw: st.DrawFn, least: int = 1) -> Program[Structure]:
    rng = np.random.default_rng(draw(st.integers(0, 10**9)))
    count = draw(st.integers(least + 1, 25))
    parents, children = [-1], [0]
    for node in range(1, count):
        parents.append(int(rng.choice([p for p in range(node) if children[p] < 2])))
        children[parents[-1]] += 1
        children.append(0)
    rows = np.stack([rng.uniform(0, 0.2, count), rng.uniform(-ANGLE, ANGLE, count), rng.uniform(0, 0.075, count)], 1)
    return program_of(Structure(tuple(parents), (0.01, -0.3)), rows)


def offers(program: Program[Structure], grammar: Tree | None = None, seed: int = 0) -> list[Rewrite]:
    grammar = grammar or Tree(places=UniformPlaces())
    return grammar.rewrites(program, NOTHING, CANVAS, np.random.default_rng(seed))


def by_rule(program: Program[Structure], rule: str, grammar: Tree | None = None) -> list[Rewrite]:
    return [r for r in offers(program, grammar) if r.rule == rule]


def same(a: Program[Structure], b: Program[Structure]) -> bool:
    return a.structure == b.structure and np.allclose(a.params, b.params, atol=1e-12)


def coverage(program: Program[Structure]) -> Floats:
    return Tree().rasterize(program, CANVAS).coverage


def in_order(program: Program[Structure]) -> Program[Structure]:
    """The program numbered as edits number it."""
    return Tree().apply(program, []).program


# Each rewrite and its inverse


@settings(max_examples=25, deadline=None)
@given(trees(least=3))
def test_every_offer_grows_as_promised_and_keeps_to_the_limits(program: Program[Structure]) -> None:
    grammar = Tree()
    for rewrite in offers(program):
        assert rewrite.rule in FACTS
        edit = grammar.apply(program, [rewrite])
        assert grammar.complexity(edit.program) - grammar.complexity(program) == grammar.growth(program, rewrite)
        assert edit.origin.shape == edit.program.params.shape
        table = table_of(edit.program)
        assert table[:, 0].max() <= 0.2 + 1e-9
        assert np.abs(table[:, 1]).max() <= ANGLE + 1e-9
        assert edit.program.structure.children.max() <= 2


@settings(max_examples=25, deadline=None)
@given(trees(least=2))
def test_add_leaf_is_undone_by_remove_leaf(program: Program[Structure]) -> None:
    program = in_order(program)
    for rewrite in by_rule(program, "add-leaf"):
        grown = Tree().apply(program, [rewrite]).program
        undone = [Tree().apply(grown, [r]).program for r in by_rule(grown, "remove-leaf")]
        assert any(same(one, program) for one in undone)


@settings(max_examples=25, deadline=None)
@given(trees(least=2))
def test_split_is_undone_by_remove_branch(program: Program[Structure]) -> None:
    program = in_order(program)
    for rewrite in by_rule(program, "split"):
        grown = Tree().apply(program, [rewrite]).program
        undone = [Tree().apply(grown, [r]).program for r in by_rule(grown, "remove-branch")]
        assert any(same(one, program) for one in undone)


@settings(max_examples=30, deadline=None)
@given(trees(least=2))
def test_add_anywhere_is_undone_by_remove_leaf_again_and_again(program: Program[Structure]) -> None:
    program = in_order(program)
    for rewrite in by_rule(program, "add-anywhere")[:8]:
        grown = Tree().apply(program, [rewrite]).program
        for _ in range(int(rewrite.data[1])):
            fresh = np.flatnonzero(np.isin(table_of(grown)[:, 2], (Tree().tip, Tree().link)))
            ends = [r for r in by_rule(grown, "remove-leaf") if int(r.data[0]) in fresh]
            rows = [Tree().apply(grown, [r]).program for r in ends]
            grown = rows[0] if len(rows) == 1 else min(rows, key=lambda one: 0 if _within(program, one) else 1)
        assert same(grown, program)


def _within(small: Program[Structure], large: Program[Structure]) -> bool:
    """Whether every node of ``small`` stands in ``large``."""
    a, b = poses_of(small), poses_of(large)
    return all(np.isclose(b, one, atol=1e-12).all(axis=1).any() for one in a)


def test_the_facts_name_rules() -> None:
    program = tree((-1, 0, 1, 2, 3), [(0.05, 0.0, 0.05)] * 4)
    assert {r.rule for r in offers(program)} == set(FACTS)
    assert all(fact.inverse in FACTS for fact in FACTS.values())
    assert not any(fact.exact for fact in FACTS.values())  # a node always shows


# Where leaves are added


def test_leaves_are_added_on_both_sides_and_then_on_the_other_one() -> None:
    """The side of a second child is told by the first child's own angle, not by that of the node after it."""
    program = tree((-1, 0, 1, 0), [(0.1, 0.1, 0.05), (0.1, -0.1, 0.05), (0.1, -0.2, 0.05)])
    sides = {i: sorted(r.data[2] for r in by_rule(program, "add-leaf") if r.data[0] == i) for i in range(4)}
    assert sides == {0: [], 1: [ANGLE], 2: [-ANGLE, ANGLE], 3: [-ANGLE, ANGLE]}
    one = tree((-1, 0, 1, 2), [(0.1, 0.1, 0.05), (0.1, -0.1, 0.05), (0.1, 0.2, 0.05)])
    assert [r.data[2] for r in by_rule(one, "add-leaf") if r.data[0] == 0] == [-ANGLE]
    assert [r.data[1:] for r in by_rule(one, "add-leaf", Tree(sprout=0.2)) if r.data[0] == 1] == [(0.2, ANGLE, 0.075)]


def test_no_node_gets_a_third_child() -> None:
    program = tree((-1, 0, 0), [(0.1, 0.2, 0.05), (0.1, -0.2, 0.05)])
    assert all(int(r.data[0]) != 0 for r in offers(program) if r.rule.startswith("add"))
    forced = Rewrite("add-leaf", frozenset((0,)), (0.0, 0.1, 0.0, 0.05))
    assert same(Tree().apply(program, [forced]).program, in_order(program))


def test_split_cuts_at_epsilon_and_keeps_the_branch_straight() -> None:
    program = tree((-1, 0), [(0.12, 0.2, 0.03)])
    (rewrite,) = by_rule(program, "split")
    split = Tree().apply(program, [rewrite])
    assert table_of(split.program)[1:] == pytest.approx(np.array([(0.03, 0.2, 0.04), (0.09, 0.0, 0.03)]))
    np.testing.assert_allclose(poses_of(split.program)[2], poses_of(program)[1])
    assert split.origin.tolist() == [0, -1, -1, -1, 1, 2, 3]
    short = tree((-1, 0), [(0.01, 0.0, 0.03)])
    assert by_rule(short, "split")[0].data[1] == 0.99
    assert by_rule(tree((-1, 0), [(0.0, 0.0, 0.03)]), "split")[0].data[1] == 0.99


# Removal


def test_the_epsilon_guard_bites() -> None:
    """The paper's limit of ten times epsilon is longer than any branch."""
    program = tree((-1, 0, 1, 2, 2), [(0.1, 0.0, 0.05), (0.1, 0.0, 0.05), (0.02, 0.1, 0.05), (0.15, -0.1, 0.05)])
    assert {r.data[0] for r in by_rule(program, "remove-leaf", Tree(guarded=True))} == {3.0}
    assert {r.data[0] for r in by_rule(program, "remove-leaf")} == {3.0, 4.0}


def test_removals_together_leave_two_nodes() -> None:
    """The guard holds where a rewrite is applied, not only where it was offered."""
    program = tree((-1, 0, 0, 1, 1, 2, 2), [(0.1, 0.1 * k, 0.05) for k in (-1, 1, -2, 2, -2, 2)])
    together = [Rewrite("remove-leaf", frozenset((k,)), (float(k),)) for k in (3, 4, 5, 6, 1, 2)]
    assert len(Tree().apply(program, together).program.structure.parents) == 3
    few = tree((-1, 0, 1), [(0.1, 0.0, 0.05), (0.1, 0.0, 0.05)])
    assert not [r for r in offers(few) if r.rule.startswith("remove")]


@settings(max_examples=100, deadline=None)
@given(trees(least=4))
def test_remove_branch_leaves_all_other_nodes_in_place(program: Program[Structure]) -> None:
    """The grandchild's heading is the direction from its new parent; its children's do not change."""
    program = in_order(program)
    pose = poses_of(program)
    for rewrite in by_rule(program, "remove-branch"):
        node = int(rewrite.data[0])
        (after,) = np.flatnonzero(program.structure.parent == node)
        edit = Tree().apply(program, [rewrite])
        kept = np.delete(np.arange(len(pose)), node)
        np.testing.assert_allclose(poses_of(edit.program)[:, [0, 1, 3]], pose[kept][:, [0, 1, 3]], atol=1e-12)
        others = kept != after
        np.testing.assert_allclose(poses_of(edit.program)[others, 2], pose[kept][others, 2], atol=1e-12)
        before = pose[program.structure.parent[node]]
        dx, dy = pose[after, :2] - before[:2]
        here = np.flatnonzero(kept == after)[0]
        assert table_of(edit.program)[here, 0] == pytest.approx(hypot(dx, dy))
        assert edit.origin.tolist() == [k for k in range(program.params.size) if (k + 2) // 3 != node]


def test_remove_branch_has_the_right_angle() -> None:
    """The published formula lacks the removed branch's length and its own angle (SPEC 5.3)."""
    a, b, t, u = 0.06, 0.09, 0.1, 0.2
    program = tree((-1, 0, 1, 2), [(b, t, 0.05), (a, u, 0.05), (0.1, -0.1, 0.05)])
    nodes = Nodes.of(program)
    assert remove_branch(nodes, 1)
    length, angle, _ = nodes.row[2]
    assert length == pytest.approx(sqrt(a * a + b * b + 2 * a * b * cos(u)))
    assert angle == pytest.approx(t + np.arctan2(a * sin(u), b + a * cos(u)))
    assert abs(angle - atan(sin(u) / (cos(u) + a))) > 0.005
    assert nodes.row[3][1] == pytest.approx(-0.1 + t + u - angle)


def test_remove_branch_is_refused_at_a_limit() -> None:
    long = tree((-1, 0, 1, 2), [(0.11, 0.0, 0.05), (0.11, 0.0, 0.05), (0.1, 0.0, 0.05)])
    assert joined(Nodes.of(long), 1) is None
    bent = tree((-1, 0, 1), [(0.02, 0.25, 0.05), (0.1, 0.25, 0.05)])
    assert joined(Nodes.of(bent), 1) is None
    behind = tree((-1, 0, 1, 2), [(0.05, 0.0, 0.05), (0.05, 0.2, 0.05), (0.05, 0.2, 0.05)])
    assert joined(Nodes.of(behind), 1) is None  # the turn of the node after would be 0.3
    assert joined(Nodes.of(long), 3) is None  # it has no child
    assert not remove_branch(Nodes.of(long), 0)


def test_neighbours_cannot_both_be_removed_if_they_conflict() -> None:
    program = tree((-1, 0, 1, 2, 3), [(0.05, 0.0, 0.05)] * 4)
    sites = {int(r.data[0]): r.sites for r in by_rule(program, "remove-branch")}
    assert sites[1] & sites[2]
    assert not sites[1] & sites[3]
    both = [r for r in by_rule(program, "remove-branch") if int(r.data[0]) in (1, 3)]
    removed = Tree().apply(program, both).program
    np.testing.assert_allclose(poses_of(removed), poses_of(program)[[0, 2, 4]], atol=1e-12)


# Chains


@settings(max_examples=200, deadline=None)
@given(st.floats(-1.4, 1.4), st.floats(-1.4, 1.4), st.floats(-3, 3))
def test_a_chain_ends_at_its_point(x: float, y: float, heading: float) -> None:
    pose = np.array([[0.1, -0.2, heading, 0.05]])
    (estimate,) = chain_lengths(pose, (x, y), LIMITS).tolist()
    if not np.isfinite(estimate):
        bearing = np.arctan2(y + 0.2, x - 0.1) - heading
        assert cos(bearing) <= 1e-9
        return
    count, length, turn = chain_to(pose[0], (x, y), estimate, LIMITS)
    if count == 0:
        return
    assert count >= estimate - 1
    assert length <= 0.2 + 1e-12
    assert abs(turn) <= ANGLE + 1e-9
    px, py, a = 0.1, -0.2, heading
    for _ in range(count):
        a += turn
        px, py = px + length * cos(a), py + length * sin(a)
    assert (px, py) == pytest.approx((x, y), abs=1e-9)


def test_most_points_ahead_are_reached() -> None:
    rng = np.random.default_rng(3)
    pose = np.array([0.0, 0.0, pi / 2, 0.05])
    found = 0
    for bearing, far in rng.uniform((-1.2, 0.1), (1.2, 2.0), (100, 2)).tolist():
        point = (far * cos(pi / 2 + bearing), far * sin(pi / 2 + bearing))
        found += chain_to(pose, point, float(chain_lengths(pose[None], point, LIMITS)[0]), LIMITS)[0] > 0
    assert found > 90


def test_random_places_cover_the_whole_canvas() -> None:
    """The paper's points keep away from the border by a size limit that its fixed leaves do not need."""
    places = np.array(UniformPlaces()(NOTHING, CANVAS, LIMITS, 500, np.random.default_rng(0)))
    assert len(places) == 500
    assert np.abs(places[:, :2]).max() <= 1.5 - 0.075
    assert np.abs(places[:, :2]).max() > 1.3
    assert len(UniformPlaces()(NOTHING, CANVAS, LIMITS, 3, np.random.default_rng(0))) == 32


def test_places_of_demand_are_deep_and_apart() -> None:
    demand = np.zeros(CANVAS.shape)
    demand[20:50, 30:60] = 1
    demand[5:7, 5:7] = 1
    places = DemandPlaces()(demand, CANVAS, LIMITS, 5, np.random.default_rng(0))
    for x, y, size in places:
        col, row = CANVAS.to_pixels(np.array([x, y])).astype(int)
        assert demand[row, col] == 1
        assert 0 < size <= LIMITS.size
    assert len({(x, y) for x, y, _ in places}) == len(places) > 4
    assert DemandPlaces()(NOTHING, CANVAS, LIMITS, 5, np.random.default_rng(0)) == []


# Repair


def test_small_leaves_go_layer_by_layer_at_once() -> None:
    """The published repair takes only the outermost layer of them in a pass."""
    program = tree((-1, 0, 1, 2, 3, 1), [(0.1, 0.0, r) for r in (0.05, 0.01, 0.02, 0.01, 0.04)])
    repaired = Tree(least=0.03).repair(program)
    assert repaired.program.structure.parents == (-1, 0, 1)
    assert table_of(repaired.program)[:, 2].tolist() == [0.05, 0.05, 0.04]
    assert repaired.origin.tolist() == [0, 1, 2, 3, 13, 14, 15]
    again = Tree(least=0.03).repair(repaired.program)
    assert again.program is repaired.program


@settings(max_examples=50, deadline=None)
@given(trees())
def test_repair_leaves_no_small_leaf_and_changes_little(program: Program[Structure]) -> None:
    grammar = Tree(least=0.03)
    edit = grammar.repair(program)
    table, children = table_of(edit.program), edit.program.structure.children
    assert (table[1:, 2][children[1:] == 0] >= 0.03).all()
    assert grammar.repair(edit.program).program is edit.program
    area = 4 * 0.03**2 / CANVAS.pixel**2  # a leaf covers 3.9 r^2
    gone = len(program.structure.parents) - len(edit.program.structure.parents)
    assert (coverage(program) - coverage(edit.program)).sum() <= gone * (area + 8)
    assert not drop_small(Nodes.of(edit.program), 0.03)


# Jumps: how far a rewrite reaches


@settings(max_examples=12, deadline=None)
@given(trees(least=4))
def test_rewrites_change_the_picture_only_where_their_nodes_are(program: Program[Structure]) -> None:
    """What a new or a removed leaf covers, and for a removed branch also the turned leaf after it."""
    before = coverage(program)
    pixel = CANVAS.pixel
    for rewrite in offers(program):
        edit = Tree().apply(program, [rewrite])
        pose, old = poses_of(edit.program), poses_of(program)
        fresh = [one for one in pose if not np.isclose(old, one, atol=1e-9).all(axis=1).any()]
        gone = [one for one in old if not np.isclose(pose, one, atol=1e-9).all(axis=1).any()]
        assert len(fresh) + len(gone) <= (rewrite.data[1] if rewrite.rule == "add-anywhere" else 3)
        rows, cols = np.nonzero(np.abs(coverage(edit.program) - before) > 1e-9)
        points = CANVAS.to_world(np.stack([cols + 0.5, rows + 0.5], axis=1))
        near = np.zeros(len(points), bool)
        for x, y, _, r in fresh + gone:
            near |= np.hypot(points[:, 0] - x, points[:, 1] - y) <= 2.6 * r + 2 * pixel
        assert near.all()


def test_a_new_leaf_of_no_size_on_a_leaf_changes_nothing() -> None:
    program = tree((-1, 0), [(0.1, 0.0, 0.07)])
    for rule in ("add-leaf", "split"):
        data = (1.0, 0.02, 0.0, 0.0) if rule == "add-leaf" else (1.0, 0.99)
        new = Rewrite(rule, frozenset((1,)), data, np.array([0.99, 0.0]) if rule == "split" else None)
        after = Tree().apply(program, [new]).program
        assert len(after.structure.parents) == 3
        if rule == "add-leaf":
            assert np.abs(coverage(after) - coverage(program)).max() == 0


# Trials


@settings(max_examples=20, deadline=None)
@given(trees(least=3), st.integers(0, 10**6))
def test_trials_promise_what_happens(program: Program[Structure], seed: int) -> None:
    """Alone and before any further step, the program with the fitted rewrite has the promised loss."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:96, :96]
    target = (np.hypot(x - 48 - rng.normal(), y - 45) < 20).astype(float)
    grammar, loss = Tree(), ImageLoss.of(target)
    price = 1e-5
    demand = loss.demand(grammar.rasterize(program, CANVAS))
    rewrites = grammar.rewrites(program, demand, CANVAS, rng)
    base = loss.value(grammar.rasterize(program, CANVAS))
    for trial in grammar.local_trials(program, rewrites, loss, CANVAS, price, 4):
        after = grammar.apply(program, [trial.rewrite]).program
        gain = base - loss.value(grammar.rasterize(after, CANVAS)) - price * grammar.growth(program, trial.rewrite)
        assert trial.gain > 0
        if trial.rewrite.rule == "remove-branch":  # the leaf after it turns, which the trial leaves out
            assert gain == pytest.approx(trial.gain, abs=2e-2)
        else:
            assert gain == pytest.approx(trial.gain, abs=1e-9)
        table = table_of(after)
        assert table.min(axis=0)[0] >= 0
        assert table.max(axis=0)[2] <= 0.075 + 1e-12
