"""The trained prior's network: a small U-Net of 32 x 32 pictures, told the time and the words."""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn
from torch.nn import functional as F

SIDE = 32
"""Pixels along a picture."""

WIDTHS = (56, 104, 152)
"""Channels on 16 x 16, 8 x 8 and 4 x 4 cells."""

SIGNAL = 192
"""Length of the vector that tells a block the time and the words."""

HEADS = 4


class Block(nn.Module):
    """Two convolutions with a way around them; the signal scales and shifts between (FiLM, Perez et al. 2018)."""

    def __init__(self, before: int, after: int) -> None:
        super().__init__()
        self.norm1 = nn.GroupNorm(8, before)
        self.conv1 = nn.Conv2d(before, after, 3, padding=1)
        self.film = nn.Linear(SIGNAL, 2 * after)
        self.norm2 = nn.GroupNorm(8, after)
        self.conv2 = nn.Conv2d(after, after, 3, padding=1)
        self.around = nn.Identity() if before == after else nn.Conv2d(before, after, 1)
        nn.init.zeros_(self.conv2.weight)

    def forward(self, x: Tensor, signal: Tensor) -> Tensor:
        """(B, before, h, w) and (B, SIGNAL) to (B, after, h, w)."""
        h = self.conv1(F.silu(self.norm1(x)))
        scale, shift = self.film(signal)[:, :, None, None].chunk(2, dim=1)
        h = self.conv2(F.silu(self.norm2(h) * (1 + scale) + shift))
        out: Tensor = self.around(x) + h
        return out


class Attention(nn.Module):
    """Self-attention among the cells, added to them."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.norm = nn.GroupNorm(8, width)
        self.asked = nn.Conv2d(width, 3 * width, 1)
        self.out = nn.Conv2d(width, width, 1)
        nn.init.zeros_(self.out.weight)

    def forward(self, x: Tensor) -> Tensor:
        """(B, width, h, w) to the same."""
        b, c, h, w = x.shape
        q, k, v = self.asked(self.norm(x)).reshape(b, 3, HEADS, c // HEADS, h * w).transpose(-1, -2).unbind(1)
        seen = F.scaled_dot_product_attention(q, k, v).transpose(-1, -2).reshape(b, c, h, w)
        out: Tensor = x + self.out(seen)
        return out


class Network(nn.Module):
    """Predicts v = alpha noise - sigma picture (Salimans and Ho 2022) from a noisy picture, the time and the words.

    words: size of the vocabulary. A prompt is the mean of its words' vectors; no words are a vector of their own.
    """

    def __init__(self, words: int) -> None:
        super().__init__()
        a, b, c = WIDTHS
        self.words = nn.Embedding(words + 1, SIGNAL)  # the last one stands for none
        self.time = nn.Sequential(nn.Linear(64, SIGNAL), nn.SiLU(), nn.Linear(SIGNAL, SIGNAL))
        self.told = nn.Sequential(nn.SiLU(), nn.Linear(SIGNAL, SIGNAL), nn.SiLU())
        self.enter = nn.Conv2d(4, a, 3, padding=1)
        self.down1 = Block(a, a)
        self.down2 = Block(a, b)
        self.look2 = Attention(b)
        self.down3 = Block(b, c)
        self.look3 = Attention(c)
        self.middle = Block(c, c)
        self.up3 = Block(2 * c, c)
        self.up2 = Block(c + b, b)
        self.look4 = Attention(b)
        self.up1 = Block(b + a, a)
        self.norm = nn.GroupNorm(8, a)
        self.leave = nn.Conv2d(a, 4, 3, padding=1)
        nn.init.zeros_(self.leave.weight)

    def forward(self, x: Tensor, time: Tensor, weights: Tensor) -> Tensor:
        """x: (B, 1, SIDE, SIDE). time: (B,) in [0, 1]. weights: (B, words + 1), how much of each word's vector; rows
        sum to 1. Returns v, (B, 1, SIDE, SIDE).
        """
        frequencies = torch.exp(torch.linspace(0, math.log(1000.0), 32, dtype=x.dtype, device=x.device))
        angles = time[:, None] * frequencies
        waves = torch.cat([angles.sin(), angles.cos()], dim=1)
        signal = self.told(self.time(waves) + weights @ self.words.weight * 4)
        h1 = self.down1(self.enter(F.pixel_unshuffle(x, 2)), signal)
        h2 = self.look2(self.down2(F.avg_pool2d(h1, 2), signal))
        h3 = self.look3(self.down3(F.avg_pool2d(h2, 2), signal))
        h = self.middle(h3, signal)
        h = F.interpolate(self.up3(torch.cat([h, h3], dim=1), signal), scale_factor=2.0)
        h = F.interpolate(self.look4(self.up2(torch.cat([h, h2], dim=1), signal)), scale_factor=2.0)
        h = self.up1(torch.cat([h, h1], dim=1), signal)
        return F.pixel_shuffle(self.leave(F.silu(self.norm(h))), 2)


def scales(time: Tensor) -> tuple[Tensor, Tensor]:
    """alpha and sigma of the cosine schedule: cos and sin of time times a right angle."""
    return torch.cos(time * math.pi / 2), torch.sin(time * math.pi / 2)
