"""`import d4cad.cadquery`: a picture is one step in a chain of CadQuery's Workplane; and fits for the two libraries."""

from __future__ import annotations

from importlib import import_module
from math import pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from d4cad.errors import InputError
from d4cad.fit import Fit
from d4cad.fitting import fit_image
from d4cad.programs import load_program
from d4cad.sketch import Sketch

cq: Any = pytest.importorskip("cadquery", reason="CadQuery is not installed")
import_module("d4cad.cadquery")


def disc() -> NDArray[np.float64]:
    """A white disc of 15.5 px radius, a little off the middle of 48 x 48 px."""
    y, x = np.mgrid[:48, :48] + 0.5
    return np.asarray(np.clip(15.5 - np.hypot(x - 23, y - 26) + 0.5, 0, 1))


@pytest.fixture(scope="module")
def fit() -> Fit:
    return fit_image(disc())


def test_fit_image_is_centered_at_every_point(tmp_path: Path) -> None:
    Image.fromarray(np.rint(disc() * 255).astype(np.uint8)).save(tmp_path / "disc.png")
    for image in (disc(), tmp_path / "disc.png", str(tmp_path / "disc.png")):
        part = cq.Workplane().pushPoints([(0, 0), (50, 0)]).fitImage(image, width=20).extrude(3)
        assert part.solids().size() == 2
        assert part.val().Volume() == pytest.approx(2 * 3 * pi * 100, rel=1e-3)
        found = part.val().BoundingBox()
        assert (found.xmin, found.xmax, found.ymin, found.ymax) == pytest.approx((-10, 60, -10, 10), abs=0.02)


def test_fit_image_cuts_and_passes_options_on() -> None:
    plate = cq.Workplane().box(40, 40, 5).faces(">Z").workplane()
    cut = plate.fitImage(disc(), 10, invert=True, threshold=0.5).cutBlind(-2)  # the ground, all 48 px of it
    assert cut.val().isValid()
    assert cut.val().Volume() == pytest.approx(8000 - 2 * (100 - pi * (15.5 * 10 / 48) ** 2), rel=1e-3)
    corner = cq.Workplane().fitImage(disc(), scale=0.5, centered=False).extrude(1).val().BoundingBox()
    assert (corner.xmin, corner.ymin) == pytest.approx((0, 0), abs=1e-6)
    assert corner.xlen == pytest.approx(15.5, rel=1e-2)
    with pytest.raises(InputError, match="expected one of width, scale and dpi"):
        cq.Workplane().fitImage(disc(), 10, dpi=100)


def test_d4sketch_takes_sketches_fits_and_program_files(fit: Fit, tmp_path: Path) -> None:
    fit.save(tmp_path / "disc.json", width=20, origin="center")
    for part in (fit.sketch(width=20, origin="center"), tmp_path / "disc.json", load_program(tmp_path / "disc.json")):
        made = cq.Workplane("XZ").rarray(30, 30, 2, 2).d4sketch(part).extrude(-1)
        assert made.solids().size() == 4
        assert made.val().Volume() == pytest.approx(4 * fit.sketch(width=20).area, rel=1e-9)
        assert made.val().BoundingBox().ymax == pytest.approx(1, abs=1e-6)
    two = cq.Workplane().d4sketch(fit.sketch(width=20), fit.sketch(width=10).translated(30, 0)).extrude(1)
    assert two.solids().size() == 2


def test_a_fit_is_wrapped_and_drawn(fit: Fit) -> None:
    assert cq.Shape.cast(fit.wrapped).Area() == pytest.approx(fit.sketch().area, rel=1e-9)
    assert fit._repr_svg_().startswith("<svg")
    assert fit.sketch()._repr_svg_() == fit._repr_svg_()
    assert Sketch(())._repr_svg_() is None


def test_a_fit_is_a_part_for_build123d(fit: Fit) -> None:
    pytest.importorskip("build123d", reason="build123d is not installed")
    made = import_module("d4cad.exporters.build123d").ProgramSketch(fit)
    assert made.area == pytest.approx(fit.sketch().area, rel=1e-9)
