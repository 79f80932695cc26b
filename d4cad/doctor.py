"""Which CAD kernels work here, and how to mend those that do not.

build123d and CadQuery bind OpenCASCADE through one module, OCP, which two distributions own: whichever was installed
last has overwritten the other's files. Everything is tried in processes of its own, so that a crash there is a finding.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, packages_distributions, version

TIMEOUT = 120.0
"""Seconds after which a trial has failed: a first import from a slow disk may take many."""

TRIALS = {
    "OCP": "from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox as box; from OCP.GProp import GProp_GProps as props\n"
    "from OCP.BRepGProp import BRepGProp as b\np = props(); b.VolumeProperties_s(box(1, 2, 3).Shape(), p)\n"
    "v = p.Mass()",
    "build123d": "import build123d; v = build123d.Box(1, 2, 3).volume",
    "cadquery": "import cadquery; v = cadquery.Workplane().box(1, 2, 3).val().Volume()",
}
"""What is run for each module; v must become the volume of a box of 1 x 2 x 3 mm."""

OWNERS = ("cadquery-ocp", "cadquery-ocp-novtk")
"""The distributions of OCP: CadQuery's, with the classes for VTK that it needs, and build123d's, without."""

RELEASES = {"build123d": "build123d>=0.12,<0.14", "cadquery": "cadquery>=2.8,<2.9"}
TOGETHER = "'build123d>=0.12,<0.13' 'cadquery>=2.8,<2.9'"
"""What works by itself, and the one pair of releases that share a version of OCP, as in pyproject.toml."""

CRASH = "it crashed"
INSTALL = "pip install 'd4cad[build123d]' or pip install 'd4cad[cadquery]'"
REINSTALL = "pip install --force-reinstall --no-deps"  # dependencies would be renewed as well, beyond what others allow


@dataclass(frozen=True, slots=True)
class Trial:
    """How a module did. error: None if it works, else the last line of what it said. seconds: wall time."""

    error: str | None
    seconds: float


@dataclass(frozen=True, slots=True)
class Problem:
    """What is wrong, and the command that mends it."""

    what: str
    mend: str


@dataclass(frozen=True, slots=True)
class Report:
    """versions: of what is installed of the libraries and of OCP's owners. trials: of what is installed, by module."""

    versions: Mapping[str, str]
    trials: Mapping[str, Trial]
    problems: tuple[Problem, ...]

    @property
    def healthy(self) -> bool:
        """Whether at least one kernel works and nothing is broken."""
        return not self.problems


def examine() -> Report:
    """Look at this Python's installation. Imports no CAD kernel into this process."""
    owners = [name for name in packages_distributions().get("OCP", []) if name in OWNERS]
    versions = {name: found for name in (*RELEASES, *dict.fromkeys(owners)) if (found := _version(name)) is not None}
    wanted = ["OCP"] * bool(owners) + [name for name in RELEASES if name in versions]
    trials = {module: tried(module) for module in wanted}
    return Report(versions, trials, diagnosed(versions, trials))


def tried(module: str, timeout: float = TIMEOUT) -> Trial:
    """Run a module's trial in a process of its own."""
    code = f"{TRIALS[module]}\nassert abs(v - 6) < 1e-9, f'a box of 6 mm^3 measures {{v}}'"
    start = time.perf_counter()
    try:
        done = subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, timeout=timeout, check=False
        )
    except subprocess.TimeoutExpired:
        return Trial(f"it took more than {timeout:g} s", time.perf_counter() - start)
    seconds = time.perf_counter() - start
    if done.returncode == 0:
        return Trial(None, seconds)
    said = done.stderr.strip().splitlines()
    crashed = done.returncode < 0 or not said
    return Trial(f"{CRASH} with exit code {done.returncode}" if crashed else said[-1].strip(), seconds)


def diagnosed(versions: Mapping[str, str], trials: Mapping[str, Trial]) -> tuple[Problem, ...]:
    """What is wrong, given what is installed and how it did: one problem for a common cause, else one a module."""
    if not trials:
        return (Problem("no CAD kernel is installed: STEP, BREP and the CAD libraries are not available", INSTALL),)
    failed = {module: trial.error for module, trial in trials.items() if trial.error is not None}
    owners = [f"{name}=={versions[name]}" for name in OWNERS if name in versions]
    clashing = [module for module, error in failed.items() if "OCP" in error or error.startswith(CRASH)]
    if clashing and len(owners) > 1:
        clash = f"{' and '.join(owners)} own the same files, and those that were installed last do not serve"
        what = f"{clash} {' and '.join(clashing)} ({failed[clashing[0]]})"
        if len({versions[name] for name in OWNERS}) == 1:
            return (Problem(what, f"{REINSTALL} {owners[0]}"),)
        return (Problem(what, f"pip install {TOGETHER}, then d4cad doctor again"),)
    if owners and "OCP" in failed:
        return (Problem(f"OCP does not work: {failed['OCP']}", f"{REINSTALL} {owners[0]}"),)
    return tuple(
        Problem(f"{module} does not work: {error}", f"pip uninstall -y {module} && pip install '{RELEASES[module]}'")
        for module, error in failed.items()
    )


def text(report: Report) -> str:
    """The report for a terminal: a line for each module, and one for each problem and its mending."""
    owners = ", ".join(f"{name} {report.versions[name]}" for name in OWNERS if name in report.versions)
    lines = [f"{'OCP':10} {owners or 'not installed':28} {_outcome(report.trials.get('OCP'))}"]
    for name in RELEASES:
        lines.append(f"{name:10} {report.versions.get(name, 'not installed'):28} {_outcome(report.trials.get(name))}")
    lines += [f"problem: {problem.what}. To mend it: {problem.mend}" for problem in report.problems]
    return "\n".join(line.rstrip() for line in lines)


def as_json(report: Report) -> str:
    """The report as one JSON object with the keys healthy, python, versions, trials and problems."""
    return json.dumps(
        {
            "healthy": report.healthy,
            "python": sys.version.split()[0],
            "versions": dict(report.versions),
            "trials": {name: {"error": t.error, "seconds": round(t.seconds, 3)} for name, t in report.trials.items()},
            "problems": [{"what": problem.what, "mend": problem.mend} for problem in report.problems],
        }
    )


def _outcome(trial: Trial | None) -> str:
    if trial is None:
        return ""
    return f"works ({trial.seconds:.1f} s)" if trial.error is None else f"fails: {trial.error}"


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None
