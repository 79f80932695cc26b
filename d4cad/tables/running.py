"""Many fits, in parallel and resumed: each is kept as one JSON file as soon as it is done."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from math import inf
from pathlib import Path

import numpy as np

from d4cad import __version__
from d4cad.bench import RESOLUTION, SAME_CURVE, Case, coverage, shapes, true_outline
from d4cad.canvas import Canvas
from d4cad.descent import Stop, descend
from d4cad.edgemodel import exact
from d4cad.errors import D4cadError, InputError
from d4cad.files import replacing
from d4cad.fit import decibels
from d4cad.fitting import warm
from d4cad.objectives.image import ImageLoss
from d4cad.tables.sets import cases
from d4cad.tables.settings import Setting


@dataclass(frozen=True, slots=True)
class Task:
    """One fit: a shape, a row of a table and a seed. max_time: seconds, None for no limit."""

    case: Case
    setting: Setting
    seed: int
    max_time: float | None = None

    @property
    def key(self) -> str:
        """Fingerprint of all that the result hangs on, the program's version among it."""
        facts = [self.case.loops, asdict(self.setting), self.seed, self.max_time, __version__]
        return hashlib.sha256(json.dumps(facts, sort_keys=True).encode()).hexdigest()[:16]

    @property
    def file(self) -> Path:
        """Where the result is kept, below the working folder."""
        row = self.setting.label.replace(" ", "_")
        return Path(self.setting.method) / row / f"{self.case.name}_{self.seed}.json"


@dataclass(frozen=True, slots=True)
class Result:
    """What one fit came to. psnr: dB in the paper's raster. primitives, true_primitives: of the program and of the
    truth. cpu_s, wall_s: seconds of the search. steps: gradient steps. stop: why it ended. error: why there is no
    result, or None."""

    set: str
    index: int
    method: str
    row: str
    seed: int
    psnr: float = 0.0
    primitives: int = 0
    true_primitives: int = 0
    cpu_s: float = 0.0
    wall_s: float = 0.0
    steps: int = 0
    stop: str = "failed"
    error: str | None = None


def tasks(
    data: Path | None,
    rows: Sequence[Setting],
    limit: int | None,
    seeds: int,
    max_time: float | None = None,
) -> list[Task]:
    """Every fit that the tables need, on the shapes of ``data`` or, if that is None, on our own; ``limit``: shapes of
    each set. A search that draws no random number has one seed. Raises InputError."""
    if seeds < 1:
        raise InputError(f"the number of seeds must be 1 or more, got {seeds}")
    if limit is not None and limit < 1:
        raise InputError(f"the limit must be 1 or more, got {limit}")
    if max_time is not None and not 0 < max_time < inf:
        raise InputError(f"the time limit must be a positive number, got {max_time:g}")
    wanted = cases(limit) if data is None else shapes(data, limit)
    return [
        Task(case, row, seed, max_time)
        for seed in range(seeds)
        for row in rows
        if row.is_random or seed == 0
        for case in wanted
    ]


def run(
    todo: Sequence[Task], work: Path, jobs: int | None = None, tell: Callable[[int, int], None] | None = None
) -> list[Result]:
    """All results in the order of ``todo``: those kept in ``work`` are read, the others computed and kept.

    jobs: processes, -1 for every core, None for what ``joblib.parallel_config`` says, whose backend may be a dask
    cluster: only this process writes. tell: called with the number done and that of all. Ctrl-C loses no result that
    has come. Raises InputError for a bad number of jobs, ExportError where the folder cannot be written.
    """
    from joblib import Parallel, delayed

    if jobs is not None and (jobs == 0 or jobs < -1):
        raise InputError(f"the number of jobs must be 1 or more, or -1 for every core, got {jobs}")
    found = {task.file: kept for task in todo if (kept := _kept(work, task)) is not None}
    rest = [task for task in todo if task.file not in found]
    workers = Parallel(n_jobs=jobs, prefer="processes", return_as="generator_unordered", pre_dispatch="2*n_jobs")
    for task, result in workers(delayed(_solved)(task) for task in rest):
        if result.stop == Stop.INTERRUPTED.name.lower():
            raise KeyboardInterrupt
        path = work / task.file
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacing(path) as temporary:
            temporary.write_text(json.dumps({"key": task.key, **asdict(result)}) + "\n", encoding="utf-8")
        found[task.file] = result
        if tell is not None:
            tell(len(found), len(todo))
    return [found[task.file] for task in todo]


def _kept(work: Path, task: Task) -> Result | None:
    """The result in the working folder, if it is of the same task."""
    with suppress(OSError, ValueError, TypeError, AttributeError):
        facts = json.loads((work / task.file).read_text(encoding="utf-8"))
        if facts.pop("key", None) == task.key:
            return Result(**facts)
    return None


def _solved(task: Task) -> tuple[Task, Result]:
    return task, solve(task)


def solve(task: Task) -> Result:
    """One fit from the grammar's axiom, in the paper's raster; what goes wrong becomes its result."""
    setting, case = task.setting, task.case
    warm(setting.grammar, setting.method)
    canvas = Canvas.square(RESOLUTION)
    try:
        truth = true_outline(case)
        target = coverage(truth, canvas)
        grammar, method = setting.search(canvas, target, exact(target, canvas).floor)
        cpu, wall = time.process_time(), time.perf_counter()
        found = descend(
            grammar.axiom(canvas), grammar, ImageLoss.of(target), canvas, method, np.random.default_rng(task.seed),
            max_seconds=inf if task.max_time is None else task.max_time,
        )  # fmt: skip
        cpu, wall = time.process_time() - cpu, time.perf_counter() - wall
    except D4cadError as error:
        return Result(case.set, case.index, setting.method, setting.label, task.seed, error=str(error))
    missed = grammar.rasterize(found.program, canvas).coverage - target
    return Result(
        set=case.set,
        index=case.index,
        method=setting.method,
        row=setting.label,
        seed=task.seed,
        psnr=decibels(float(np.mean(missed**2))),
        primitives=grammar.primitives(found.program),
        true_primitives=truth.simplified(SAME_CURVE).primitives,
        cpu_s=cpu,
        wall_s=wall,
        steps=found.history[-1].step if found.history else 0,
        stop=found.stop.name.lower(),
    )
