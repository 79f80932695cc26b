"""Leaves joined by branches into one part, and rectangles each by itself."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import ezdxf
import numpy as np
import pytest
from typer.testing import CliRunner

from d4cad.canvas import Canvas
from d4cad.cli import app
from d4cad.descent import Stop
from d4cad.errors import InputError
from d4cad.fit import Fit
from d4cad.grammars.tree import Limits, Structure, Tree
from d4cad.grammars.tree.outline import joining
from d4cad.grammars.union_rect import UnionRect
from d4cad.grammars.union_rect.structure import program_of
from d4cad.pieces import branched, drawn, require, separated
from d4cad.program import Program
from d4cad.programs import load_program
from d4cad.protocols import Grammar
from d4cad.sketch import Sketch

CANVAS = Canvas.square(64)


def fit_of(grammar: Grammar[Any], program: Program[Any]) -> Fit:
    """A fit as if a search had found the program."""
    return Fit(
        program=program, canvas=CANVAS, grammar=grammar, psnr=30.0, outline=grammar.outline(program), history=(),
        stop=Stop.STALLED, seconds=0.0, wall=0.0, settings={},
    )  # fmt: skip


def tree() -> Fit:
    """A bare stalk of 0.2, two leaves 0.4 apart above it, and a bare twig beside the upper one."""
    structure = Structure((-1, 0, 1, 2, 3), (0.0, -1.0), Limits(length=0.4))
    numbers = [0.0, 0.2, 0.0, 0.05, 0.2, 0.0, 0.0, 0.2, 0.0, 0.05, 0.1, 0.0, 0.0]
    return fit_of(Tree(), Program(structure, np.array(numbers)))


def rectangles() -> Fit:
    """Two rectangles, a cross of 2 by 2 with arms 0.4 wide."""
    return fit_of(UnionRect(), program_of(np.array([[0.0, 0.0, 1.0, 0.2, 0.0], [0.0, 0.0, 0.2, 1.0, 0.0]])))


def test_branches_join_the_leaves_and_nothing_else() -> None:
    fit = tree()
    assert len(fit.outline.faces) == 2
    joined = branched(fit, 2.0, fit.placement(scale=1.0))
    (face,) = joined.outline.faces
    assert not face.holes
    assert joining(fit.program.structure.parents, np.array([[0, 0, 0, r] for r in (0, 0.05, 0, 0.05, 0)])) == [2, 3]
    left, low, right, high = fit.outline.bounds  # no stalk, no twig: only half a round end below the lower leaf
    assert joined.outline.bounds == pytest.approx((left, low - CANVAS.pixel, right, high), abs=1e-9)
    # between the leaves there is a strip of the width, 2 px of 3 / 64
    assert joined.settings["branches"] == pytest.approx(2 * CANVAS.pixel)
    assert joined.outline.area - fit.outline.area == pytest.approx(0.4 * 2 * CANVAS.pixel, rel=0.35)


def test_the_width_is_that_of_the_part_as_it_is_placed() -> None:
    fit = tree()
    placement = fit.placement(width=20.0)
    joined = branched(fit, "2mm", placement)
    assert joined.settings["branches"] * placement.factor(joined.outline, CANVAS) == pytest.approx(2.0, rel=1e-9)
    assert branched(fit, "3px", placement).settings["branches"] == pytest.approx(3 * CANVAS.pixel)


def test_a_program_file_keeps_its_branches(tmp_path: Path) -> None:
    fit = tree()
    joined = branched(fit, 2.0, fit.placement(scale=1.0))
    joined.save(tmp_path / "tree.json", scale=1.0)
    again = load_program(tmp_path / "tree.json")
    assert again.outline.loops == joined.outline.loops
    (tmp_path / "bad.json").write_text((tmp_path / "tree.json").read_text().replace('"branches": 0', '"branches": -7'))
    with pytest.raises(InputError, match=r"its branches have a width of -7\.\d+, expected a number of world units"):
        load_program(tmp_path / "bad.json")


def test_rectangles_are_loops_and_bodies_of_their_own(tmp_path: Path) -> None:
    fit = separated(rectangles())
    fit.save(tmp_path / "cross.dxf", scale=1.0)
    drawing = ezdxf.readfile(tmp_path / "cross.dxf")
    assert len(list(drawing.modelspace())) == 2
    fit.save(tmp_path / "cross.svg", scale=1.0)
    assert (tmp_path / "cross.svg").read_text().count('class="face"') == 2
    fit.save(tmp_path / "cross.stl", scale=1.0)  # a mesh is the union all the same
    rectangles().save(tmp_path / "plain.stl", scale=1.0)
    assert (tmp_path / "cross.stl").read_bytes()[80:] == (tmp_path / "plain.stl").read_bytes()[80:]
    fit.save(tmp_path / "cross.json", scale=1.0)
    assert len(load_program(tmp_path / "cross.json").outline.faces) == 1


@pytest.mark.kernel
def test_step_holds_both_bodies(tmp_path: Path) -> None:
    from OCP.STEPControl import STEPControl_Reader

    from d4cad.exporters import occ

    separated(rectangles()).save(tmp_path / "cross.step", scale=1.0, thickness=2.0)
    reader = STEPControl_Reader()
    reader.ReadFile(str(tmp_path / "cross.step"))
    reader.TransferRoots()
    bodies = occ.explored(reader.OneShape(), "SOLID")
    assert len(bodies) == 2
    side = 2.0 / CANVAS.pixel
    assert [occ.volume(body) for body in bodies] == pytest.approx([2.0 * side * side / 5] * 2, rel=1e-9)
    assert all(occ.is_valid(body) for body in bodies)


def test_what_cannot_be_had_is_one_sentence() -> None:
    with pytest.raises(InputError, match="only the leaves of a tree have branches, and the grammar is arc-line"):
        require("arc-line", "2mm", separate=False, outputs=[])
    with pytest.raises(InputError, match="the width of the branches must be a positive length"):
        require("tree", "-2mm", separate=False, outputs=[])
    with pytest.raises(InputError, match="only the rectangles of union-rect can be separate, and the grammar is tree"):
        require("tree", None, separate=True, outputs=[])
    with pytest.raises(InputError, match=r"no output takes separate rectangles, only \.step"):
        require("union-rect", None, separate=True, outputs=[Path("a.stl")])
    with pytest.raises(InputError, match="only the leaves of a tree"):
        drawn(rectangles(), rectangles().placement(), "2mm", separate=False)
    with pytest.raises(InputError, match="is not a union of rectangles"):
        separated(tree())


def test_the_commands_take_both(tmp_path: Path) -> None:
    tree().save(tmp_path / "tree.json", scale=1.0)
    rectangles().save(tmp_path / "cross.json", scale=1.0)
    run = CliRunner().invoke
    done = run(app, ["export", str(tmp_path / "tree.json"), "--branches", "2px", "-o", str(tmp_path / "a.svg"), "-q"])
    assert done.exit_code == 0, done.output
    assert (tmp_path / "a.svg").read_text().count('class="face"') == 1
    done = run(app, ["export", str(tmp_path / "cross.json"), "--separate", "-o", str(tmp_path / "b.svg"), "-q"])
    assert done.exit_code == 0, done.output
    assert (tmp_path / "b.svg").read_text().count('class="face"') == 2
    kerf = ["export", str(tmp_path / "cross.json"), "--separate", "--kerf", "0.1", "-o", str(tmp_path / "c.dxf")]
    done = run(app, kerf)
    assert done.exit_code == 2
    assert "separate rectangles take no kerf" in done.output
    done = run(app, ["fit", "nothing.png", "--branches", "2mm", "-o", str(tmp_path / "d.svg")])
    assert done.exit_code == 2
    assert "only the leaves of a tree have branches" in done.output
    assert isinstance(load_program(tmp_path / "tree.json").outline, Sketch)
