"""What is installed, what imports what, and what an import costs."""

from __future__ import annotations

import ast
import os
import re
import subprocess
import sys
import tomllib
from importlib.metadata import entry_points
from pathlib import Path

import pytest

import d4cad

ROOT = Path(__file__).parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
PACKAGE_DIR: dict[str, str] = PROJECT["tool"]["setuptools"]["package-dir"]

GEOMETRY = {"errors", "edges", "loop", "joining", "sketch", "cutting", "arrangement", "booleans", "offsets"}
GEOMETRY |= {"relations"}
ALLOWED: dict[str, set[str]] = {
    "edges": set(),
    "loop": {"errors", "edges"},
    "joining": {"errors", "edges", "loop"},
    "features": {"errors", "edges", "loop", "joining"},
    # io: the outline that a program file states
    "exporters": GEOMETRY | {"exporters", "canvas", "features", "files", "io", "offsets", "__version__"},
    "sketch": {"errors", "edges", "loop", "joining", "relations"},
    "cutting": {"edges", "loop"},
    "arrangement": {"edges", "loop", "cutting"},
    "booleans": {"errors", "edges", "sketch", "cutting", "arrangement"},
    "offsets": {"errors", "edges", "loop", "sketch", "arrangement"},
    "runs": set(),
    "skyline": set(),
    "deviation": {"edges", "loop", "runs"},
    "refinement": {"deviation", "edges", "skyline"},
    "segmentation": GEOMETRY | {"deviation", "refinement", "runs"},
    "simplification": GEOMETRY | {"deviation", "segmentation"},
    "importers": GEOMETRY | {"booleans", "deviation", "importers", "segmentation"},
    "relations": {"errors"},
    "regularize": GEOMETRY | {"regularize"},
    "raster": {"raster", "errors", "canvas", "program"},
    "grammars": GEOMETRY | {"grammars", "raster", "canvas", "program", "protocols"},
    "objectives": {"objectives", "raster", "canvas", "errors", "program", "protocols"},
    "beams": GEOMETRY
    | {"beams", "booleans", "canvas", "descent", "estimators", "exporters", "files", "fit", "grammars", "importers"}
    | {
        "io",
        "methods",
        "objectives",
        "registry",
        "program",
        "programs",
        "protocols",
        "raster",
        "segmentation",
        "steppers",
        "summary",
    },
    "priors": {"priors", "errors", "files", "objectives", "program"},
    "program": {"errors"},
    "protocols": {"canvas", "errors", "loop", "program", "raster", "sketch"},
    "interrupts": set(),
    "descent": {"interrupts", "canvas", "errors", "program", "protocols"},
    "estimators": {"canvas", "errors", "program", "protocols", "raster"},
    "steppers": {"canvas", "errors", "program", "protocols"},
    "images": {"errors", "preprocess"},
    "preprocess": {"errors"},
    "outlines": GEOMETRY,
    "shapes": GEOMETRY | {"outlines"},
}
"""Rooms and single modules of d4cad, and those that they may import: the arrows of docs/architecture.md."""

ASKED: dict[str, set[str]] = {"sketch": {"exporters"}}
"""Arrows that a module follows only when asked: a viewer asks a sketch for its faces or its drawing."""


def folder_of(package: str) -> Path:
    """The folder that package-dir maps a package to."""
    home = max((known for known in PACKAGE_DIR if f"{package}.".startswith(f"{known}.")), key=len)
    return ROOT / PACKAGE_DIR[home] / package.removeprefix(home).lstrip(".").replace(".", "/")


def modules() -> list[tuple[str, Path]]:
    """(dotted name, file) of every module of the three rooms, each once."""
    found = []
    for package in PROJECT["tool"]["setuptools"]["packages"]:
        for file in sorted(folder_of(package).glob("*.py")):
            found.append((package if file.stem == "__init__" else f"{package}.{file.stem}", file))
    return found


