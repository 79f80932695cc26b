"""Priors: the best denoiser of a finite set against sampling, the library, words, weights."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from d4cad.errors import InputError
from d4cad.objectives.distillation import Distillation, Wish
from d4cad.priors.choice import chosen
from d4cad.priors.embedded import VARIANTS, embedded
from d4cad.priors.finite import FiniteDenoiser
from d4cad.priors.library import SIDE, Library, packed, shipped, unpacked
from d4cad.priors.weights import read_weights, write_weights
from d4cad.priors.words import ALIASES, TRAINED, found

ARRAYS: dict[str, np.ndarray[Any, np.dtype[Any]]] = {
    "b": np.arange(6.0).reshape(2, 3).astype(np.float16),
    "a": np.array([1.5], np.float32),
}


def test_noise_is_what_sampling_gives() -> None:
    """The mean noise of those samples that come out at a value, by drawing millions of one-pixel pictures."""
    pictures = np.array([[-1.0], [0.4], [1.0]])
    denoiser = FiniteDenoiser(1, {"any": pictures})
    rng = np.random.default_rng(0)
    noise, index = rng.standard_normal(4_000_000), rng.integers(0, 3, 4_000_000)
    for time in (0.3, 0.6, 0.9):
        alpha, sigma = denoiser.scales(time)
        noisy = alpha * pictures[index, 0] + sigma * noise
        for at in (-0.8, 0.1, 0.7):
            near = np.abs(noisy - at) < 0.01
            error = noise[near].std() / np.sqrt(near.sum())
            predicted = denoiser.noise(np.array([[[[at]]]]), time, ["any"])[0, 0, 0, 0]
            assert predicted == pytest.approx(noise[near].mean(), abs=5 * error + 0.01)


def test_one_picture_is_what_is_seen_in_any_noise() -> None:
    rng = np.random.default_rng(1)
    picture = rng.uniform(-1, 1, (1, 64))
    denoiser = FiniteDenoiser(8, {"it": picture})
    for time in (0.05, 0.5, 0.98):
        assert denoiser.expected(rng.standard_normal(64), time, "it") == pytest.approx(picture[0])


def test_several_pictures_are_told_apart_as_noise_falls() -> None:
    pictures = np.random.default_rng(2).uniform(-1, 1, (5, 64))
    denoiser = FiniteDenoiser(8, {"any": pictures})
    noise = np.random.default_rng(3).standard_normal(64)

    def off(time: float) -> float:
        alpha, sigma = denoiser.scales(time)
        return float(np.abs(denoiser.expected(alpha * pictures[2] + sigma * noise, time, "any") - pictures[2]).max())

    assert off(0.99) > 0.5
    assert off(0.05) < 1e-6


def test_guidance_sharpens_the_choice() -> None:
    """The further the prompt is followed, the less is left of a picture that is not meant."""
    pictures = np.sign(np.random.default_rng(4).standard_normal((2, 64)))
    denoiser = FiniteDenoiser(8, {"first": pictures, "": np.vstack([pictures[1:], pictures])})
    coverage = (pictures.mean(axis=0).reshape(8, 8) + 1) / 2
    shares = []
    for guidance in (0.0, 1.0, 4.0, 12.0):
        loss = Distillation(denoiser, Wish("first", guidance=guidance), (0.9, 0.9), 1).draw(np.random.default_rng(5))
        seen = loss.estimate(2 * coverage[None, None] - 1).ravel()
        shares.append(float(seen @ (pictures[0] - pictures[1])))
    assert shares == sorted(shares)
    assert shares[-1] > shares[0] + 1


def test_a_set_of_another_size_or_prompt_is_refused() -> None:
    with pytest.raises(InputError, match=r"expected pictures of shape \(m, 64\)"):
        FiniteDenoiser(8, {"it": np.zeros((1, 63))})
    with pytest.raises(InputError, match="no pictures for 'that'"):
        FiniteDenoiser(8, {"it": np.zeros((1, 64))}).expected(np.zeros(64), 0.5, "that")


def test_libraries_are_packed_without_loss() -> None:
    pictures = np.random.default_rng(6).random((3, SIDE, SIDE)) > 0.5
    library = Library(("a", "b-c", "d"), (("x",), (), ("y", "z")), pictures)
    back = unpacked(packed(library))
    assert (back.names, back.tags) == (library.names, library.tags)
    assert np.array_equal(back.pictures, pictures)
    for data in (b"", b"nothing", packed(library)[:200]):
        with pytest.raises(InputError, match="expected silhouettes"):
            unpacked(data)


def test_the_shipped_library_comes_with_its_licence() -> None:
    notice = (files("d4cad.priors") / "NOTICE").read_text()
    assert "Phosphor" in notice
    assert "Permission is hereby granted" in notice
    assert (files("d4cad.priors") / "silhouettes.xz").stat().st_size < 1_000_000  # type: ignore[attr-defined]


def test_all_words_have_silhouettes() -> None:
    names = set(shipped().names)
    assert len(names) > 1000
    assert set(ALIASES.values()) <= names
    assert set(TRAINED.split()) <= names
    assert {name for choices in VARIANTS.values() for name in choices} <= names
    shares = shipped().pictures.mean(axis=(1, 2))
    assert shares.min() > 0.005
    assert shares.max() < 0.95


@pytest.mark.parametrize(
    ("prompt", "name"),
    [("star", "star"), ("A Star", "star"), ("stars", "star"), ("scissor", "scissors"), ("wine glass", "wine"),
     ("wineglass", "wine"), ("man standing", "person"), ("bull", "cow"), ("puppy", "dog"), ("key", "key")],
)  # fmt: skip
def test_prompts_find_what_they_mean(prompt: str, name: str) -> None:
    assert found(prompt, shipped().names) == name


@pytest.mark.parametrize(
    ("prompt", "said"),
    [("", "the prompt is empty"), ("?!", "the prompt is empty"), ("日本", "English words only"),
     ("flowr", "did you mean flower"),
     ("xyzzyq", r"does not know 'xyzzyq'$")],
)  # fmt: skip
def test_unknown_words_get_a_suggestion(prompt: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        embedded(prompt)


def test_seeds_get_different_silhouettes_of_a_word() -> None:
    first, second, again = (embedded("flower", variant=number).sets["flower"] for number in (0, 1, 3))
    assert not np.array_equal(first, second)
    assert np.array_equal(first, again)


def test_priors_by_name() -> None:
    assert chosen("embedded", "star")(0).size == 64
    for name in ("nothing", "sd:", "embedded:x"):
        with pytest.raises(InputError, match="there is no prior"):
            chosen(name, "star")


def test_weights_come_back(tmp_path: Path) -> None:
    arrays = ARRAYS
    write_weights(tmp_path / "w.safetensors", arrays, {"words": "x y"})
    back, facts = read_weights(tmp_path / "w.safetensors")
    assert facts == {"words": "x y"}
    assert sorted(back) == ["a", "b"]
    for name, array in arrays.items():
        assert back[name].dtype == array.dtype
        assert np.array_equal(back[name], array)


def test_weights_are_what_others_call_safetensors(tmp_path: Path) -> None:
    numpy = pytest.importorskip("safetensors.numpy", reason='needs the extra "sds"')
    arrays = ARRAYS
    write_weights(tmp_path / "w.safetensors", arrays, {})
    read = numpy.load_file(tmp_path / "w.safetensors")
    assert all(np.array_equal(read[name], arrays[name]) for name in arrays)


def test_deeply_nested_weights_are_refused(tmp_path: Path) -> None:
    head = b'{"a":' + b"[" * 100_000 + b"]" * 100_000 + b"}"
    (tmp_path / "deep.safetensors").write_bytes(len(head).to_bytes(8, "little") + head)
    with pytest.raises(InputError, match="not a whole safetensors file"):
        read_weights(tmp_path / "deep.safetensors")


def test_a_blank_negative_prompt_is_none() -> None:
    blank, none = embedded("star", " "), embedded("star")
    assert np.array_equal(blank.sets[" "], none.sets[""])


def test_damaged_weights_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "w.safetensors"
    with pytest.raises(InputError, match="cannot read the weights"):
        read_weights(path)
    write_weights(path, {"a": np.zeros(8, np.float32)}, {})
    whole = path.read_bytes()
    for data in (b"", b"1234", whole[:30], whole[:-4], whole.replace(b"F32", b"F99")):
        path.write_bytes(data)
        with pytest.raises(InputError, match="not a whole safetensors file"):
            read_weights(path)
