"""The tables as Markdown and JSON."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from d4cad.files import replacing
from d4cad.tables.published import PAPER
from d4cad.tables.sets import TWINS
from d4cad.tables.settings import ABLATIONS, FAMILIES, FULL_VARIANTS
from d4cad.tables.summing import LEAST, MOST, SAME, TIE, Cell, Claim

NAME = "tables"
"""Stem of the files."""

Found = Mapping[tuple[str, str, str], Cell]


def write(out: Path, facts: Mapping[str, Any], found: Sequence[Cell], orders: Sequence[Claim]) -> list[Path]:
    """Write tables.json and tables.md to the folder; ``facts``: what was run. Returns the files' paths.

    Raises ExportError.
    """
    out.mkdir(parents=True, exist_ok=True)
    document = {"run": dict(facts), "cells": [asdict(c) for c in found], "orders": [asdict(c) for c in orders]}
    texts = {
        out / f"{NAME}.json": json.dumps(document, indent=1) + "\n",
        out / f"{NAME}.md": markdown(facts, found, orders),
    }
    for path, text in texts.items():
        with replacing(path) as temporary:
            temporary.write_text(text, encoding="utf-8")
    return list(texts)


def markdown(facts: Mapping[str, Any], found: Sequence[Cell], orders: Sequence[Claim]) -> str:
    """All tables, the paper's figures beside ours, and its orders in words."""
    sets = list(dict.fromkeys(cell.set for cell in found))
    methods = list(dict.fromkeys(cell.method for cell in found))
    rows = list(dict.fromkeys(cell.row for cell in found))
    at = {(cell.method, cell.row, cell.set): cell for cell in found}
    ablated = [row for row in rows if " " in row]
    table_3 = [row for full in FULL_VARIANTS for row in _named(rows, full, ("NoStep", "OneRewrite", "Full"))]
    fixed = [row for full in FULL_VARIANTS for row in _named(rows, full, ("Fixed", "Fixed+OneRewrite"))]
    twins = ", ".join(f"{name} like {TWINS[name]}" for name in sets if name in TWINS)
    parts = [
        "# The paper's tables",
        f"By `{facts['command']}`, {facts['fits']} fits in {facts['cpu_s']:.0f} CPU seconds. {facts['note']}".strip(),
        f"256x256 in the paper's raster, from the grammars' axioms. PSNR in dB, a fit counted as {MOST:.0f} at most;"
        " time in CPU seconds of one core, the paper's on its authors' machine. `paper`: the publication's settings,"
        " with our repair and rewrites; `fast`: ours; *-all*: with all our rewrites."
        + (f" Sets of our own: {twins}." if twins else ""),
        "## Table 2: PSNR / primitives",
        _table(at, methods, sets, [row for row in rows if row not in ablated], _psnr_primitives),
        "## Table 3: PSNR / seconds",
        _table(at, methods, sets, table_3, _psnr_seconds),
        "## Fixed steps: PSNR / primitives",
        "A constant rate (Arc-Line 0.05, Union-Rect 0.02) for `paper`, a constant damping for `fast`.",
        _table(at, methods, sets, fixed, _psnr_primitives),
        "## Spread",
        "Mean with its 95 % confidence interval over shapes (bootstrap; seeds averaged first); *of mean*: the PSNR of"
        " the mean squared error of all fits.",
        _spread(found),
        "## The paper's orders",
        "Differences of PSNR, shape by shape, with their 95 % confidence intervals. An order is *confirmed* or"
        f" *refuted* where zero lies outside, on {LEAST} shapes or more; a published difference under {TIE:g} dB is a"
        f" tie, which ours is if the interval lies within {SAME:g} dB of zero. Where the paper's figure is not at hand"
        " the claim is that the first is better.",
        _orders(orders),
        in_words(orders),
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def _named(rows: Sequence[str], full: str, names: Sequence[str]) -> list[str]:
    wanted = [full if name == "Full" else f"{full} {name}" for name in names]
    assert set(names) <= set(ABLATIONS)
    return [row for row in wanted if row in rows]


def _psnr_primitives(cell: Cell) -> str:
    return f"{cell.mean:.1f} / {cell.primitives:.0f}"


def _psnr_seconds(cell: Cell) -> str:
    return f"{cell.mean:.1f} / {cell.seconds:.2f}"


def _published(row: str, name: str, *, timed: bool) -> str:
    figures = PAPER.get(row, {}).get(TWINS.get(name, name))
    if figures is None:
        return "-"
    other = figures.seconds if timed else figures.primitives
    return f"{figures.psnr:.1f}" + ("" if other is None else f" / {other:.0f}")


def _table(at: Found, methods: Sequence[str], sets: Sequence[str], rows: Sequence[str], show: Any) -> str:
    if not rows:
        return ""
    timed = show is _psnr_seconds
    heads = [f"{name}: {column}" for name in sets for column in ("the paper", *methods)]
    lines = [["", *heads], ["---"] * (1 + len(heads))]
    for row in rows:
        line = [row]
        for name in sets:
            line.append(_published(row, name, timed=timed))
            line += [show(at[key]) if (key := (method, row, name)) in at else "-" for method in methods]
        lines.append(line)
    return _lines(lines)


def _spread(found: Sequence[Cell]) -> str:
    heads = [
        "method", "row", "set", "shapes", "seeds", "failed", "mean", "95 %", "median", "worst", "of mean",
        "primitives", "true", "CPU s mean", "median", "worst",
    ]  # fmt: skip
    lines = [heads, ["---"] * len(heads)]
    for cell in found:
        lines.append(
            [
                cell.method, cell.row, cell.set, str(cell.shapes), str(cell.seeds), str(cell.failed),
                f"{cell.mean:.1f}", f"{cell.low:.1f} to {cell.high:.1f}", f"{cell.median:.1f}", f"{cell.worst:.1f}",
                f"{cell.of_mean:.1f}", f"{cell.primitives:.1f}", f"{cell.true_primitives:.1f}", f"{cell.seconds:.2f}",
                f"{cell.median_s:.2f}", f"{cell.worst_s:.2f}",
            ]
        )  # fmt: skip
    return _lines(lines)


def _orders(orders: Sequence[Claim]) -> str:
    lines = [["method", "set", "order", "the paper's dB", "ours", "95 %", ""], ["---"] * 7]
    for claim in orders:
        published = "-" if claim.published is None else f"{claim.published:+.1f}"
        lines.append(
            [
                claim.method, claim.set, f"{claim.better} over {claim.worse}", published, f"{claim.difference:+.1f}",
                f"{claim.low:+.1f} to {claim.high:+.1f}", claim.verdict,
            ]
        )  # fmt: skip
    return _lines(lines) if orders else ""


def in_words(orders: Sequence[Claim]) -> str:
    """One sentence for each method and order: on which sets it is confirmed, refuted or undecided."""
    groups: dict[tuple[str, str, str], dict[str, list[str]]] = {}
    for claim in orders:
        verdicts = groups.setdefault((claim.method, claim.better, claim.worse), {})
        tied = claim.published is not None and abs(claim.published) < TIE
        verdicts.setdefault(claim.verdict, []).append(claim.set + (" (a tie in the paper)" if tied else ""))
    lines = []
    for method in dict.fromkeys(key[0] for key in groups):
        lines.append(f"**{method}**\n")
        for (of, better, worse), verdicts in groups.items():
            if of == method:
                told = "; ".join(f"{word} on {', '.join(sets)}" for word, sets in verdicts.items())
                lines.append(f"- {better} over {worse}: {told}.")
        lines.append("")
    return "\n".join(lines).strip()


def _lines(lines: Sequence[Sequence[str]]) -> str:
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def families(rows: Sequence[str]) -> list[str]:
    """The grammars' letters that occur among rows, in their own order."""
    return [family for family in FAMILIES if any(row.startswith(f"{family}-") for row in rows)]
