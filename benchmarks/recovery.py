"""Recovery of generated shapes from the diamond: how many come back exactly, how fast, and which are the worst.

    python benchmarks/recovery.py [--counts 200 200 100] [--jobs 1] [--seed 0] [--method fast] [--out DIR]

Shapes of three classes (about 8, 40 and 95 primitives) are drawn by `d4cad.shapes.generate`, shape k of a class with
the seed k, and rendered by the paper's raster at 256x256. They are written as `{class}.json` in the neutral format,
so that `d4cad bench` fits them as it fits any other folder.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from d4cad import bench
from d4cad.shapes import generate

CLASSES = {"p08": 8, "p40": 40, "p95": 95}


def write_shapes(folder: Path, counts: Sequence[int]) -> None:
    """One file of shapes for each class."""
    folder.mkdir(parents=True, exist_ok=True)
    for (name, primitives), count in zip(CLASSES.items(), counts, strict=True):
        entries = [
            {"index": k, "loops": generate(np.random.default_rng(k), primitives).to_neutral()} for k in range(count)
        ]
        (folder / f"{name}.json").write_text(json.dumps(entries), encoding="utf-8")


def distribution(rows: Sequence[bench.Row]) -> str:
    """Quantiles of PSNR, of primitives beyond the truth, and of CPU seconds, by class."""
    lines = []
    for name in sorted({row.set for row in rows}):
        part = [row for row in rows if row.set == name]
        columns = {
            "psnr dB": [row.psnr for row in part],
            "primitives - true": [row.primitives - row.true_primitives for row in part],
            "cpu s": [row.cpu_s for row in part],
        }
        for label, values in columns.items():
            quantiles = np.quantile(values, (0, 0.05, 0.25, 0.5, 0.75, 0.95, 1))
            lines.append(f"{name} {label:18s} " + " ".join(f"{q:8.2f}" for q in quantiles))
    return "\n".join(["class, quantity        min    5%    25%    50%    75%    95%    max", *lines])


def worst(rows: Sequence[bench.Row], count: int = 5) -> str:
    """The shapes that are not exact or, among exact ones, were slowest."""
    order = sorted(
        rows, key=lambda row: (row.exact, min(row.psnr, 120.0) - (row.primitives - row.true_primitives), -row.cpu_s)
    )
    return "\n".join(
        f"{row.set}_{row.index:03d}: {row.psnr:.1f} dB, {row.primitives} primitives for {row.true_primitives}, "
        f"{row.cpu_s:.2f} s, {row.stop}"
        for row in order[:count]
    )


def main() -> None:
    parser = argparse.ArgumentParser(description="recovery of generated shapes")
    parser.add_argument("--counts", type=int, nargs=3, default=(200, 200, 100))
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--method", default="fast")
    parser.add_argument("--out", type=Path)
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        out = chosen.out or Path(scratch)
        write_shapes(out / "shapes", chosen.counts)
        rows = bench.run(
            bench.Request(out / "shapes", out / "fits", method=chosen.method, seed=chosen.seed, jobs=chosen.jobs)
        )
    print(bench.table(rows))
    print(distribution(rows))
    print("worst five:", worst(rows), sep="\n")


if __name__ == "__main__":
    main()
