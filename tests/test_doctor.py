"""`d4cad doctor`: tried in environments that are broken on purpose."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tomllib
import venv
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from d4cad import doctor
from d4cad.cli import app
from d4cad.doctor import Problem, Report, Trial, diagnosed, text, tried

pytestmark = pytest.mark.kernel

ROOT = Path(__file__).parent.parent
GOOD = Trial(None, 1.0)
VTK = Trial("ImportError: cannot import name 'IVtkOCC_Shape' from 'OCP.IVtkOCC'", 1.0)
GONE = Trial("ModuleNotFoundError: No module named 'OCP.gp'", 1.0)
BOTH = {"build123d": "0.12.0", "cadquery": "2.8.0", "cadquery-ocp": "7.9.3.1.1", "cadquery-ocp-novtk": "7.9.3.1.1"}
MIXED = {**BOTH, "build123d": "0.13.0", "cadquery-ocp-novtk": "8.0.1.1.0"}

BUILD123D = "class Box:\n    def __init__(self, *size):\n        self.volume = {volume}\n"
CADQUERY = (
    "class Workplane:\n    def box(self, *size): return self\n    def val(self): return self\n"
    "    def Volume(self): return 6.0\n"
)
OCP = {
    "OCP/__init__.py": "",
    "OCP/BRepPrimAPI.py": "class BRepPrimAPI_MakeBox:\n    def __init__(self, *s): pass\n    def Shape(self): pass\n",
    "OCP/GProp.py": "class GProp_GProps:\n    def Mass(self): return 6.0\n",
    "OCP/BRepGProp.py": "class BRepGProp:\n    def VolumeProperties_s(*a): pass\n",
}


@pytest.fixture(scope="module")
def bare(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The Python of an environment in which nothing is installed."""
    folder = tmp_path_factory.mktemp("bare")
    venv.create(folder, with_pip=False, symlinks=True)
    return folder / "bin" / "python"


def install(folder: Path, name: str, version: str, files: dict[str, str]) -> None:
    """Files in ``folder`` as those of a distribution."""
    for file, content in files.items():
        (folder / file).parent.mkdir(parents=True, exist_ok=True)
        (folder / file).write_text(content)
    info = folder / f"{name.replace('-', '_')}-{version}.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n")
    (info / "RECORD").write_text("".join(f"{file},,\n" for file in files))


def examined(python: Path, folder: Path) -> dict[str, Any]:
    """What doctor finds in a bare Python with the distributions of ``folder``."""
    code = "from d4cad import doctor; print(doctor.as_json(doctor.examine()))"
    package = Path(doctor.__file__).parent.parent
    (folder / "d4cad").symlink_to(package / "d4cad")
    done = subprocess.run(
        [python, "-c", code],
        capture_output=True,
        text=True,
        check=True,
        cwd="/",
        env={**os.environ, "PYTHONPATH": str(folder)},
    )
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def test_nothing_installed(bare: Path, tmp_path: Path) -> None:
    found = examined(bare, tmp_path)
    assert not found["healthy"]
    assert found["versions"] == found["trials"] == {}
    (problem,) = found["problems"]
    assert problem["what"].startswith("no CAD kernel is installed")
    assert problem["mend"] == "pip install 'd4cad[build123d]' or pip install 'd4cad[cadquery]'"


def test_one_library_that_works(bare: Path, tmp_path: Path) -> None:
    install(tmp_path, "cadquery-ocp-novtk", "8.0.1", OCP)
    install(tmp_path, "build123d", "0.13.0", {"build123d/__init__.py": BUILD123D.format(volume="6.0")})
    found = examined(bare, tmp_path)
    assert found["healthy"]
    assert found["problems"] == []
    assert found["versions"] == {"build123d": "0.13.0", "cadquery-ocp-novtk": "8.0.1"}
    assert {name: trial["error"] for name, trial in found["trials"].items()} == {"OCP": None, "build123d": None}


def test_the_wrong_one_was_installed_last(bare: Path, tmp_path: Path) -> None:
    """As seen: CadQuery imports a class that build123d's build of OCP lacks."""
    install(tmp_path, "cadquery-ocp", "7.9.3", OCP)
    install(tmp_path, "cadquery-ocp-novtk", "7.9.3", OCP)
    install(tmp_path, "build123d", "0.12.0", {"build123d/__init__.py": BUILD123D.format(volume="6.0")})
    broken = "from OCP.GProp import IVtkOCC_Shape\n"
    install(tmp_path, "cadquery", "2.8.0", {"cadquery/__init__.py": broken + CADQUERY})
    found = examined(bare, tmp_path)
    assert not found["healthy"]
    (problem,) = found["problems"]
    assert "cannot import name 'IVtkOCC_Shape'" in problem["what"]
    assert problem["mend"] == "pip install --force-reinstall --no-deps cadquery-ocp==7.9.3"


def test_a_wrong_volume_is_not_called_working(bare: Path, tmp_path: Path) -> None:
    install(tmp_path, "build123d", "0.12.0", {"build123d/__init__.py": BUILD123D.format(volume="0.0")})
    (problem,) = examined(bare, tmp_path)["problems"]
    assert problem["what"] == "build123d does not work: AssertionError: a box of 6 mm^3 measures 0.0"
    assert problem["mend"] == "pip uninstall -y build123d && pip install 'build123d>=0.12,<0.14'"


