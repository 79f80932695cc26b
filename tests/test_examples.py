"""Every example runs, and what it writes is what it says: read back and measured."""

from __future__ import annotations

import importlib.util
from importlib.util import find_spec
from math import pi
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

pytestmark = pytest.mark.kernel

EXAMPLES = Path(__file__).parent.parent / "examples"
LIBRARIES = {"gasket_bolt_holes": "build123d", "keychain_cadquery": "cadquery"}
"""The examples that are about one library, and cannot run without it."""


def example(name: str) -> ModuleType:
    """The module of an example; skips where its library is not installed."""
    library = LIBRARIES.get(name)
    if library is not None and find_spec(library) is None:
        pytest.skip(f"{name} shows {library}, which is not installed")
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def solid_volume(path: Path) -> float:
    """Volume in mm3 of a STEP file, every shape in it valid."""
    from OCP.STEPControl import STEPControl_Reader

    from d4cad.exporters import occ

    reader = STEPControl_Reader()
    reader.ReadFile(str(path))
    reader.TransferRoots()
    shape = reader.OneShape()
    assert occ.is_valid(shape)
    return occ.volume(shape)


def test_there_is_a_test_for_every_example() -> None:
    source = Path(__file__).read_text(encoding="utf-8")
    others = "".join(path.read_text(encoding="utf-8") for path in Path(__file__).parent.glob("test_*example*.py"))
    for path in EXAMPLES.glob("*.py"):
        assert f'"{path.stem}"' in source + others, f"no test runs {path.name}"


def test_logo_plate(tmp_path: Path) -> None:
    import trimesh

    facts = example("logo_plate").main(tmp_path)
    whole = facts["plate"] + facts["logo"]
    assert solid_volume(tmp_path / "logo_plate.step") == pytest.approx(whole, rel=1e-6)
    mesh: Any = trimesh.load(tmp_path / "logo_plate.stl")
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(whole, rel=1e-3)


def test_gasket_bolt_holes(tmp_path: Path) -> None:
    module = example("gasket_bolt_holes")
    facts = module.main(tmp_path)
    holes = module.BOLTS * pi * module.DIAMETER**2 / 4 * module.THICKNESS
    assert facts["volume"] == pytest.approx(facts["without holes"] - holes, rel=1e-9)
    assert solid_volume(tmp_path / "gasket.step") == pytest.approx(facts["volume"], rel=1e-6)


def test_keychain_cadquery(tmp_path: Path) -> None:
    import d4cad

    module = example("keychain_cadquery")
    facts = module.main(tmp_path)
    letter = d4cad.fit_image(module.PICTURE).sketch(width=14)
    assert facts["engraving"] == pytest.approx(letter.area * module.DEPTH, rel=1e-6)
    assert solid_volume(tmp_path / "keychain.step") == pytest.approx(facts["volume"], rel=1e-6)


def test_laser_cut(tmp_path: Path) -> None:
    from d4cad import importers
    from d4cad.offsets import offset

    module = example("laser_cut")
    facts = module.main(tmp_path)
    assert facts["failed"] == 0
    assert facts["wall"] > 1
    for name in ("gear.dxf", "gear.svg"):  # the beam takes away half its width on either side of the path
        assert offset(importers.read(tmp_path / name).sketch, -module.KERF / 2).area == pytest.approx(
            facts["area"], rel=1e-4
        )


def test_bracket_from_shapes(tmp_path: Path) -> None:
    module = example("bracket_from_shapes")
    facts = module.main(tmp_path)
    outline = 12 * 80 + 68 * 20 + pi * 50 + 2 * (1 - pi / 4) * module.FILLET**2
    assert facts["area"] == pytest.approx(outline - pi * (25 + 2 * 2.75**2), rel=1e-9)
    assert facts["inside radius"] == pytest.approx(2.75, rel=1e-6)
    assert solid_volume(tmp_path / "bracket.step") == pytest.approx(facts["area"] * module.THICKNESS, rel=1e-9)


def test_simplify_dxf(tmp_path: Path) -> None:
    from d4cad import importers

    facts = example("simplify_dxf").main(tmp_path)
    assert facts["before"] > 200
    assert facts["after"] == 4 + 4 + 2 + 2
    assert facts["area"] == pytest.approx(60 * 40 - (4 - pi) * 64 - pi * (81 + 36), abs=60 * 0.02)
    assert importers.read(tmp_path / "clean.dxf").sketch.area == pytest.approx(facts["area"], rel=1e-9)
