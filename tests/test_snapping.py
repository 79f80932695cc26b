"""Regularisation of fits by their pictures: what holds becomes exact, what does not stays, and files keep it."""

from __future__ import annotations

from functools import cache
from math import pi, radians, tan
from pathlib import Path

import numpy as np
import pytest

from d4cad import io
from d4cad.bench import coverage
from d4cad.canvas import Canvas
from d4cad.descent import Stop
from d4cad.errors import InputError
from d4cad.fit import Fit
from d4cad.fitting import fit_coverage, fit_image, regularised
from d4cad.placement import Placement
from d4cad.program import Floats
from d4cad.programs import load_program
from d4cad.regularize import Parameters
from d4cad.regularize.equations import equations
from d4cad.regularize.measures import Measures
from d4cad.relations import Relation
from d4cad.shapes import generate
from d4cad.sketch import Circle, Loop, Sketch


def residual(sketch: Sketch, relation: Relation) -> float:
    layout = Parameters(sketch)
    return float(np.abs(equations(relation, layout, Measures.of(layout, layout.values)).residual).max(initial=0.0))


def counts(fit: Fit) -> dict[str, int]:
    return {kind: sum(r.kind == kind for r in fit.relations) for kind in {r.kind for r in fit.relations}}


def plate() -> Sketch:
    """60 x 40 pixels at 96 x 96, two corners rounded by 8, a hole of radius 9."""
    bulge = tan(pi / 8)
    corners = ((-30, -20), (30, -20), (30, 12), (22, 20), (-22, 20), (-30, 12))
    outer = Loop(corners, (0.0, 0.0, bulge, 0.0, bulge, 0.0))
    return Sketch.from_loops([outer, Circle((0, -1), 9).loop()]).scaled(3 / 96, "world")


def grey(sketch: Sketch, pixels: int, noise: float = 0.0) -> np.ndarray[tuple[int, ...], np.dtype[np.uint8]]:
    """Area coverage in 8 bits, row 0 on top."""
    fine = coverage(sketch, Canvas.square(8 * pixels, 0.5)).reshape(pixels, 8, pixels, 8).mean(axis=(1, 3))
    shades = 0.1 + 0.8 * fine + noise * np.random.default_rng(0).standard_normal(fine.shape)
    return np.asarray((255 * np.clip(shades, 0, 1))[::-1].round(), dtype=np.uint8)


@cache
def fitted() -> Fit:
    return fit_image(grey(plate(), 96), size=Placement(width=60.0))


def test_a_plate_is_given_back_as_drawn() -> None:
    fit = fitted()
    kinds = counts(fit)
    assert kinds["horizontal"] == 2
    assert kinds["vertical"] == 2
    assert kinds["tangent"] == 4
    assert all(residual(fit.outline, relation) < 1e-9 for relation in fit.relations)
    sizes = {d.name: d.value for d in fit.sketch(width=60).dimensions}
    assert sizes["width"] == pytest.approx(60, abs=1e-9)
    assert sizes["height"] == pytest.approx(40, abs=1e-9)
    assert sizes["hole_diameter"] == pytest.approx(18, abs=0.03)
    assert sizes["corner_radius"] == pytest.approx(8, abs=0.1)


def test_the_program_draws_the_outline() -> None:
    fit = fitted()
    assert fit.grammar.outline(fit.program).loops == fit.outline.loops
    assert fit.snap is not None
    assert fit.snap.moved < 0.3 * fit.canvas.pixel
    assert fit.snap.freed > 10
    assert fit.snap.after <= fit.snap.before * 1.3


def test_a_file_keeps_relations_in_its_unit(tmp_path: Path) -> None:
    fit = fitted()
    fit.save(tmp_path / "part.json", width=60)
    file = io.read(tmp_path / "part.json")
    (hole,) = [d for d in file.dimensions if d.name == "hole_diameter"]
    assert hole.value == pytest.approx(18, abs=0.03)
    back = load_program(tmp_path / "part.json")
    assert back.outline.loops == fit.outline.loops
    assert [(r.kind, r.refs) for r in back.relations] == [(r.kind, r.refs) for r in fit.relations]
    (again,) = [d for d in back.sketch().dimensions if d.name == "hole_diameter"]
    assert again.value == pytest.approx(hole.value, abs=1e-12)
    with pytest.raises(InputError, match="no picture"):
        regularised(back)


def test_without_snapping_nothing_is_told() -> None:
    fit = fit_image(grey(plate(), 96), snap=False)
    assert fit.relations == ()
    assert fit.outline.dimensions == ()
    assert fit.snap is None


def test_the_published_method_is_left_as_it_is() -> None:
    canvas = Canvas.square(32)
    square = Sketch.from_loops([Loop.polyline([(-0.8, -0.8), (0.8, -0.8), (0.8, 0.8), (-0.8, 0.8)])])
    assert fit_coverage(coverage(square, canvas), canvas, method="paper", max_time=0.5).snap is None


def test_ctrl_c_keeps_what_was_fitted(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("d4cad.fitting.snapped", interrupted)
    fit = fit_image(grey(plate(), 96))
    assert fit.stop is Stop.INTERRUPTED
    assert fit.psnr > 40
    assert fit.relations == ()


@pytest.mark.parametrize("seed", range(4))
def test_exact_pictures_stay_exact(seed: int) -> None:
    canvas = Canvas.square(256)
    target: Floats = coverage(generate(np.random.default_rng(seed), 10), canvas)
    plain, fit = (fit_coverage(target, canvas, snap=snap) for snap in (False, True))
    assert fit.relations
    assert fit.psnr >= min(plain.psnr, 120)
    assert fit.primitives == plain.primitives


def test_what_is_nearly_so_is_not_made_so() -> None:
    """A side one degree off level, and holes that differ by two per cent, at 256 pixels."""
    lift = 1.9 * tan(radians(1.0))
    outer = Loop.polyline([(-0.95, -0.7), (0.95, -0.7 + lift), (1.0, 0.75), (-0.8, 0.6)])
    holes = [Circle((-0.4, 0.05), 0.3).loop(), Circle((0.45, 0.1), 0.306).loop()]
    fit = fit_image(grey(Sketch.from_loops([outer, *holes]), 256))
    assert fit.primitives == 8
    assert not {"horizontal", "parallel", "equal_radius", "symmetric"} & set(counts(fit))


def test_a_noisy_picture_gets_its_right_angles() -> None:
    truth = Sketch.from_loops([Loop.polyline([(-0.93, -0.61), (0.87, -0.61), (0.87, 0.57), (-0.93, 0.57)])])
    picture = grey(truth, 64, noise=0.08)
    plain, fit = (fit_image(picture, snap=snap) for snap in (False, True))
    assert counts(fit)["horizontal"] == 2
    assert counts(fit)["vertical"] == 2
    true = np.sort(np.array(truth.loops[0].points), axis=0)
    off = [np.abs(np.sort(np.array(f.outline.loops[0].points), axis=0) - true).mean() for f in (plain, fit)]
    assert off[1] <= off[0]
