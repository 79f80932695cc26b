"""Trains the learned prior on the shipped silhouettes: `python -m d4cad.priors.train`.

Writes weights (safetensors, float16), a checkpoint to go on from, and a log of one JSON line every hundred steps. The
random numbers of a step follow from the seed and the step alone, so that a run which was ended goes on as it would
have.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional as F

from d4cad.files import replacing
from d4cad.priors.library import Library, shipped
from d4cad.priors.network import SIDE, Network, scales
from d4cad.priors.weights import write_weights
from d4cad.priors.words import TRAINED

DROPPED = 0.12
"""Share of samples that are shown without words, which guidance needs."""
WORD_DROPPED = 0.3
"""Share of samples of two words that are shown with one of them."""
PLAIN = 2.0
"""How much more often names of one word are drawn than others."""
TURN, SIZE, SHIFT = math.radians(10), (0.85, 1.1), 0.06
"""Greatest turn, sizes, and greatest shift as a share of half the picture."""
EMA = 0.9995


@dataclass(frozen=True, slots=True, eq=False)
class Course:
    """What is learned. pictures: (n, 1, 2 SIDE, 2 SIDE) coverage, row 0 lowest. words: of each. vocabulary: all."""

    pictures: Tensor
    words: tuple[tuple[int, ...], ...]
    vocabulary: tuple[str, ...]
    chances: np.ndarray[Any, np.dtype[np.float64]]

    @classmethod
    def of(cls, library: Library, names: tuple[str, ...]) -> Course:
        """The course of those names of a library."""
        vocabulary = tuple(sorted({word for name in names for word in name.split("-")}))
        words = tuple(tuple(vocabulary.index(word) for word in name.split("-")) for name in names)
        fine = torch.tensor(np.array([library.picture(name) for name in names]), dtype=torch.float32)[:, None]
        pictures = F.avg_pool2d(fine, fine.shape[-1] // (2 * SIDE))
        chances = np.array([PLAIN if len(found) == 1 else 1.0 for found in words])
        return cls(pictures, words, vocabulary, chances / chances.sum())

    def batch(self, count: int, rng: np.random.Generator) -> tuple[Tensor, Tensor]:
        """Pictures in [-1, 1], (count, 1, SIDE, SIDE), posed at random, and their words' weights."""
        chosen = rng.choice(len(self.words), count, p=self.chances)
        turn = rng.uniform(-TURN, TURN, count)
        size = rng.uniform(*SIZE, count)
        mirror = rng.choice([-1.0, 1.0], count)
        pose = np.zeros((count, 2, 3))
        pose[:, 0, 0], pose[:, 0, 1] = mirror * np.cos(turn), -mirror * np.sin(turn)
        pose[:, 1, 0], pose[:, 1, 1] = np.sin(turn), np.cos(turn)
        pose[:, :, :2] /= size[:, None, None]
        pose[:, :, 2] = rng.uniform(-SHIFT, SHIFT, (count, 2))
        sources = self.pictures[torch.from_numpy(chosen)]
        grid = F.affine_grid(torch.from_numpy(pose).float(), list(sources.shape), align_corners=False)
        posed = F.avg_pool2d(F.grid_sample(sources, grid, align_corners=False), 2)
        weights = torch.zeros(count, len(self.vocabulary) + 1)
        for row, index in enumerate(chosen):
            shown = list(self.words[index])
            if len(shown) > 1 and rng.random() < WORD_DROPPED:
                shown = [shown[rng.integers(len(shown))]]
            if rng.random() < DROPPED:
                shown = [len(self.vocabulary)]
            weights[row, shown] = 1 / len(shown)
        return posed * 2 - 1, weights


def rate(step: int, steps: int, peak: float) -> float:
    """The learning rate: up for 200 steps, then down along a cosine."""
    return peak * min(1.0, (step + 1) / 200) * (0.02 + 0.98 * (1 + math.cos(math.pi * step / steps)) / 2)