@pytest.mark.parametrize(
    ("content", "error"),
    [
        ("import os, signal; os.kill(os.getpid(), signal.SIGSEGV)", "it crashed with exit code -11"),
        ("import os; os._exit(3)", "it crashed with exit code 3"),
        ("import time; time.sleep(60)", "it took more than 0.5 s"),
        ("import gone_module", "ModuleNotFoundError: No module named 'gone_module'"),
        ("raise ImportError('a\\nb')", "b"),
    ],
)
def test_a_crash_or_a_hang_is_a_finding(
    content: str, error: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "cadquery.py").write_text(content)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    assert tried("cadquery", timeout=0.5 if "sleep" in content else 60.0).error == error


@pytest.mark.parametrize(
    ("versions", "trials", "what", "mend"),
    [
        (BOTH, {"OCP": GOOD, "build123d": GOOD, "cadquery": GOOD}, None, None),
        (
            BOTH,
            {"OCP": GOOD, "build123d": GOOD, "cadquery": VTK},
            r"cadquery-ocp==7.9.3.1.1 and cadquery-ocp-novtk==7.9.3.1.1 own the same files.*serve cadquery \(Imp",
            r"pip install --force-reinstall --no-deps cadquery-ocp==7\.9\.3\.1\.1",
        ),
        (
            MIXED,
            {"OCP": GOOD, "build123d": VTK, "cadquery": GOOD},
            r"own the same files.*serve build123d",
            r"pip install 'build123d>=0\.12,<0\.13' 'cadquery>=2\.8,<2\.9', then d4cad doctor again",
        ),
        (
            {"cadquery": "2.8.0", "cadquery-ocp": "7.9.3.1.1"},
            {"OCP": GONE, "cadquery": GONE},
            r"OCP does not work: ModuleNotFoundError",
            r"pip install --force-reinstall --no-deps cadquery-ocp==7\.9\.3\.1\.1",
        ),
        (
            BOTH,
            {"OCP": GOOD, "build123d": Trial("ModuleNotFoundError: No module named 'ezdxf'", 1.0), "cadquery": GOOD},
            r"build123d does not work: ModuleNotFoundError: No module named 'ezdxf'",
            r"pip uninstall -y build123d && pip install 'build123d>=0\.12,<0\.14'",
        ),
        (
            {"build123d": "0.13.0", "cadquery-ocp-novtk": "8.0.1.1.0"},
            {"OCP": GOOD, "build123d": Trial("ImportError: no ocpsvg", 1.0)},
            r"build123d does not work: ImportError: no ocpsvg",
            r"pip uninstall -y build123d && pip install 'build123d>=0\.12,<0\.14'",
        ),
    ],
)
def test_a_common_cause_is_one_problem(
    versions: dict[str, str], trials: dict[str, Trial], what: str | None, mend: str | None
) -> None:
    found = diagnosed(versions, trials)
    assert len(found) == (what is not None)
    for problem in found:
        assert re.search(str(what), problem.what)
        assert re.fullmatch(str(mend), problem.mend)


def test_the_releases_named_are_those_of_the_package() -> None:
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    assert [[release] for release in doctor.RELEASES.values()] == [extras["build123d"], extras["cadquery"]]
    together = [f"'{release}'" for release in extras["cad"]]
    assert together == doctor.TOGETHER.split(" ")


def test_this_environment_is_healthy() -> None:
    done = subprocess.run([sys.executable, "-m", "d4cad.cli", "doctor", "--json"], capture_output=True, check=True)
    found = json.loads(done.stdout)
    assert found["healthy"]
    assert found["versions"].keys() & {"build123d", "cadquery"}
    assert found["trials"].keys() > {"OCP"}
    assert all(trial["error"] is None for trial in found["trials"].values())


def test_the_command_says_it_in_lines_and_exits_with_1(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = Problem("cadquery does not work: it took more than 120 s", "pip install something")
    broken = Report(
        BOTH, {"OCP": GOOD, "build123d": GOOD, "cadquery": Trial("it took more than 120 s", 120)}, (problem,)
    )
    monkeypatch.setattr(doctor, "examine", lambda: broken)
    done = CliRunner().invoke(app, ["doctor"])
    assert done.exit_code == 1
    assert done.output == text(broken) + "\n"
    lines = done.output.splitlines()
    assert re.fullmatch(r"OCP +cadquery-ocp 7.9.3.1.1, cadquery-ocp-novtk 7.9.3.1.1 +works \(1.0 s\)", lines[0])
    assert re.fullmatch(r"build123d +0.12.0 +works \(1.0 s\)", lines[1])
    assert re.fullmatch(r"cadquery +2.8.0 +fails: it took more than 120 s", lines[2])
    assert lines[3:] == [f"problem: {problem.what}. To mend it: {problem.mend}"]
    assert json.loads(CliRunner().invoke(app, ["doctor", "--json"]).output)["problems"][0]["mend"] == problem.mend
