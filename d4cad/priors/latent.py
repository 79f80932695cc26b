"""Stable Diffusion as a denoiser, through diffusers and transformers (extra "sds").

Works with pipelines of a U-Net, an autoencoder and one text encoder: Stable Diffusion 1.x and 2.x and their kin.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from math import sqrt
from pathlib import Path
from typing import Any

import numpy as np

from d4cad.errors import InputError
from d4cad.objectives.distillation import Encoded
from d4cad.program import Floats

MODULES = ("unet", "vae", "text_encoder", "tokenizer", "scheduler")

AT_ONCE = 8
"""Most codes that the U-Net is given at once."""


@dataclass(frozen=True, slots=True, eq=False)
class LatentDenoiser:
    """A latent text-to-image pipeline.

    A picture is shown black on white, as the paper does. Time t in (0, 1) is the step of the pipeline's own schedule
    nearest to t times their number. at_once: most codes that the U-Net is given at once.
    """

    pipeline: Any
    device: str
    dtype: Any
    at_once: int = AT_ONCE
    told: dict[str, Any] = field(default_factory=dict)
    bounded: bool = False

    @property
    def factor(self) -> int:
        """Pixels along the picture for one of a code."""
        return int(2 ** (len(self.pipeline.vae.config.block_out_channels) - 1))

    @property
    def size(self) -> int:
        """Pixels along a picture."""
        return int(self.pipeline.unet.config.sample_size) * self.factor

    @property
    def shape(self) -> tuple[int, ...]:
        """(channels, size / factor, size / factor)."""
        side = int(self.pipeline.unet.config.sample_size)
        return int(self.pipeline.unet.config.in_channels), side, side

    def step(self, time: float) -> int:
        """The step of the schedule."""
        count = len(self.pipeline.scheduler.alphas_cumprod)
        return min(max(round(time * count), 0), count - 1)

    def scales(self, time: float) -> tuple[float, float]:
        """Square roots of the schedule's cumulative product and of 1 less that."""
        product = float(self.pipeline.scheduler.alphas_cumprod[self.step(time)])
        return sqrt(product), sqrt(1 - product)

    def encode(self, pictures: Floats, noise: Floats) -> Encoded:
        """The autoencoder's mean, and its deviation times ``noise``, scaled as its configuration has it."""
        import torch

        with enough_memory():
            shown = torch.from_numpy(1 - 2 * pictures[:, ::-1].copy()).to(self.device, self.dtype).requires_grad_()
            seen = self.pipeline.vae.encode(shown[:, None].expand(-1, 3, -1, -1)).latent_dist
            drawn = torch.from_numpy(noise).to(self.device, self.dtype)
            codes = (seen.mean + seen.std * drawn) * self.pipeline.vae.config.scaling_factor

        def pull_back(gradient: Floats) -> Floats:
            with enough_memory():
                # a half-precision gradient of mean squares would vanish
                size = float(np.abs(gradient).max()) or 1.0
                wanted = torch.from_numpy(gradient / size).to(self.device, self.dtype)
                (back,) = torch.autograd.grad(codes, shown, wanted, retain_graph=True)
            return np.asarray(-2 * size * back.double().cpu().numpy()[:, ::-1])

        return Encoded(codes.detach().double().cpu().numpy(), pull_back)

    def noise(self, noisy: Floats, time: float, prompts: Sequence[str]) -> Floats:
        """What the U-Net takes for noise, whatever its configuration has it predict."""
        import torch

        alpha, sigma = self.scales(time)
        found = []
        with enough_memory(), torch.no_grad():
            for first in range(0, len(noisy), self.at_once):
                part = slice(first, first + self.at_once)
                told = torch.cat([self.embedding(prompt) for prompt in prompts[part]])
                codes = torch.from_numpy(noisy[part]).to(self.device, self.dtype)
                step = torch.tensor(self.step(time), device=self.device)
                found.append(self.pipeline.unet(codes, step, encoder_hidden_states=told).sample.double().cpu().numpy())
        predicted = np.concatenate(found)
        return AS_NOISE[self.pipeline.scheduler.config.prediction_type](predicted, noisy, alpha, sigma)

    def embedding(self, prompt: str) -> Any:
        """The text encoder's (1, tokens, width) for a prompt, computed once."""
        if prompt not in self.told:
            tokenizer = self.pipeline.tokenizer
            tokens = tokenizer(
                prompt, padding="max_length", max_length=tokenizer.model_max_length, truncation=True,
                return_tensors="pt",
            )  # fmt: skip
            self.told[prompt] = self.pipeline.text_encoder(tokens.input_ids.to(self.device))[0].to(self.dtype)
        return self.told[prompt]


