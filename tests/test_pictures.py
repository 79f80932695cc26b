"""The shipped pictures are what their script draws, and the shapes in them are the ones it names."""

from __future__ import annotations

import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from PIL import Image

from d4cad.images import load
from d4cad.sketch import Circle

FOLDER = Path(__file__).parent.parent / "examples" / "pictures"
NAMES = ["bracket", "gasket", "gear", "letter"]


@pytest.fixture(scope="module")
def script() -> ModuleType:
    spec = spec_from_file_location("examples_pictures_draw", FOLDER / "draw.py")
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def test_all_are_shipped(script: ModuleType) -> None:
    assert sorted(script.PICTURES) == NAMES
    assert sorted(path.stem for path in FOLDER.glob("*.png")) == NAMES


def test_script_draws_them_again(script: ModuleType, tmp_path: Path) -> None:
    script.main(tmp_path)
    for name in NAMES:
        again, shipped = (np.asarray(Image.open(folder / f"{name}.png"), dtype=int) for folder in (tmp_path, FOLDER))
        assert shipped.shape == (512, 512)
        assert np.abs(again - shipped).max() <= 1  # the last bit of a sine may differ between machines
        assert (FOLDER / f"{name}.png").stat().st_size < 10_000


@pytest.mark.parametrize("name", NAMES)
def test_area_is_that_of_the_sketch(script: ModuleType, name: str) -> None:
    picture = load(FOLDER / f"{name}.png")
    assert picture.target.sum() == pytest.approx(script.PICTURES[name]().area, rel=1e-4)
    assert picture.noise == 0


def test_coverage_of_a_disc(script: ModuleType) -> None:
    disc = script.Sketch.from_loops([Circle((20.3, 9.8), 6.0).loop()])
    cover = script.coverage(disc, 32)
    assert cover.sum() == pytest.approx(36 * np.pi, rel=1e-3)
    rows, columns = np.mgrid[:32, :32] + 0.5
    assert (cover * columns).sum() / cover.sum() == pytest.approx(20.3, abs=3e-3)
    assert (cover * rows).sum() / cover.sum() == pytest.approx(32 - 9.8, abs=3e-3)
