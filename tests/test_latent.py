"""Stable Diffusion as a denoiser, on a tiny pipeline of random weights that is built here."""

from __future__ import annotations

import json
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("diffusers", reason='needs the extra "sds": pip install d4cad[sds]')
pytest.importorskip("transformers", reason='needs the extra "sds": pip install d4cad[sds]')

import torch

from d4cad.errors import InputError
from d4cad.objectives.distillation import Distillation, Wish
from d4cad.objectives.views import PAPER
from d4cad.priors.latent import LatentDenoiser, latent
from d4cad.text import fit_text

SIDE = 8
"""Of a code; its pictures are twice as large."""


@pytest.fixture(autouse=True)
def _their_warnings() -> Iterator[None]:
    """What diffusers and transformers deprecate among themselves is not ours to fail for."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


def build(folder: Path, channels: int = 4, prediction: str = "epsilon") -> Path:
    """A pipeline of random weights, saved as Stable Diffusion's are."""
    from diffusers import AutoencoderKL, DDIMScheduler, StableDiffusionPipeline, UNet2DConditionModel
    from transformers import CLIPTextConfig, CLIPTextModel, CLIPTokenizer

    torch.manual_seed(0)
    letters = [*"abcdefghijklmnopqrstuvwxyz", *(f"{c}</w>" for c in "abcdefghijklmnopqrstuvwxyz")]
    tokens = {token: n for n, token in enumerate([*letters, "<|startoftext|>", "<|endoftext|>"])}
    folder.mkdir(parents=True)
    (folder / "vocab.json").write_text(json.dumps(tokens))
    (folder / "merges.txt").write_text("#version: 0.2\n")
    tokenizer = CLIPTokenizer(str(folder / "vocab.json"), str(folder / "merges.txt"), model_max_length=16)
    text = CLIPTextConfig(
        vocab_size=len(tokens), hidden_size=16, intermediate_size=32, num_hidden_layers=1, num_attention_heads=2,
        max_position_embeddings=16, bos_token_id=tokens["<|startoftext|>"], eos_token_id=tokens["<|endoftext|>"],
        pad_token_id=tokens["<|endoftext|>"],
    )  # fmt: skip
    unet = UNet2DConditionModel(
        sample_size=SIDE, in_channels=4, out_channels=4, layers_per_block=1, block_out_channels=(8, 16),
        down_block_types=("DownBlock2D", "CrossAttnDownBlock2D"), up_block_types=("CrossAttnUpBlock2D", "UpBlock2D"),
        cross_attention_dim=16, attention_head_dim=4, norm_num_groups=4,
    )  # fmt: skip
    vae = AutoencoderKL(
        block_out_channels=(8, 8), down_block_types=("DownEncoderBlock2D",) * 2,
        up_block_types=("UpDecoderBlock2D",) * 2, latent_channels=channels,
        norm_num_groups=4, sample_size=2 * SIDE, scaling_factor=0.3,
    )  # fmt: skip
    pipeline = StableDiffusionPipeline(
        vae=vae, text_encoder=CLIPTextModel(text), tokenizer=tokenizer, unet=unet,
        scheduler=DDIMScheduler(prediction_type=prediction), safety_checker=None, feature_extractor=None,
        requires_safety_checker=False,
    )  # fmt: skip
    pipeline.save_pretrained(folder / "pipeline")
    return folder / "pipeline"


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return build(tmp_path_factory.mktemp("sd") / "tiny")


@pytest.fixture(scope="module")
def denoiser(saved: Path) -> LatentDenoiser:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return latent(str(saved))


def test_sizes_and_schedule(denoiser: LatentDenoiser) -> None:
    assert (denoiser.size, denoiser.shape) == (2 * SIDE, (4, SIDE, SIDE))
    betas = np.linspace(0.0001, 0.02, 1000)
    alpha, sigma = denoiser.scales(0.5)
    assert alpha == pytest.approx(np.sqrt(np.prod(1 - betas[:501])), rel=1e-4)
    assert alpha**2 + sigma**2 == pytest.approx(1, abs=1e-6)


