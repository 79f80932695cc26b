"""Parts from words, named by a recogniser that has seen none of the prior's icons.

    python benchmarks/text.py [ICONS] [--prior NAME] [--grammar NAME ...] [--candidates 4] [--words W ...] [--out DIR]

ICONS is a folder with the unpacked npm packages @mdi/svg, @fortawesome/fontawesome-free, bootstrap-icons, remixicon and
ionicons, as `npm pack` fetches them, each in a folder that begins with its name (mdi-svg, fortawesome, ...); nothing of
them is kept. The recogniser is a small convolutional network, trained on those of their filled icons whose names are
classes here, posed at random; the prior's icons (Phosphor) are not among them. For each prompt K candidates are made.
The part that counts is the first by the prior's own ranking ("first"), or the one of the K that the recogniser ranks
best ("best of K"). Without ICONS there are only the parts, their primitives and CPU seconds.
"""

from __future__ import annotations

import argparse
import json
import math
import re
import statistics
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from d4cad.errors import InputError
from d4cad.exporters.sheet import write_sheet
from d4cad.priors.build import outline
from d4cad.priors.library import shipped
from d4cad.priors.words import TRAINED, found
from d4cad.text import Candidate, fit_text

PROMPTS = (
    "horse", "bull", "skull", "wineglass", "cat", "tree", "flower", "dog", "cloth", "car", "boat", "scissor", "heart",
    "man", "bottle", "star", "house", "fish", "key", "lock",
)  # fmt: skip
"""Fifteen of the paper's 24 that the priors know and the other sets have, and five more."""

PACKAGES = {
    "mdi-svg": ("package/svg/*.svg", ""),
    "fortawesome": ("package/svgs/solid/*.svg", ""),
    "bootstrap": ("package/icons/*-fill.svg", "-fill"),
    "remixicon": ("package/icons/*/*-fill.svg", "-fill"),
    "ionicons": ("package/dist/svg/*.svg", ""),
}

OTHER_NAMES: Mapping[str, tuple[str, ...]] = {
    "airplane": ("plane",),
    "beer-bottle": ("bottle-wine", "bottle-soda", "bottle-soda-classic", "wine-bottle", "bottle-tonic"),
    "boat": ("sail-boat", "sailboat", "ferry"),
    "car": ("car-side", "car-front", "car-sport", "car-hatchback"),
    "dog": ("dog-side",),
    "fish": ("fish-fins",),
    "flower": ("flower-tulip", "flower-poppy"),
    "horse": ("horse-head", "horse-variant"),
    "house": ("home", "home-2", "home-variant"),
    "person": ("human", "human-male", "user", "account", "man", "male", "person-standing"),
    "scissors": ("content-cut", "scissors-2", "cut"),
    "skull": ("skull-2", "skull-crossbones"),
    "t-shirt": ("shirt", "tshirt-crew", "tshirt-v", "t-shirt-2"),
    "wine": ("wine-glass", "glass-wine", "goblet", "glass-cocktail", "wine-glass-empty"),
}
"""What the other sets call it."""

SIDE, FILLED = 32, 26
"""Pixels along a picture that is to be recognised, and those that the shape's longer side takes."""


def icons(folder: Path, names: Sequence[str]) -> tuple[list[np.ndarray], list[int]]:
    """Silhouettes (SIDE, SIDE) from the packages, and which of the names each is."""
    pictures, labels = [], []
    for package, (pattern, ending) in PACKAGES.items():
        files = {
            file.stem.removesuffix(ending): file
            for root in sorted(folder.glob(f"{package}*"))
            for file in sorted(root.glob(pattern))
        }
        for label, name in enumerate(names):
            for known in (name, *OTHER_NAMES.get(name, ())):
                if known in files and (shown := rendered(files[known].read_text())) is not None:
                    pictures.append(shown)
                    labels.append(label)
    return pictures, labels


