"""The trained prior: its training, its weights, what it knows of words."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch

from d4cad.errors import InputError
from d4cad.priors.learned import condition, learned
from d4cad.priors.library import shipped
from d4cad.priors.network import SIDE, scales
from d4cad.priors.train import Course, train
from d4cad.priors.weights import read_weights, write_weights

NAMES = ("star", "heart", "flower-tulip")


@pytest.fixture(scope="module")
def weights(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Of two steps on three silhouettes: enough for anything but pictures."""
    folder = tmp_path_factory.mktemp("learned")
    train(Course.of(shipped(), NAMES), folder, steps=2, batch=4, peak=1e-3, seed=0, device="cpu")
    return folder / "learned.safetensors"


def test_a_run_that_was_ended_goes_on_as_it_would_have(
    weights: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    course = Course.of(shipped(), NAMES)

    def ended(*given: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr("d4cad.priors.train.save", ended)
        with pytest.raises(KeyboardInterrupt):
            train(course, tmp_path, steps=2, batch=4, peak=1e-3, seed=0, device="cpu", every=1)
    assert torch.load(tmp_path / "checkpoint.pt", weights_only=True)["step"] == 1
    train(course, tmp_path, steps=2, batch=4, peak=1e-3, seed=0, device="cpu")
    assert (tmp_path / "learned.safetensors").read_bytes() == weights.read_bytes()


def test_samples_are_silhouettes_with_their_words() -> None:
    course = Course.of(shipped(), NAMES)
    assert course.vocabulary == ("flower", "heart", "star", "tulip")
    pictures, weight = course.batch(64, np.random.default_rng(0))
    assert pictures.shape == (64, 1, SIDE, SIDE)
    assert float(pictures.min()) >= -1 - 1e-6
    assert float(pictures.max()) <= 1 + 1e-6
    assert torch.allclose(weight.sum(1), torch.ones(64))
    stars = [(picture[0].numpy() + 1) / 2 for picture, row in zip(pictures, weight, strict=True) if row[2] == 1]
    share = shipped().picture("star").mean()
    assert len(stars) > 5
    assert np.mean([star.mean() for star in stars]) == pytest.approx(share, rel=0.25)


def test_noise_and_picture_follow_from_v(weights: Path) -> None:
    prior = learned("star", "heart", weights)
    noisy = np.random.default_rng(0).standard_normal((2, *prior.shape))
    noise = prior.noise(noisy, 0.4, ["star", "heart"])
    alpha, sigma = prior.scales(0.4)
    assert (alpha, sigma) == pytest.approx([float(part) for part in scales(torch.tensor(0.4))])
    rows = torch.tensor(np.array([prior.conditions["star"], prior.conditions["heart"]])).float()
    with torch.no_grad():
        v = prior.network(torch.tensor(noisy).float(), torch.full((2,), 0.4), rows).double().numpy()
    assert noise == pytest.approx(sigma * noisy + alpha * v, abs=1e-5)
    assert alpha * noise - sigma * (noisy - sigma * noise) / alpha == pytest.approx(v, abs=1e-4)


def test_prompts_are_means_of_words() -> None:
    vocabulary = ["cloud", "heart", "house", "moon"]
    assert condition("a heart", vocabulary).tolist() == [0, 1, 0, 0, 0]
    assert condition("clouds moon", vocabulary).tolist() == [0.5, 0, 0, 0.5, 0]
    assert condition("home", vocabulary).tolist() == [0, 0, 1, 0, 0]
    with pytest.raises(InputError, match=r"does not know 'haert': did you mean heart"):
        condition("haert", vocabulary)
    with pytest.raises(InputError, match="the prompt is empty"):
        condition(" ", vocabulary)


def test_weights_of_another_network_are_refused(weights: Path, tmp_path: Path) -> None:
    arrays, facts = read_weights(weights)
    path = tmp_path / "w.safetensors"
    write_weights(path, {**arrays, "leave.weight": arrays["leave.weight"][:2]}, facts)
    with pytest.raises(InputError, match=r"expected leave\.weight of shape \(4, 56, 3, 3\), got \(2, 56, 3, 3\)"):
        learned("star", path=path)
    write_weights(path, {name: array for name, array in arrays.items() if name != "leave.bias"}, facts)
    with pytest.raises(InputError, match=r"expected leave\.bias of shape \(4,\), got None"):
        learned("star", path=path)
    write_weights(path, arrays, {})
    with pytest.raises(InputError, match="name no words"):
        learned("star", path=path)
    write_weights(path, {**arrays, "leave.bias": arrays["leave.bias"] * np.float16(np.nan)}, facts)
    with pytest.raises(InputError, match=r"not finite in leave\.bias"):
        learned("star", path=path)
    path.write_bytes(weights.read_bytes()[:5000])
    with pytest.raises(InputError, match="not a whole safetensors file"):
        learned("star", path=path)
    with pytest.raises(InputError, match="cannot use the device 'nowhere'"):
        learned("star", path=weights, device="nowhere")
