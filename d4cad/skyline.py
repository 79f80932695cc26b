"""Normal equations whose unknowns are numbered along a curve: compiled, each row kept from its first entry on."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def step(column, value, d, size, damping):
    """The x (size,) of least |J x + d|^2 + damping |x|^2.

    Row r of J has value[r, k] in column[r, k], of (m, w) arrays, int64 and float64; a negative column does not count. d
    (m,). damping > 0. Cholesky's factorisation within the envelope of J^T J (Jennings 1966), which for a curve is a
    band and, where it is closed, a few long rows.
    """
    first = np.arange(size)
    for r in range(d.size):
        low = size
        for c in column[r]:
            if 0 <= c < low:
                low = c
        for c in column[r]:
            if c >= 0:
                first[c] = min(first[c], low)
    at = np.zeros(size + 1, np.int64)  # entry (i, j) is at[i] + j - first[i]
    for i in range(size):
        at[i + 1] = at[i] + i - first[i] + 1
    a = np.zeros(at[size])
    x = np.zeros(size)
    for i in range(size):
        a[at[i + 1] - 1] = damping
    for r in range(d.size):
        for k in range(column.shape[1]):
            i = column[r, k]
            if i < 0:
                continue
            x[i] -= value[r, k] * d[r]
            for h in range(column.shape[1]):
                j = column[r, h]
                if 0 <= j <= i:
                    a[at[i] + j - first[i]] += value[r, k] * value[r, h]
    for i in range(size):
        for j in range(first[i], i + 1):
            low = max(first[i], first[j])
            total = a[at[i] + j - first[i]]
            for k in range(low, j):
                total -= a[at[i] + k - first[i]] * a[at[j] + k - first[j]]
            if i == j:
                a[at[i] + j - first[i]] = np.sqrt(max(total, 1e-300))
            else:
                a[at[i] + j - first[i]] = total / a[at[j + 1] - 1]
        for k in range(first[i], i):
            x[i] -= a[at[i] + k - first[i]] * x[k]
        x[i] /= a[at[i + 1] - 1]
    for i in range(size - 1, -1, -1):
        x[i] /= a[at[i + 1] - 1]
        for k in range(first[i], i):
            x[k] -= a[at[i] + k - first[i]] * x[i]
    return x
