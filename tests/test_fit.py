"""fit_image and Fit: a picture in, a part in mm out."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from scipy.ndimage import gaussian_filter

import d4cad
from d4cad.canvas import Canvas
from d4cad.descent import Record, Stop
from d4cad.errors import ExportError, GeometryError, InputError
from d4cad.fit import Fit, decibels, joined_outline
from d4cad.fitting import fit_coverage, fit_image
from d4cad.grammars.arc_line import ArcLine, Structure
from d4cad.outputs import EXTENSIONS
from d4cad.placement import Placement
from d4cad.program import Program
from d4cad.programs import load_program
from d4cad.sketch import Sketch

SIDE = 96


@cache
def plate() -> NDArray[np.uint8]:
    """A 60 x 40 pixel plate with a hole of radius 9 in its middle, white on black, antialiased in 8 bits."""
    fine = (np.arange(SIDE * 8) + 0.5) / 8 - SIDE / 2
    x, y = np.meshgrid(fine, fine)
    inside = (abs(x) < 30) & (abs(y) < 20) & (np.hypot(x, y) > 9)
    cover = inside.reshape(SIDE, 8, SIDE, 8).mean(axis=(1, 3))
    return np.asarray(np.round(cover * 255), dtype=np.uint8)


@cache
def fitted() -> Fit:
    """The plate's fit."""
    return fit_image(plate())


def test_a_plate_is_four_lines_and_a_circle() -> None:
    fit = fitted()
    assert fit.primitives == 6
    assert fit.psnr > 45
    assert fit.stop is Stop.STALLED
    assert fit.seconds > 0
    assert fit.wall > 0
    sketch = fit.sketch(width=60)
    assert len(sketch.faces) == 1
    (hole,) = sketch.faces[0].holes
    assert hole.circle is not None
    assert hole.circle.radius == pytest.approx(9, abs=0.05)
    assert sketch.area == pytest.approx(2400 - np.pi * 81, rel=2e-3)


@pytest.mark.parametrize(
    ("size", "width"),
    [({"width": 12.5}, 12.5), ({"scale": 0.5}, 30), ({"dpi": 254}, 6.0), ({}, 60 * 25.4 / 96)],
)
def test_size_in_mm(size: dict[str, Any], width: float) -> None:
    xmin, ymin, xmax, ymax = fitted().sketch(**size).bounds
    assert (xmin, ymin) == (0, 0)
    assert xmax == pytest.approx(width, rel=1e-12 if "width" in size else 1e-3)
    assert ymax / xmax == pytest.approx(2 / 3, rel=1e-3)


def test_the_origin_may_be_the_center() -> None:
    xmin, ymin, xmax, ymax = fitted().sketch(width=60, origin="center").bounds
    assert xmin == pytest.approx(-xmax)
    assert ymin == pytest.approx(-ymax)


def test_assumptions_are_noted() -> None:
    fit = fitted()
    assert "96 dpi" in fit.notes(fit.placement(), solid=False)[0]
    assert "3 mm" in fit.notes(fit.placement(width=3), solid=True)[0]
    assert fit.notes(fit.placement(width=3, thickness=2), solid=True) == ()


def test_the_picture_states_its_resolution(tmp_path: Path) -> None:
    Image.fromarray(plate()).save(tmp_path / "plate.png", dpi=(300, 300))
    fit = fit_image(tmp_path / "plate.png")
    assert fit.sketch().bounds[2] == pytest.approx(60 * 25.4 / 300, rel=1e-3)
    assert fit.notes(fit.placement(), solid=False) == ()


@pytest.mark.parametrize("bad", [0, -1, np.nan, np.inf])
@pytest.mark.parametrize("name", ["width", "scale", "dpi", "thickness"])
def test_sizes_are_positive_numbers(name: str, bad: float, tmp_path: Path) -> None:
    given: dict[str, Any] = {name: bad}
    with pytest.raises(InputError, match=f"the {name} must be a positive number"):
        fitted().save(tmp_path / "part.svg", **given)
    assert list(tmp_path.iterdir()) == []


def test_one_size_and_a_known_origin() -> None:
    with pytest.raises(InputError, match="one of width, scale and dpi, got width and dpi"):
        fitted().sketch(width=3, dpi=4)
    with pytest.raises(InputError, match="corner, center or drawing"):
        fitted().sketch(origin="left")


def test_rows_of_an_array_run_downwards() -> None:
    picture = np.zeros((64, 64))
    picture[8:24, 8:56] = 1  # near the top
    picture[8:56, 8:16] = 1
    sketch = fit_image(picture).sketch(scale=1.0)
    ((xmin, ymin, xmax, ymax),) = [sketch.bounds]
    assert (xmax - xmin, ymax - ymin) == pytest.approx((48, 48), abs=0.1)
    top = [y for x, y in sketch.loops[0].points if x > 40]
    assert min(top) == pytest.approx(32, abs=0.5)