def imported(file: Path) -> set[str]:
    """Every module or name that a file imports, at its top or inside functions."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{file} has a relative import"
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return names


def asked_for(file: Path) -> set[str]:
    """Every module that a file imports by `import_module` when it needs it."""
    found = set()
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "import_module":
            found |= {str(arg.value) for arg in node.args if isinstance(arg, ast.Constant)}
    return found


def test_packages_are_those_on_disk() -> None:
    """A forgotten one works in the editable install and is missing from the wheel."""
    on_disk = {"d4cad"}
    for folder in (ROOT / "d4cad").glob("**/"):
        if any(folder.glob("*.py")):
            on_disk.add(".".join(folder.relative_to(ROOT).parts))
    for room in ("grammars", "exporters"):
        for folder in (ROOT / room).glob("**/"):
            if any(folder.glob("*.py")):
                on_disk.add(".".join(("d4cad", *folder.relative_to(ROOT).parts)))
    assert sorted(on_disk) == sorted(PROJECT["tool"]["setuptools"]["packages"])
    for package in on_disk:
        assert (folder_of(package) / "__init__.py").is_file()


@pytest.mark.parametrize("room", ["grammars", "exporters"])
def test_rooms_are_linked_into_the_package(room: str) -> None:
    """Type checkers and editors follow these links; a checkout without symbolic links cannot be type-checked."""
    assert os.readlink(ROOT / "d4cad" / room) == f"../{room}"


def test_version() -> None:
    assert PROJECT["project"]["version"] == d4cad.__version__
    assert f"## [{d4cad.__version__}]" in (ROOT / "CHANGELOG.md").read_text()


def test_console_script() -> None:
    (script,) = entry_points(group="console_scripts", name="d4cad")
    assert script.value == "d4cad.cli:main"


def test_everything_is_pinned() -> None:
    pins = {}
    for line in (ROOT / "constraints.txt").read_text().splitlines():
        if not line.startswith("#"):
            name, version = line.split("==")
            pins[name] = version
    assert list(pins) == sorted(pins)
    extras = PROJECT["project"]["optional-dependencies"]
    for requirement in (*PROJECT["project"]["dependencies"], *(r for extra in extras.values() for r in extra)):
        name = re.split(r"[\[<>=]", requirement)[0]
        assert name in {*pins, "d4cad"}
    assert pins["torch"] == "2.13.0"
    assert pins["cadquery-ocp"] == pins["cadquery-ocp-novtk"]


def test_every_import_is_declared() -> None:
    """What comes only as a dependency of a dependency may be gone tomorrow."""
    named = {"PIL": "pillow", "OCP": "cadquery"}
    extras = PROJECT["project"]["optional-dependencies"]
    declared = {
        re.split(r"[\[<>=]", requirement)[0]
        for requirements in (PROJECT["project"]["dependencies"], *extras.values())
        for requirement in requirements
    }
    for name, file in modules():
        tops = {i.split(".")[0] for i in imported(file) | asked_for(file)} - {"d4cad", *sys.stdlib_module_names}
        missing = {named.get(top, top) for top in tops} - declared
        assert not missing, f"{name} imports {missing}, which pyproject.toml does not name"


@pytest.mark.parametrize(("name", "file"), modules(), ids=[name for name, _ in modules()])
def test_arrows(name: str, file: Path) -> None:
    """What no room may see it does not see: above all no CAD kernel in grammars, no grammar in exporters."""
    part = name.removeprefix("d4cad.").split(".")[0]
    inner = {i.removeprefix("d4cad.").split(".")[0] for i in imported(file) if i.startswith("d4cad.")}
    assert not {i for i in imported(file) if i.split(".")[0] in ("grammars", "exporters", "tests", "examples")}
    if part in ALLOWED:
        assert inner <= ALLOWED[part], f"{name} imports {sorted(inner - ALLOWED[part])}"
        late = {i.split(".")[1] for i in asked_for(file) if i.startswith("d4cad.")}
        assert late <= ALLOWED[part] | ASKED.get(part, set()), f"{name} imports {sorted(late)} late"
    if part != "exporters":
        kernels = {"OCP", "build123d", "cadquery"}
        every = imported(file) | asked_for(file)
        assert not {i for i in every if i.split(".")[0] in kernels}, f"only exporters may import {kernels}"


def test_imports_are_light() -> None:
    """Each of these costs a tenth of a second to seconds, and none is needed to print help."""
    heavy = ["torch", "OCP", "build123d", "cadquery", "matplotlib", "numba", "scipy", "trimesh", "manifold3d", "PIL"]
    heavy += ["ezdxf", "svgelements"]
    code = f"import sys, d4cad, d4cad.cli; print([m for m in {heavy} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd="/")
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize("script", ["kernels", "run", "wheel"])
def test_ci_scripts_run_and_can_fail(script: str) -> None:
    path = ROOT / ".ci" / script
    assert os.access(path, os.X_OK)
    assert "set -euo pipefail" in path.read_text()
