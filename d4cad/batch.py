"""Many pictures: fitted in parallel, each on its own, with a table that is resumed from."""

from __future__ import annotations

import csv
import glob
import hashlib
import json
import os
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from io import StringIO
from pathlib import Path
from typing import Any

from d4cad import __version__
from d4cad.errors import D4cadError, InputError
from d4cad.files import replacing
from d4cad.finishing import Finish, fit_finished
from d4cad.fitting import warm
from d4cad.outputs import EXTENSIONS, check_output
from d4cad.placement import Placement
from d4cad.summary import summary

TABLE = "summary.json"
SHEET = "summary.csv"
EVERY = 2.0
"""Seconds between two writings of the tables while fits come in."""

DONE, SKIPPED, FAILED, INTERRUPTED = "done", "skipped", "failed", "interrupted"


@dataclass(frozen=True, slots=True)
class Batch:
    """What to make of every picture.

    out: folder of the results. extensions: kinds of files, such as (".step", ".json"). options: keywords of
    :func:`d4cad.fitting.fit_image`, JSON values all. Raises InputError for a kind that there is not, ExportError for
    one that cannot be written here.
    """

    out: Path
    extensions: tuple[str, ...] = (".json",)
    options: Mapping[str, Any] = field(default_factory=dict)
    finish: Finish = field(default_factory=Finish)
    placement: Placement = field(default_factory=Placement)

    def __post_init__(self) -> None:
        for extension in self.extensions:
            if extension not in EXTENSIONS:
                raise InputError(f"expected kinds of files among {' '.join(EXTENSIONS)}, got {extension!r}")

    @property
    def key(self) -> str:
        """Stands for all that the results depend on beside the pictures."""
        what = [__version__, self.extensions, dict(self.options), asdict(self.finish), asdict(self.placement)]
        return hashlib.sha256(json.dumps(what, sort_keys=True).encode()).hexdigest()[:16]

    def outputs(self, picture: Path) -> list[Path]:
        """The files that a picture becomes."""
        return [self.out / f"{picture.stem}{extension}" for extension in self.extensions]


@dataclass(frozen=True, slots=True)
class Row:
    """One picture's result. status: done, skipped (done before), failed or interrupted. error: why it failed.

    psnr: dB. iou, largest_px, mean_px: as :class:`d4cad.fidelity.Fidelity` has them. key: the settings' key.
    """

    picture: str
    status: str
    error: str = ""
    primitives: int = 0
    lines: int = 0
    arcs: int = 0
    circles: int = 0
    psnr: float = 0.0
    iou: float = 0.0
    largest_px: float = 0.0
    mean_px: float = 0.0
    cpu_s: float = 0.0
    wall_s: float = 0.0
    stop: str = ""
    key: str = ""


def pictures(patterns: Sequence[str | Path]) -> list[Path]:
    """The files that names and patterns with * ? [ ] stand for, in order, each once.

    Raises InputError for a pattern that nothing matches, and where two pictures would become the same files.
    """
    found: dict[Path, None] = {}
    for pattern in patterns:
        text = str(pattern)
        if Path(text).exists() or not any(mark in text for mark in "*?["):
            found[Path(text)] = None
            continue
        matches = [Path(name) for name in sorted(glob.glob(text, recursive=True)) if Path(name).is_file()]
        if not matches:
            raise InputError(f"expected pictures, but nothing matches {text}")
        found.update(dict.fromkeys(matches))
    stems: dict[str, Path] = {}
    for path in found:
        if path.stem in stems:
            raise InputError(f"{stems[path.stem]} and {path} would both become {path.stem}: give one another name")
        stems[path.stem] = path
    return list(found)