def test_same_seed_same_result() -> None:
    again = fit_image(plate())
    assert again.program.structure == fitted().program.structure
    assert again.program.params.tobytes() == fitted().program.params.tobytes()


@pytest.mark.parametrize(
    "drawn",
    [
        lambda cover: np.where(cover > 127, 255.0, 0.0),
        lambda cover: gaussian_filter(cover, 1.0),
        lambda cover: gaussian_filter(cover, 2.0),
        lambda cover: np.clip(cover + np.random.default_rng(0).normal(0, 13, cover.shape), 0, 255),
    ],
    ids=["no grey", "soft", "softer", "noisy"],
)
def test_other_ways_to_draw_the_same_plate(drawn: Callable[[NDArray[np.float64]], NDArray[np.float64]]) -> None:
    fit = fit_image(np.round(drawn(plate().astype(np.float64))).astype(np.uint8))
    assert fit.primitives == 6
    assert fit.sketch(scale=1.0).area == pytest.approx(2400 - np.pi * 81, rel=0.01)


def test_watch_sees_every_round() -> None:
    seen: list[Record] = []
    fit = fit_image(plate(), init="axiom", watch=seen.append)
    assert tuple(seen) == fit.history
    assert len(seen) > 1
    assert seen[-1].psnr > seen[0].psnr


@pytest.mark.parametrize("step", [1, 20, 50, 100])
def test_ctrl_c_keeps_the_best_so_far(step: int) -> None:
    def interrupt(record: Record) -> None:
        if record.step >= step:
            raise KeyboardInterrupt

    fit = fit_image(plate(), init="axiom", watch=interrupt)
    assert fit.stop is Stop.INTERRUPTED
    assert fit.psnr > 5
    assert fit.sketch(width=3).area > 0


def test_time_ends_the_search() -> None:
    fit = fit_image(plate(), max_time=1e-9)
    assert fit.stop is Stop.TIME
    assert fit.outline.area > 0


def test_going_on_from_a_program_file(tmp_path: Path) -> None:
    fitted().save(tmp_path / "plate.json", width=60)
    again = fit_image(plate(), init=tmp_path / "plate.json")
    assert again.psnr >= fitted().psnr - 0.01
    assert len(again.history) <= len(fitted().history)
    assert fit_image(plate(), init=fitted()).primitives == 6


def test_a_program_file_is_the_fit_again(tmp_path: Path) -> None:
    fitted().save(tmp_path / "plate.json", width=60, thickness=4, origin="center")
    back = load_program(tmp_path / "plate.json")
    assert back.program.structure == fitted().program.structure
    assert back.program.params.tobytes() == fitted().program.params.tobytes()
    assert back.history == fitted().history
    assert (back.psnr, back.stop, back.seconds) == (fitted().psnr, fitted().stop, fitted().seconds)
    sketch = fitted().sketch(width=60, origin="center")
    assert back.sketch().loops == sketch.loops
    assert [(r.kind, r.refs) for r in back.sketch().relations] == [(r.kind, r.refs) for r in sketch.relations]
    assert [d.value for d in back.sketch().dimensions] == pytest.approx([d.value for d in sketch.dimensions], rel=1e-11)
    assert back.placement().thickness == 4
    document = json.loads((tmp_path / "plate.json").read_text())
    assert document["unit"] == "mm"
    assert document["loops"] == back.sketch().to_neutral()
    with pytest.raises(ExportError, match="needs the picture"):
        back.save(tmp_path / "plate.png")


def changed(tmp_path: Path, **changes: Any) -> Path:
    fitted().save(tmp_path / "plate.json")
    document = json.loads((tmp_path / "plate.json").read_text())
    (tmp_path / "changed.json").write_text(json.dumps({**document, **changes}))
    return tmp_path / "changed.json"


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"params": [1.0, 2.0]}, "parameters, but its params are 2"),
        ({"structure": ["LLX"]}, "list of words"),
        ({"structure": ["L"], "params": [0.0, 0.0]}, "at least 2 edges"),
        ({"structure": ["LLLL"], "params": [0, 0, 1, 1, 1, 0, 0, 2]}, "crosses or touches"),
        ({"grammar": "spline"}, "no grammar 'spline'"),
        ({"stop": "bored"}, "stop is 'bored'"),
        ({"settings": {"placement": {"width": -1}}}, "positive"),
        ({"settings": {"placement": {"width": "wide"}}}, "wrong width"),
        ({"settings": {"placement": {"depth": 1}}}, "placement is not"),
    ],
)
def test_a_program_that_is_none_is_refused(tmp_path: Path, changes: dict[str, Any], message: str) -> None:
    path = changed(tmp_path, **changes)
    with pytest.raises(InputError, match=f"{path.name} is not a usable program file: .*{message}"):
        load_program(path)