AS_NOISE: dict[str, Callable[[Floats, Floats, float, float], Floats]] = {
    "epsilon": lambda predicted, noisy, alpha, sigma: predicted,
    "v_prediction": lambda predicted, noisy, alpha, sigma: alpha * predicted + sigma * noisy,
    "sample": lambda predicted, noisy, alpha, sigma: (noisy - alpha * predicted) / sigma,
}
"""Noise from what a U-Net predicts: that itself, v = alpha noise - sigma code, or the code."""


@contextmanager
def enough_memory() -> Iterator[None]:
    """Turns a device's want of memory into an InputError."""
    import torch

    try:
        yield
    except (torch.OutOfMemoryError, MemoryError) as error:
        said = str(error).splitlines()[0] if str(error) else "allocation failed"
        raise InputError(f"there is not enough memory for this pipeline: {said}") from None


def latent(where: str, device: str = "cpu", dtype: str | None = None) -> LatentDenoiser:
    """The pipeline in a local folder, or of that name on the Hugging Face hub.

    dtype: float32, float16 or bfloat16; None for float16 on a CUDA device and float32 elsewhere. Raises InputError
    without diffusers and transformers, for weights that are missing or damaged or cannot be fetched, for pipelines of
    another kind, and where memory is short.
    """
    try:
        import diffusers
        import torch
        import transformers
    except ImportError as error:
        raise InputError(f"Stable Diffusion needs {error.name}: pip install 'd4cad[sds]'") from None
    kinds = {"float32": torch.float32, "float16": torch.float16, "bfloat16": torch.bfloat16}
    if dtype is not None and dtype not in kinds:
        raise InputError(f"there is no dtype {dtype!r}, expected one of: {', '.join(kinds)}")
    chosen = kinds[dtype or ("float16" if device.startswith("cuda") else "float32")]
    folder = Path(where)
    if (folder.exists() or where.startswith((".", "/", "~"))) and not (folder / "model_index.json").is_file():
        raise InputError(f"there is no pipeline in {where}: expected a folder with model_index.json")
    diffusers.logging.set_verbosity_error()
    diffusers.logging.disable_progress_bar()
    transformers.logging.set_verbosity_error()
    transformers.logging.disable_progress_bar()
    try:
        with enough_memory():
            pipeline = diffusers.DiffusionPipeline.from_pretrained(
                where, torch_dtype=chosen, local_files_only=folder.exists(), low_cpu_mem_usage=False
            )
    except InputError:
        raise
    # diffusers, transformers and the hub raise errors of many unrelated types for what is one thing to a user
    except Exception as error:  # noqa: BLE001
        raise InputError(f"cannot load the pipeline {where}: {_sentence(error)}") from None
    _check(pipeline, where)
    pipeline.enable_attention_slicing()
    try:
        with enough_memory():
            for name in MODULES[:3]:
                getattr(pipeline, name).to(device).requires_grad_(False).eval()
    except (RuntimeError, AssertionError) as error:
        raise InputError(f"cannot use the device {device!r}: {_sentence(error)}") from None
    return LatentDenoiser(pipeline, device, chosen)


def _sentence(error: Exception) -> str:
    return " ".join(str(error).split())[:300] or type(error).__name__


def _check(pipeline: Any, where: str) -> None:
    """Raises InputError for a pipeline that :class:`LatentDenoiser` cannot use."""
    missing = [name for name in MODULES if getattr(pipeline, name, None) is None]
    if missing or not hasattr(pipeline.scheduler, "alphas_cumprod"):
        lacks = missing[0] if missing else "a scheduler of noise levels"
        raise InputError(f"{where} is not a Stable Diffusion 1.x or 2.x pipeline: it has no {lacks}")
    unet, vae, text = pipeline.unet.config, pipeline.vae.config, pipeline.text_encoder.config
    if unet.in_channels != vae.latent_channels:
        raise InputError(
            f"{where} has a U-Net of {unet.in_channels} channels and an autoencoder of {vae.latent_channels}: "
            "expected as many"
        )
    if unet.cross_attention_dim != text.hidden_size or unet.addition_embed_type is not None:
        raise InputError(f"{where} is not a Stable Diffusion 1.x or 2.x pipeline: its U-Net expects other text vectors")
    if pipeline.scheduler.config.prediction_type not in AS_NOISE:
        raise InputError(
            f"{where} predicts {pipeline.scheduler.config.prediction_type!r}, expected {', '.join(AS_NOISE)}"
        )
