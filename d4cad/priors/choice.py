"""Priors by the names they have on the command line."""

from __future__ import annotations

from collections.abc import Callable

from d4cad.errors import InputError
from d4cad.objectives.distillation import Denoiser

KINDS = "embedded, learned, learned:FILE or sd:FOLDER"

Chosen = Callable[[int], Denoiser]
"""A denoiser for a seed: some priors know several pictures for a word."""


def chosen(name: str, prompt: str, negative: str = "", device: str = "cpu", dtype: str | None = None) -> Chosen:
    """The prior of that name for a prompt.

    name: "embedded"; "learned", the shipped weights, or "learned:FILE"; "sd:FOLDER" or "sd:NAME", a diffusers pipeline.
    device, dtype: for those that run on torch. Raises InputError for an unknown name, an unknown word, weights or a
    package that is missing.
    """
    kind, _, where = name.partition(":")
    if kind == "embedded" and not where:
        from d4cad.priors.embedded import embedded

        embedded(prompt, negative)  # tells of an unknown word at once
        return lambda seed: embedded(prompt, negative, seed)
    denoiser: Denoiser
    if kind == "learned":
        from d4cad.priors.learned import learned

        denoiser = learned(prompt, negative, where or None, device)
        return lambda seed: denoiser
    if kind == "sd" and where:
        from d4cad.priors.latent import latent

        denoiser = latent(where, device, dtype)
        return lambda seed: denoiser
    raise InputError(f"there is no prior {name!r}, expected {KINDS}")