def independent(pipeline: Any, coverage: np.ndarray[Any, Any], loss: Any, wish: Wish) -> np.ndarray[Any, Any]:
    """The gradient of DreamFusion's eq. 3 by coverage, in torch from pictures to codes."""
    picture = torch.tensor(coverage, dtype=torch.float32, requires_grad=True)
    shown = (1 - picture).flip(0)[None, None].repeat(1, 3, 1, 1) * 2 - 1
    posterior = pipeline.vae.encode(shown).latent_dist
    drawn, noise = (torch.tensor(part, dtype=torch.float32) for part in (loss.drawn, loss.noise))
    codes = (posterior.mean + posterior.std * drawn) * pipeline.vae.config.scaling_factor
    step = torch.tensor(round(1000 * loss.time))
    noisy = pipeline.scheduler.add_noise(codes, noise, step[None])
    prompts = [wish.negative, wish.prompt]
    told = pipeline.tokenizer(prompts, padding="max_length", max_length=16, return_tensors="pt").input_ids
    with torch.no_grad():
        both = noisy.repeat(2, 1, 1, 1)
        base, wanted = pipeline.unet(both, step, encoder_hidden_states=pipeline.text_encoder(told)[0]).sample
        seen = base + wish.guidance * (wanted - base)
    product = pipeline.scheduler.alphas_cumprod[step]
    weight = product.sqrt() * (1 - product)  # the paper's (SPEC 6)
    codes.backward((weight * (seen - noise)) / codes.numel())
    assert picture.grad is not None
    return np.asarray(picture.grad.numpy())


@pytest.mark.parametrize("time", [0.2, 0.7])
def test_gradient_is_that_of_an_independent_formula(denoiser: LatentDenoiser, time: float) -> None:
    rng = np.random.default_rng(0)
    coverage = rng.random((2 * SIDE, 2 * SIDE))
    wish = Wish("a star", "bad", guidance=30.0, weighting="sds")
    loss = Distillation(denoiser, wish, (time, time), 1).draw(rng)
    expected = independent(denoiser.pipeline, coverage, loss, wish)
    assert np.abs(expected).max() > 1e-6
    assert loss.pull(coverage).gradient == pytest.approx(expected, abs=1e-3 * float(np.abs(expected).max()))


@pytest.mark.parametrize("prediction", ["v_prediction", "sample"])
def test_other_predictions_mean_the_same_noise(saved: Path, prediction: str) -> None:
    """A network whose output is read as v or as the code, against the definitions of those."""
    from d4cad.priors.latent import AS_NOISE

    rng = np.random.default_rng(1)
    code, noise = rng.standard_normal((2, 1, *(4, SIDE, SIDE)))
    alpha, sigma = 0.8, 0.6
    predicted = {"v_prediction": alpha * noise - sigma * code, "sample": code}[prediction]
    assert AS_NOISE[prediction](predicted, alpha * code + sigma * noise, alpha, sigma) == pytest.approx(noise)


def test_codes_are_the_same_in_small_batches(denoiser: LatentDenoiser) -> None:
    noisy = np.random.default_rng(2).standard_normal((5, *denoiser.shape))
    prompts = ["a", "b", "", "a", "c"]
    few = LatentDenoiser(denoiser.pipeline, "cpu", torch.float32, at_once=2)
    assert few.noise(noisy, 0.4, prompts) == pytest.approx(denoiser.noise(noisy, 0.4, prompts), abs=1e-4)


def test_a_prompt_makes_a_part(saved: Path) -> None:
    """End to end, with the paper's views: random weights mean nothing, but every part is a region."""
    (candidate,) = fit_text("star", prior=f"sd:{saved}", steps=15, seed=1)
    assert candidate.fit.outline.area > 0
    assert candidate.fit.settings["guidance"] == 100.0
    assert PAPER.chance > 0


def test_weights_that_are_not_there(tmp_path: Path, saved: Path) -> None:
    with pytest.raises(InputError, match=r"expected a folder with model_index\.json"):
        latent(str(tmp_path / "nothing"))
    import shutil

    shutil.copytree(saved, tmp_path / "broken")
    (weights,) = (tmp_path / "broken" / "unet").glob("*.safetensors")
    weights.write_bytes(weights.read_bytes()[:1000])
    with pytest.raises(InputError, match="cannot load the pipeline"):
        latent(str(tmp_path / "broken"))


def test_codes_of_another_size(tmp_path: Path) -> None:
    folder = build(tmp_path / "odd", channels=3)
    with pytest.raises(InputError, match="a U-Net of 4 channels and an autoencoder of 3"):
        latent(str(folder))


def test_devices_and_dtypes(saved: Path) -> None:
    with pytest.raises(InputError, match="there is no dtype 'int3'"):
        latent(str(saved), dtype="int3")
    with pytest.raises(InputError, match="cannot use the device 'nowhere'"):
        latent(str(saved), device="nowhere")
