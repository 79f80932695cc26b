"""The Tree grammar from picture to part: fits, bounds, files, variants."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from d4cad.canvas import Canvas
from d4cad.cli import app
from d4cad.fit import Fit
from d4cad.fitting import fit_coverage
from d4cad.grammars.tree import Limits, Tree, bounds
from d4cad.grammars.tree.kinematics import poses_of
from d4cad.grammars.tree.leaves import DISC, LEAVES
from d4cad.grammars.tree.structure import Structure, program_of, table_of
from d4cad.methods import fast_tree, paper_tree
from d4cad.objectives.image import ImageLoss
from d4cad.program import Floats, Program
from d4cad.programs import load_program
from d4cad.protocols import Evaluation
from d4cad.registry import VARIANTS, make_grammar
from d4cad.steppers import ClippedGradient, LevenbergMarquardt

CANVAS = Canvas.square(64)


def slab(tilt: float = 0.3) -> Floats:
    """A tilted rectangle with a hole, as coverage."""
    rows, cols = np.mgrid[:64, :64] + 0.5
    x, y = CANVAS.to_world(np.stack([cols, rows], axis=2)).transpose(2, 0, 1)
    u, v = x * np.cos(tilt) + y * np.sin(tilt), y * np.cos(tilt) - x * np.sin(tilt)
    box = np.maximum(np.abs(u) - 0.5, np.abs(v) - 0.8)
    d = np.maximum(box, 0.2 - np.hypot(x, y)) / CANVAS.pixel
    return np.asarray(np.clip(0.5 - d / (2 * CANVAS.ramp), 0, 1))


@pytest.fixture(scope="module")
def fit() -> Fit:
    return fit_coverage(slab(), CANVAS, grammar="tree")


def test_a_shape_is_filled(fit: Fit) -> None:
    assert fit.psnr > 24
    assert fit.counted == "node"
    assert 40 < fit.primitives < 160
    assert fit.outline.area == pytest.approx(slab().sum() * CANVAS.pixel**2, rel=0.03)
    holes = [hole.reversed().area for face in fit.outline.faces for hole in face.holes]
    assert max(holes) == pytest.approx(np.pi * 0.04, rel=0.1)


def test_a_fit_keeps_to_the_grammar(fit: Fit) -> None:
    low, high = bounds(fit.program)
    assert (fit.program.params >= low).all()
    assert (fit.program.params <= high).all()
    assert fit.program.structure.children.max() <= 2
    assert fit.program.structure.root == (0.0, -1.5)


def test_equal_input_gives_equal_programs(fit: Fit) -> None:
    again = fit_coverage(slab(), CANVAS, grammar="tree", seed=7)  # `fast` draws no random number
    assert again.program.params.tolist() == fit.program.params.tolist()


def test_program_files_round_trip_and_go_on(fit: Fit, tmp_path: Path) -> None:
    fit.save(tmp_path / "tree.json")
    again = load_program(tmp_path / "tree.json")
    assert again.program.structure == fit.program.structure
    assert again.program.params.tolist() == fit.program.params.tolist()
    assert again.outline == fit.outline
    other = fit_coverage(slab(-0.2), CANVAS, grammar="tree", init=again, max_time=20)
    assert other.psnr > 22


def test_parts_are_valid_in_both_kernels(fit: Fit, tmp_path: Path) -> None:
    import_step = pytest.importorskip("build123d").import_step
    cadquery = pytest.importorskip("cadquery")
    fit.save(tmp_path / "tree.step", thickness=2, width=60)
    area = fit.sketch(width=60).area
    solid = import_step(tmp_path / "tree.step")
    assert solid.is_valid if isinstance(solid.is_valid, bool) else solid.is_valid()
    assert solid.volume == pytest.approx(2 * area, rel=1e-6)
    other = cadquery.importers.importStep(str(tmp_path / "tree.step")).val()
    assert other.isValid()
    assert other.Volume() == pytest.approx(2 * area, rel=1e-6)


def test_branches_make_it_one_part(fit: Fit) -> None:
    joined = Tree().outline(fit.program, branches=0.02)
    assert len(joined.faces) == 1
    assert joined.area > fit.outline.area
    assert joined.bounds[1] > -1.4  # no stalk from the root, which is at -1.5


def test_the_command_line_counts_nodes(fit: Fit, tmp_path: Path) -> None:
    fit.save(tmp_path / "tree.json")
    done = CliRunner().invoke(app, ["export", str(tmp_path / "tree.json"), "-o", str(tmp_path / "tree.svg")])
    assert done.exit_code == 0, done.output
    assert f"{fit.primitives} nodes (" in done.output
    assert (tmp_path / "tree.svg").is_file()


def test_the_paper_s_method_grows_a_tree() -> None:
    found = fit_coverage(slab(), CANVAS, grammar="tree", method="paper", seed=1, max_time=8)
    assert found.psnr > found.history[0].psnr + 3
    again = fit_coverage(slab(), CANVAS, grammar="tree", method="paper", variant="Tr-1", seed=1, max_time=8)
    sizes = table_of(again.program)[:, 2]
    assert sizes.tolist() == [0.075] * len(sizes)
    root = again.program.structure.root[1]
    assert slab()[int(CANVAS.to_pixels(np.array([0.0, root]))[1])].max() > 0.5


def test_variants_are_rewrites_and_settings() -> None:
    made = {
        name: make_grammar("tree", "paper", CANVAS, name)
        for name in VARIANTS
        if name.startswith("Tr-") and name != "Tr-disc"
    }
    assert list(made) == ["Tr-1", "Tr-2", "Tr-3", "Tr-4", "Tr-5", "Tr-F"]
    trees = [tree for tree in made.values() if isinstance(tree, Tree)]
    assert [len(tree.rules) for tree in trees] == [1, 2, 2, 4, 5, 5]
    assert [tree.sprout for tree in trees] == [0.2, 0.2, 0.03, 0.03, 0.03, 0.03]
    assert [tree.guarded for tree in trees] == [False, False, True, False, False, False]
    assert [tree.limits.sized for tree in trees] == [False] * 5 + [True]
    assert [tree.bottom for tree in trees] == ["shape"] * 5 + ["frame"]
    assert [tree.least for tree in trees] == [0.0] * 5 + [0.03]


def test_trees_of_discs(tmp_path: Path) -> None:
    found = fit_coverage(slab(), CANVAS, grammar="tree", variant="Tr-disc")
    assert found.psnr > 24
    found.save(tmp_path / "discs.json")
    again = load_program(tmp_path / "discs.json")
    assert again.program.structure.leaf == DISC
    assert again.outline == found.outline


def test_the_paper_s_settings() -> None:
    method = paper_tree(CANVAS)
    (stage,) = method.stages
    assert (stage.price, stage.patience, method.sample, method.recheck) == (1e-4, 10, 64, False)
    assert isinstance(method.stepper, ClippedGradient)
    assert (method.stepper.rate, method.stepper.least) == (0.5, 0.1)
    prices = [stage.price for stage in fast_tree(CANVAS, 1e3).stages]
    assert min(prices) == pytest.approx(1e3 / CANVAS.size)


@pytest.mark.parametrize("leaf", LEAVES)
def test_steps_with_bounds_find_a_leaf(leaf: str) -> None:
    """One branch whose best angle, length and size are beyond their limits, which the steps end at."""
    grammar, shape = Tree(), LEAVES[leaf]
    big = Limits(length=0.5, angle=1.0, size=0.4)
    want = program_of(Structure((-1, 0), (0.0, -0.6), big, shape), np.array([(0, 0, 0.0), (0.3, 0.4, 0.3)]))
    start = program_of(replace(want.structure, limits=Limits(0.25, 0.1, 0.2)), np.array([(0, 0, 0.0), (0.2, 0, 0.15)]))
    loss = ImageLoss.of(grammar.rasterize(want, CANVAS).coverage)
    stepper = LevenbergMarquardt(bounds=bounds)
    program, state = start, stepper.init(start)
    for _ in range(20):
        params, state = stepper.step(program, loss.evaluate(grammar.rasterize(program, CANVAS)), state)
        assert (params >= bounds(start)[0]).all()
        assert (params <= bounds(start)[1]).all()
        program = program.moved(params)
    params, value = stepper.best(program.params, loss.value(grammar.rasterize(program, CANVAS)), state)
    assert value < 0.8 * loss.value(grammar.rasterize(start, CANVAS))
    slope = loss.evaluate(grammar.rasterize(start.moved(params), CANVAS)).gradient
    low, high = bounds(start)
    assert params[2:] == pytest.approx([0.1, 0.2])
    assert ((np.abs(slope) < 1e-5) | ((params == low) & (slope > 0)) | ((params == high) & (slope < 0)))[1:].all()


def test_a_bounded_step_is_the_best_within_bounds() -> None:
    """A quadratic whose free minimum is outside: the step must not drag the other number along."""
    matrix = np.array([[2.0, 1.8], [1.8, 2.0]])
    goal = np.array([2.0, -1.0])

    def within(program: Program[tuple[()]]) -> tuple[Floats, Floats]:
        return np.array([-1.0, -5.0]), np.array([1.0, 5.0])

    stepper = LevenbergMarquardt(reach=10.0, bounds=within)
    program = Program((), np.array([0.0, 0.0]))
    state = stepper.init(program)
    for _ in range(8):
        off = program.params - goal
        params, state = stepper.step(
            program, Evaluation(float(off @ matrix @ off), 2 * matrix @ off, 2 * matrix), state
        )
        program = program.moved(params)
    assert program.params == pytest.approx([1.0, -1.0 + 0.9], abs=1e-3)


def test_clipped_steps_keep_to_the_bounds() -> None:
    program = program_of(Structure((-1, 0), (0.0, 0.0)), np.array([(0, 0, 0.05), (0.19, 0.0, 0.01)]))
    stepper = ClippedGradient(bounds=bounds)
    params, _ = stepper.step(program, Evaluation(1.0, np.array([1.0, -1.0, 1.0, 1.0])), stepper.init(program))
    assert params.tolist() == [0.0, 0.2, bounds(program)[0][2], 0.0]


def test_a_tree_goes_around_a_hole(fit: Fit) -> None:
    """No leaf of a size that shows stands in the hole or outside."""
    for x, y, _, r in poses_of(fit.program):
        if r > 0.04:
            assert abs(x) < 1.1
            assert abs(y) < 1.1