def rendered(svg: str) -> np.ndarray | None:
    """The filled paths of an icon, normalised; None for icons with other elements."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.patches import PathPatch

    box = re.search(r'viewBox="([^"]+)"', svg)
    paths = re.findall(r'<path[^>]*? d="([^"]+)"', svg)
    if box is None or not paths or re.search(r"<(circle|rect|ellipse|line|poly)", svg) or "stroke=" in svg:
        return None
    left, top, width, height = map(float, box[1].split())
    figure = Figure(figsize=(1, 1), dpi=128)
    axes = figure.add_axes((0, 0, 1, 1))
    side = max(width, height)
    axes.set(xlim=(left, left + side), ylim=(top + side, top))
    axes.axis("off")
    for path in paths:
        axes.add_patch(PathPatch(outline(path), facecolor="black", linewidth=0))
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return normal(1 - np.asarray(canvas.buffer_rgba())[::-1, :, 0] / 255)


def normal(coverage: np.ndarray) -> np.ndarray:
    """The shape in the middle of (SIDE, SIDE), its longer side FILLED pixels."""
    from PIL import Image

    rows, columns = np.flatnonzero(coverage.max(1) > 0.5), np.flatnonzero(coverage.max(0) > 0.5)
    if rows.size == 0:
        return np.zeros((SIDE, SIDE))
    cut = coverage[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    factor = FILLED / max(cut.shape)
    size = [max(round(n * factor), 1) for n in cut.shape[::-1]]
    small = np.asarray(Image.fromarray((255 * cut).astype(np.uint8)).resize(size, Image.Resampling.BOX)) / 255
    shown = np.zeros((SIDE, SIDE))
    low, left = ((SIDE - n) // 2 for n in small.shape)
    shown[low : low + small.shape[0], left : left + small.shape[1]] = small
    return shown


def nearest(coverage: np.ndarray) -> tuple[str, float]:
    """The silhouette of the library that a shape is most like, and the intersection over union; mirrored or not."""
    shown = normal(coverage)
    names, known = silhouettes()
    shares = np.max(
        [np.minimum(known, way).sum((1, 2)) / np.maximum(known, way).sum((1, 2)) for way in (shown, shown[:, ::-1])],
        axis=0,
    )
    return names[int(shares.argmax())], round(float(shares.max()), 3)


@cache
def silhouettes() -> tuple[tuple[str, ...], np.ndarray]:
    """The library, normalised (n, SIDE, SIDE)."""
    return shipped().names, np.array([normal(picture.astype(float)) for picture in shipped().pictures])


class Recogniser:
    """A convolutional network that names silhouettes."""

    def __init__(self, pictures: Sequence[np.ndarray], labels: Sequence[int], classes: int, steps: int) -> None:
        import torch
        from torch import nn
        from torch.nn import functional as F

        torch.manual_seed(0)
        torch.set_num_threads(1)

        def layer(before: int, after: int) -> list[nn.Module]:
            return [nn.Conv2d(before, after, 3, padding=1), nn.BatchNorm2d(after), nn.ReLU(), nn.MaxPool2d(2)]

        self.network = nn.Sequential(
            *layer(1, 24), *layer(24, 48), *layer(48, 96), nn.Flatten(), nn.Dropout(0.4), nn.Linear(96 * 16, classes)
        )
        shown, named = torch.tensor(np.array(pictures))[:, None].float(), torch.tensor(labels)
        counts = torch.bincount(named, minlength=classes).float()
        optimizer = torch.optim.AdamW(self.network.parameters(), 2e-3, weight_decay=0.02)
        schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, steps)
        for _ in range(steps):
            index = torch.multinomial(1 / counts[named], 128, replacement=True)
            turn, size = (torch.rand(128) - 0.5) * 0.5, 1 + (torch.rand(128, 2) - 0.5) * 0.4
            mirror = torch.where(torch.rand(128) < 0.5, -1.0, 1.0)
            pose = torch.zeros(128, 2, 3)
            pose[:, 0, 0], pose[:, 0, 1] = mirror * turn.cos() * size[:, 0], -mirror * turn.sin() * size[:, 0]
            pose[:, 1, 0], pose[:, 1, 1] = turn.sin() * size[:, 1], turn.cos() * size[:, 1]
            pose[:, :, 2] = (torch.rand(128, 2) - 0.5) * 0.2
            batch = F.grid_sample(
                shown[index], F.affine_grid(pose, [128, 1, SIDE, SIDE], align_corners=False), align_corners=False
            )
            bumps = F.interpolate(torch.randn(128, 1, 8, 8), size=SIDE, mode="bilinear") * 0.3
            batch = (batch + bumps * (F.max_pool2d(batch, 3, 1, 1) + F.max_pool2d(-batch, 3, 1, 1))).clamp(0, 1)
            loss = F.cross_entropy(self.network(batch), named[index], label_smoothing=0.05)
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
            schedule.step()
        self.network.eval()

    def ranks(self, pictures: Sequence[np.ndarray], label: int) -> list[int]:
        """The place of a class among all for each picture, 0 the first."""
        import torch

        with torch.no_grad():
            scores = self.network(torch.tensor(np.array(pictures))[:, None].float())
        return [int((row > row[label]).sum()) for row in scores]


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("icons", type=Path, nargs="?")
    parser.add_argument("--prior", default="embedded")
    parser.add_argument("--grammar", nargs="+", default=["arc-line", "union-rect"])
    parser.add_argument("--candidates", type=int, default=4)
    parser.add_argument("--words", nargs="+", default=PROMPTS)
    parser.add_argument("--steps", type=int, default=1500, help="of the recogniser's training")
    parser.add_argument("--out", type=Path)
    asked = parser.parse_args()
    judge, classes = None, []
    if asked.icons is not None:
        wanted = list(dict.fromkeys([*map(class_of, asked.words), *TRAINED.split()]))
        pictures, labels = icons(asked.icons, wanted)
        counts = np.bincount(labels, minlength=len(wanted))
        kept = [n for n in range(len(wanted)) if counts[n] >= 2 or (counts[n] and n < len(asked.words))]
        classes = [wanted[n] for n in kept]
        pictures = [picture for picture, label in zip(pictures, labels, strict=True) if label in kept]
        labels = [kept.index(label) for label in labels if label in kept]
        judge = Recogniser(pictures, labels, len(classes), asked.steps)
        print(f"recogniser: {len(pictures)} icons, {len(classes)} classes; chance {chance(len(classes))}")
        own = [judge.ranks([normal(shipped().picture(name).astype(float))], n)[0] for n, name in enumerate(classes)]
        print(f"the prior's own icons, all classes: {shares(own)}")
    for grammar in asked.grammar:
        report(asked, grammar, judge, classes)


def class_of(word: str) -> str:
    """The silhouette that a prompt means, or the prompt itself: a trained prior takes several words at once."""
    try:
        return found(word, shipped().names)
    except InputError:
        return word


def report(asked: Any, grammar: str, judge: Recogniser | None, classes: Sequence[str]) -> None:
    """Make the parts of a grammar and print what became of them."""
    first, best, numbers, seconds = [], [], [], []
    sheet: list[Candidate] = []
    rows: list[dict[str, Any]] = []
    for word in asked.words:
        made = fit_text(word, grammar=grammar, prior=asked.prior, candidates=asked.candidates)
        seconds += [one.fit.seconds for one in made]
        numbers.append(made[0].fit.primitives)
        name, shown = class_of(word), made[0]
        row: dict[str, Any] = {"word": word, "primitives": numbers[-1], "score": made[0].score, "seed": made[0].seed}
        row["nearest"] = nearest(made[0].fit.coverage)
        if judge is not None and name in classes:
            ranks = judge.ranks([normal(one.fit.coverage) for one in made], classes.index(name))
            first.append(ranks[0])
            best.append(min(ranks))
            shown = made[ranks.index(min(ranks))]
            row |= {"ranks": ranks}
        print(json.dumps(row), flush=True)
        rows.append(row)
        sheet.append(shown)
    print(f"{asked.prior}, {grammar}: {len(asked.words)} prompts, at most {max(numbers)} primitives, median "
          f"{statistics.median(numbers):g}; median {statistics.median(seconds):.1f} CPU s a candidate")  # fmt: skip
    alike = [row["nearest"][1] for row in rows]
    print(f"  intersection over union with the nearest of all silhouettes: median {statistics.median(alike):.2f}, "
          f"{min(alike):.2f} to {max(alike):.2f}")  # fmt: skip
    if judge is not None and first:
        print(f"  first by the prior's ranking: {shares(first)}")
        print(f"  best of {asked.candidates}: {shares(best)}")
    if asked.out is not None:
        asked.out.mkdir(parents=True, exist_ok=True)
        stem = asked.out / f"{asked.prior.split(':')[0]}-{grammar}"
        captions = [f"{word}, {one.fit.primitives}" for word, one in zip(asked.words, sheet, strict=True)]
        write_sheet(stem.with_suffix(".png"), [one.fit.outline for one in sheet], captions, columns=7)
        stem.with_suffix(".json").write_text(json.dumps(rows, indent=1))


def shares(ranks: Sequence[int]) -> str:
    """Top-1 and top-5 shares, with 95% Wilson intervals of the second."""
    n, one, five = len(ranks), sum(rank < 1 for rank in ranks), sum(rank < 5 for rank in ranks)
    share, z = five / n, 1.96
    middle, half = (share + z * z / 2 / n) / (1 + z * z / n), z * math.sqrt(share * (1 - share) / n + z * z / 4 / n / n)
    low, high = (middle - half / (1 + z * z / n), middle + half / (1 + z * z / n))
    return f"top-1 {one}/{n} = {one / n:.2f}, top-5 {five}/{n} = {share:.2f} ({low:.2f} to {high:.2f})"


def chance(classes: int) -> str:
    """What guessing reaches."""
    return f"top-1 {1 / classes:.3f}, top-5 {5 / classes:.3f}"


if __name__ == "__main__":
    main()
