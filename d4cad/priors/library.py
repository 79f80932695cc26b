"""Silhouettes with their names, as they are shipped: silhouettes.xz, made by d4cad.priors.build."""

from __future__ import annotations

import json
import lzma
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

import numpy as np
from numpy.typing import NDArray

from d4cad.errors import InputError

SIDE = 128
"""Pixels along a stored silhouette."""

SHIPPED = "silhouettes.xz"


@dataclass(frozen=True, slots=True, eq=False)
class Library:
    """Silhouettes of things.

    names: one each, in words joined by hyphens, such as "flower-lotus". tags: words that people look each up by.
    pictures: (n, SIDE, SIDE) bool, row 0 lowest.
    """

    names: tuple[str, ...]
    tags: tuple[tuple[str, ...], ...]
    pictures: NDArray[np.bool_]

    def picture(self, name: str) -> NDArray[np.bool_]:
        """The silhouette (SIDE, SIDE) of that name."""
        return np.asarray(self.pictures[self.names.index(name)])


def packed(library: Library) -> bytes:
    """The library as bytes: LZMA of a line of JSON and one bit a pixel, each row by its difference from the one below,
    which packs better."""
    head = json.dumps({"side": SIDE, "names": library.names, "tags": library.tags}, separators=(",", ":"))
    edges = library.pictures.copy()
    edges[:, 1:] ^= library.pictures[:, :-1]
    return lzma.compress(head.encode() + b"\n" + np.packbits(edges).tobytes(), preset=9 | lzma.PRESET_EXTREME)


def unpacked(data: bytes) -> Library:
    """The library in bytes of :func:`packed`. Raises InputError for anything else."""
    try:
        head, _, body = lzma.decompress(data).partition(b"\n")
        facts = json.loads(head)
        side, names = int(facts["side"]), tuple(facts["names"])
        bits = np.unpackbits(np.frombuffer(body, np.uint8), count=len(names) * side * side)
        edges = bits.reshape(len(names), side, side).astype(bool)
    except (lzma.LZMAError, ValueError, KeyError, TypeError) as error:
        raise InputError(f"expected silhouettes as d4cad.priors.build packs them: {error}") from None
    return Library(names, tuple(tuple(tags) for tags in facts["tags"]), np.logical_xor.accumulate(edges, axis=1))


@cache
def shipped() -> Library:
    """The library that comes with d4cad: Phosphor icons (MIT, see NOTICE beside it)."""
    return unpacked((files("d4cad.priors") / SHIPPED).read_bytes())
