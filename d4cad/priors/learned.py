"""The trained prior: a small diffusion model of silhouettes, made by d4cad.priors.train."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import as_file, files
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from d4cad.errors import InputError
from d4cad.objectives.distillation import Encoded
from d4cad.priors.pixels import cosine, encoded
from d4cad.priors.weights import Arrays, read_weights
from d4cad.priors.words import aliased, forms, normal, suggestions
from d4cad.program import Floats

if TYPE_CHECKING:
    from d4cad.priors.network import Network

SHIPPED = "learned.safetensors"


@dataclass(frozen=True, slots=True, eq=False)
class LearnedDenoiser:
    """The network of :mod:`d4cad.priors.network`: a picture's code is 2 coverage - 1, the schedule is the cosine's.

    conditions: for each prompt how much of each word's vector, (words + 1,).
    """

    network: Network
    conditions: Mapping[str, Floats]
    device: str = "cpu"
    bounded: bool = True

    @property
    def size(self) -> int:
        """Pixels along a picture."""
        from d4cad.priors.network import SIDE

        return SIDE

    @property
    def shape(self) -> tuple[int, ...]:
        """(1, size, size)."""
        return 1, self.size, self.size

    def scales(self, time: float) -> tuple[float, float]:
        """Those of the cosine schedule."""
        return cosine(time)

    def encode(self, pictures: Floats, noise: Floats) -> Encoded:
        """2 pictures - 1, with nothing drawn."""
        return encoded(pictures)

    def noise(self, noisy: Floats, time: float, prompts: Sequence[str]) -> Floats:
        """sigma noisy + alpha v. Raises InputError for a prompt that it was not made for."""
        import torch

        missing = [prompt for prompt in prompts if prompt not in self.conditions]
        if missing:
            raise InputError(f"this prior was made for {', '.join(map(repr, self.conditions))}, not for {missing[0]!r}")
        alpha, sigma = self.scales(time)
        weights = np.array([self.conditions[prompt] for prompt in prompts])
        with torch.no_grad():
            v = self.network(
                torch.from_numpy(noisy).float().to(self.device),
                torch.full((len(noisy),), time, device=self.device),
                torch.from_numpy(weights).float().to(self.device),
            )
        return np.asarray(sigma * noisy + alpha * v.cpu().double().numpy())


def learned(prompt: str, negative: str = "", path: str | Path | None = None, device: str = "cpu") -> LearnedDenoiser:
    """The denoiser of the shipped weights or those of a file.

    A prompt may have several words, whose mean it is: "cloud moon". Raises InputError for an empty prompt or a word
    that the weights do not know, for weights that are missing, damaged or of another network, and without torch.
    """
    try:
        import torch
    except ImportError:
        raise InputError("the learned prior needs torch: pip install 'd4cad[torch]'") from None
    from d4cad.priors.network import Network

    if path is None:
        with as_file(files("d4cad.priors") / SHIPPED) as shipped:
            arrays, facts = read_weights(shipped)
    else:
        arrays, facts = read_weights(path)
    where = "the shipped weights" if path is None else str(path)
    vocabulary = facts.get("words", "").split()
    if not vocabulary:
        raise InputError(f"{where} name no words, expected weights from d4cad.priors.train")
    conditions = {text: condition(text, vocabulary) for text in {prompt, negative} if text.strip()}
    conditions[prompt] = condition(prompt, vocabulary)
    conditions.setdefault(negative, np.eye(len(vocabulary) + 1)[-1])
    network = Network(len(vocabulary))
    _check(arrays, network.state_dict(), where)
    network.load_state_dict({name: torch.from_numpy(value.astype(np.float32)) for name, value in arrays.items()})
    try:
        network = network.to(device).eval()
    except (RuntimeError, AssertionError) as error:
        raise InputError(f"cannot use the device {device!r}: {str(error).splitlines()[0]}") from None
    return LearnedDenoiser(network, conditions, device)


def _check(arrays: Arrays, expected: Mapping[str, Any], where: str) -> None:
    for name in sorted(expected.keys() | arrays.keys()):
        shape = tuple(expected[name].shape) if name in expected else None
        found = arrays[name].shape if name in arrays else None
        if shape != found:
            raise InputError(f"{where} is not of this network: expected {name} of shape {shape}, got {found}")
        if not np.isfinite(arrays[name]).all():
            raise InputError(f"{where} has numbers that are not finite in {name}")


def condition(prompt: str, vocabulary: Sequence[str]) -> Floats:
    """How much of each word's vector a prompt is, (words + 1,): the mean of those of its words.

    Raises InputError for an empty prompt or an unknown word.
    """
    word = normal(prompt)
    found = np.zeros(len(vocabulary) + 1)
    for part in aliased(word).split("-"):
        for form in [form for known in forms(part) for form in aliased(known).split("-")]:
            if form in vocabulary:
                found[vocabulary.index(form)] += 1
                break
        else:
            close = suggestions(part, vocabulary, {})
            hint = f": did you mean {' or '.join(close)}?" if close else ""
            raise InputError(f"the learned prior does not know {part!r}{hint}")
    return np.asarray(found / found.sum())