def train(
    course: Course, folder: Path, *, steps: int, batch: int, peak: float, seed: int, device: str, every: int = 500
) -> Network:
    """The averaged network after ``steps`` steps; what a checkpoint in ``folder`` has done is not done again."""
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        network = Network(len(course.vocabulary)).to(device)
    mean = Network(len(course.vocabulary)).to(device)
    mean.load_state_dict(network.state_dict())
    optimizer = torch.optim.AdamW(network.parameters(), lr=peak, weight_decay=0.01)
    first, seen, spent = 0, 0.0, 0.0
    saved = folder / "checkpoint.pt"
    if saved.exists():
        state = torch.load(saved, map_location=device, weights_only=True)
        network.load_state_dict(state["network"])
        mean.load_state_dict(state["mean"])
        optimizer.load_state_dict(state["optimizer"])
        first, spent = state["step"], state["seconds"]
    began = time.process_time() - spent
    for step in range(first, steps):
        rng = np.random.default_rng([seed, step])
        pictures, weights = (part.to(device) for part in course.batch(batch, rng))
        moment = torch.from_numpy(rng.uniform(0.001, 0.999, batch)).float().to(device)
        noise = torch.from_numpy(rng.standard_normal(tuple(pictures.shape))).float().to(device)
        alpha, sigma = (part[:, None, None, None] for part in scales(moment))
        with torch.autocast(torch.device(device).type, torch.bfloat16):
            v = network(alpha * pictures + sigma * noise, moment, weights)
        loss = F.mse_loss(v.float(), alpha * noise - sigma * pictures)
        for group in optimizer.param_groups:
            group["lr"] = rate(step, steps, peak)
        optimizer.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        torch.nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        optimizer.step()
        keep = min(EMA, (1 + step) / (10 + step))
        with torch.no_grad():
            for kept, now in zip(mean.parameters(), network.parameters(), strict=True):
                kept.lerp_(now, 1 - keep)
        now_at = float(loss.detach())
        seen = now_at if step == first else 0.98 * seen + 0.02 * now_at
        if (step + 1) % 100 == 0:
            entry = {"step": step + 1, "samples": (step + 1) * batch, "loss": round(seen, 5)}
            entry["cpu_s"] = round(time.process_time() - began, 1)
            with (folder / "log.jsonl").open("a") as log:
                log.write(json.dumps(entry) + "\n")
        if (step + 1) % every == 0 or step + 1 == steps:
            state = {"network": network.state_dict(), "mean": mean.state_dict(), "optimizer": optimizer.state_dict()}
            with replacing(saved) as temporary:
                torch.save({**state, "step": step + 1, "seconds": time.process_time() - began}, temporary)
            save(mean, course, folder / "learned.safetensors", (step + 1) * batch)
    return mean


def save(network: Network, course: Course, path: Path, samples: int) -> None:
    """Write the weights as float16, with the vocabulary and the number of samples seen."""
    arrays = {name: value.cpu().numpy().astype(np.float16) for name, value in network.state_dict().items()}
    write_weights(path, arrays, {"words": " ".join(course.vocabulary), "samples": str(samples)})


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="where weights, checkpoint and log go")
    parser.add_argument("--steps", type=int, default=8000)
    parser.add_argument("--batch", type=int, default=64)
    parser.add_argument("--rate", type=float, default=6e-4)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--threads", type=int, default=1)
    asked = parser.parse_args()
    torch.set_num_threads(asked.threads)
    asked.folder.mkdir(parents=True, exist_ok=True)
    course = Course.of(shipped(), tuple(dict.fromkeys(TRAINED.split())))
    train(
        course, asked.folder, steps=asked.steps, batch=asked.batch, peak=asked.rate, seed=asked.seed,
        device=asked.device,
    )  # fmt: skip


if __name__ == "__main__":
    main()