def run(
    batch: Batch,
    files: Sequence[Path],
    *,
    jobs: int | None = None,
    force: bool = False,
    tell: Callable[[Row], None] | None = None,
) -> list[Row]:
    """Fit all pictures and write their files, ``summary.json`` and ``summary.csv``; rows in the order of ``files``.

    jobs: processes, None for what ``joblib.parallel_config`` says, whose backend may be a dask or ray cluster; its
    workers need the same file system. force: also what is there already. tell: called with every row as it comes. A
    picture that fails becomes a row that says why. Ctrl-C keeps what is done: the rest are rows "interrupted". Raises
    InputError for a bad number of jobs, ExportError for a folder that cannot be written.
    """
    from joblib import Parallel, delayed

    if jobs is not None and (jobs == 0 or jobs < -1):
        raise InputError(f"the number of jobs must be 1 or more, or -1 for every core, got {jobs}")
    batch.out.mkdir(parents=True, exist_ok=True)
    for path in batch.outputs(Path("picture")):
        check_output(path, has_picture=True)
    before = {} if force else _kept(batch)
    rows: dict[Path, Row] = {}
    for path in files:
        if path.stem in before and _is_fresh(batch, path):
            rows[path] = replace(before[path.stem], picture=str(path), status=SKIPPED)
            if tell is not None:
                tell(rows[path])
    rest = [path for path in files if path not in rows]
    written = time.monotonic()
    try:
        work = Parallel(n_jobs=jobs, prefer="processes", return_as="generator_unordered", pre_dispatch="2*n_jobs")
        for path, row in work(delayed(_solve_in)(Path.cwd(), batch, path) for path in rest):
            if row.status == INTERRUPTED:
                raise KeyboardInterrupt
            rows[path] = row
            if tell is not None:
                tell(row)
            if time.monotonic() - written > EVERY:
                _write(batch, [rows[p] for p in files if p in rows])
                written = time.monotonic()
    except KeyboardInterrupt:
        for path in files:
            rows.setdefault(path, Row(str(path), INTERRUPTED))
    found = [rows[path] for path in files]
    _write(batch, found)
    return found


def _solve_in(folder: Path, batch: Batch, path: Path) -> tuple[Path, Row]:
    """As :func:`solve`, in a worker that may have begun in another folder than the one that the paths start from."""
    os.chdir(folder)
    return solve(batch, path)


def solve(batch: Batch, path: Path) -> tuple[Path, Row]:
    """Fit one picture and write its files; what goes wrong becomes its row."""
    warm(str(batch.options.get("grammar", "arc-line")), str(batch.options.get("method", "fast")))
    try:
        given = batch.placement
        fit = fit_finished(path, batch.finish, given, **batch.options)
        if fit.stop.name == "INTERRUPTED":
            return path, Row(str(path), INTERRUPTED)
        placement = fit.placement(given.width, given.scale, given.dpi, given.origin, given.thickness)
        outputs = batch.outputs(path)
        for output in outputs:
            if output.resolve() == path.resolve():
                raise InputError(f"cannot write {output}: it is the picture")
            fit.write(output, placement)
        facts = summary(fit, placement, outputs)
    except KeyboardInterrupt:
        return path, Row(str(path), INTERRUPTED)
    except (D4cadError, OSError, MemoryError) as error:
        return path, Row(str(path), FAILED, _sentence(error))
    except Exception as error:  # noqa: BLE001  a defect that one picture shows must not lose the work on the others
        return path, Row(str(path), FAILED, f"internal error: {type(error).__name__}: {_sentence(error)}")
    figures = facts["fidelity"] or {}
    return path, Row(
        picture=str(path),
        status=DONE,
        **{name: facts[name] for name in ("primitives", "lines", "arcs", "circles", "psnr", "cpu_s", "wall_s", "stop")},
        **{name: figures.get(name, 0.0) for name in ("iou", "largest_px", "mean_px")},
        key=batch.key,
    )


def _sentence(error: BaseException) -> str:
    if isinstance(error, MemoryError):
        return "there is not enough memory for this"
    return " ".join(str(error).split())


def _is_fresh(batch: Batch, picture: Path) -> bool:
    """Whether all files of a picture are there and no older than it."""
    try:
        born = picture.stat().st_mtime
        return all(output.stat().st_mtime >= born for output in batch.outputs(picture))
    except OSError:
        return False


def _kept(batch: Batch) -> dict[str, Row]:
    """Rows of an earlier run with the same settings, by the stem of the picture; none where the table is unusable."""
    names = {f.name for f in fields(Row)}
    try:
        listed = json.loads((batch.out / TABLE).read_text(encoding="utf-8"))["rows"]
        rows = [Row(**entry) for entry in listed if set(entry) == names]
    except (OSError, ValueError, TypeError, KeyError):
        return {}
    return {Path(row.picture).stem: row for row in rows if row.status in (DONE, SKIPPED) and row.key == batch.key}


def _write(batch: Batch, rows: Sequence[Row]) -> None:
    """Both tables, whole or not at all."""
    entries = [asdict(row) for row in rows]
    settings = {**batch.options, **{name: value for name, value in asdict(batch.finish).items() if value}}
    text = {"d4cad": __version__, "settings": settings, "rows": entries}
    with replacing(batch.out / TABLE) as temporary:
        temporary.write_text(json.dumps(text, indent=1) + "\n", encoding="utf-8")
    stream = StringIO()
    sheet = csv.DictWriter(stream, [f.name for f in fields(Row) if f.name != "key"], extrasaction="ignore")
    sheet.writeheader()
    sheet.writerows(entries)
    with replacing(batch.out / SHEET) as temporary:
        temporary.write_text(stream.getvalue(), encoding="utf-8", newline="")