@pytest.mark.parametrize("name", [f"part{extension}" for extension in EXTENSIONS])
def test_save_by_extension(tmp_path: Path, name: str) -> None:
    if name.endswith(("step", "stp", "brep")):
        pytest.importorskip("OCP")
    fitted().save(tmp_path / name, width=60, thickness=5)
    assert [path.name for path in tmp_path.iterdir()] == [name]
    assert (tmp_path / name).stat().st_size > 300


@pytest.mark.parametrize("name", ["part.dwg", "part", "nowhere/part.svg"])
def test_save_refuses_what_it_cannot_write(tmp_path: Path, name: str) -> None:
    with pytest.raises(ExportError, match="cannot write"):
        fitted().save(tmp_path / name)
    assert list(tmp_path.iterdir()) == []


def test_notebooks_show_a_drawing() -> None:
    assert fitted()._repr_svg_().startswith("<svg ")


@pytest.mark.parametrize(
    ("how", "message"),
    [
        ({"method": "quick"}, "no method 'quick', expected one of: fast, paper"),
        ({"grammar": "spline"}, "no grammar 'spline'"),
        ({"seed": -1}, "seed"),
        ({"max_time": 0.0}, "time limit"),
        ({"max_time": np.nan}, "time limit"),
        ({"ramp": -1.0}, "ramp"),
        ({"init": "nothing.json"}, "no program file nothing.json"),
    ],
)
def test_requests_that_make_no_sense(how: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        fit_image(plate(), **how)


@pytest.mark.parametrize(
    "array",
    [np.full((32, 32), np.nan), np.zeros((32, 32)), np.ones((32, 32)), np.zeros((1, 1)), np.zeros(5), np.zeros((0, 4))],
    ids=["nan", "black", "white", "one pixel", "one axis", "empty"],
)
def test_arrays_that_are_no_picture(array: NDArray[np.float64]) -> None:
    with pytest.raises(InputError):
        fit_image(array)


def test_coverage_must_match_its_canvas() -> None:
    with pytest.raises(InputError, match=r"shape \(16, 16\), got \(16, 8\)"):
        fit_coverage(np.zeros((16, 8)), Canvas.square(16))


def test_the_paper_method_runs() -> None:
    fit = fit_image(plate(), method="paper", max_time=0.3)
    assert fit.settings["method"] == "paper"
    assert fit.psnr > 10


def test_decibels_are_finite() -> None:
    assert decibels(0.0) == 300
    assert decibels(1e-4) == pytest.approx(40)


def test_placement_is_a_value() -> None:
    assert replace(Placement(width=3), width=None, dpi=96).pixel_size == pytest.approx(25.4 / 96)


def test_importing_d4cad_is_light() -> None:
    heavy = "{'numpy', 'numba', 'scipy', 'matplotlib', 'rich', 'torch', 'OCP', 'joblib'}"
    code = f"import sys, d4cad, d4cad.cli; print(sorted({heavy} & set(sys.modules)))"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"


def test_public_names() -> None:
    assert d4cad.fit_image is fit_image
    assert d4cad.Fit is Fit
    assert {"fit_image", "load_program", "__version__"} <= set(dir(d4cad))
    with pytest.raises(AttributeError, match="nothing"):
        d4cad.nothing  # noqa: B018


def test_the_contour_is_the_start_unless_asked_otherwise() -> None:
    fast, axiom = fit_image(plate()), fit_image(plate(), init="axiom")
    assert (fast.settings["init"], axiom.settings["init"]) == ("contour", "axiom")
    assert fast.start_psnr > axiom.start_psnr + 10
    assert fast.psnr > fast.start_psnr
    assert fast.primitives == axiom.primitives == 6
    assert fit_image(plate(), method="paper", max_time=0.2).settings["init"] == "axiom"


def test_a_start_from_nothing_is_the_axiom() -> None:
    """Grey that nowhere crosses the middle has no contour."""
    fit = fit_coverage(np.full((32, 32), 0.3), Canvas.square(32), init="contour", floor=10.0)
    assert fit.start_primitives == 4


def test_joining_leaves_an_outline_that_bounds_a_region() -> None:
    """A hole that is thinner than the tolerance, a tenth of a pixel, is joined by a lesser one."""
    canvas, half = Canvas.square(64), 0.02 * 3 / 64
    plate = [-0.8, -0.8, 0.8, -0.8, 0.8, 0.8, -0.8, 0.8]
    slit = [-0.3, -half, -0.3, half, 0.3, half, 0.3, -half]
    program = Program(Structure((4, 4), (False,) * 8), np.array([*plate, *slit]))
    grammar = ArcLine(canvas.pixel)
    with pytest.raises(GeometryError, match="no area"):
        Sketch.from_loops(grammar.outline(program).simplified(0.1 * canvas.pixel).loops)
    found = joined_outline(grammar, program, canvas, 1e-2)
    assert Sketch.from_loops(found.loops).area == pytest.approx(1.6**2 - 1.2 * half, rel=1e-9)
