# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How thick branches are along their length: taper, flare of the base, and the pipe model.

The radius is that of the base times a profile: linear from 1 to the taper, or by the pipe model, in which r^p is shared
out among the children (Shinozaki et al., "A quantitative analysis of plant form: the pipe model theory", 1964; p = 2 is
Leonardo's rule). The flare of Weber and Penn (SIGGRAPH 1995, section 4.4) is added over the first eighth.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .hashing import Draw
from .rows import ranged

FLARE_END = 1 / 8
_FALL = 8 * np.log(100.0)  # the flare falls to a hundredth over the first eighth


def profile(rows: NDArray[np.void], row: NDArray, key: NDArray[np.uint64], t: NDArray[np.float64]) -> NDArray:
    """Radius (n,) at fractions t (n,) of branches of rows (n,) and keys (n,), divided by that of the base unflared."""
    taper = ranged(rows, "taper", row, key, Draw.TAPER)
    out = 1 - (1 - taper) * t
    hand = np.flatnonzero(rows["drawn"][row])
    if len(hand):
        out[hand] = _drawn(rows, row[hand], t[hand])[0]
    piped = np.flatnonzero(rows["pipe"][row] > 0)
    if len(piped):
        power, start, tip = _pipe(rows, row[piped], taper[piped])
        share = np.clip((t[piped] - start) / (1 - start), 0, 1)
        out[piped] = (tip + (1 - tip) * (1 - share)) ** (1 / power)
    flared = np.flatnonzero(rows["flare"][row] > 0)
    if len(flared):
        out[flared] += rows["flare"][row[flared]] * np.maximum(np.exp(-_FALL * t[flared]) - 0.01, 0)
    return out


def profile_integral(rows: NDArray[np.void], row: NDArray, key: NDArray[np.uint64], t: NDArray[np.float64]) -> NDArray:
    """Integral (n,) of `profile` from 0 to t; differences of it are exact under any sequence of cuts."""
    taper = ranged(rows, "taper", row, key, Draw.TAPER)
    out = t - (1 - taper) * t * t / 2
    hand = np.flatnonzero(rows["drawn"][row])
    if len(hand):
        out[hand] = _drawn(rows, row[hand], t[hand])[1]
    piped = np.flatnonzero(rows["pipe"][row] > 0)
    if len(piped):
        power, start, tip = _pipe(rows, row[piped], taper[piped])
        share = np.clip((t[piped] - start) / (1 - start), 0, 1)
        q = 1 + 1 / power
        fallen = 1 - (tip + (1 - tip) * (1 - share)) ** q
        out[piped] = np.minimum(t[piped], start) + (1 - start) * fallen / (q * np.maximum(1 - tip, 1e-12))
    flared = np.flatnonzero(rows["flare"][row] > 0)
    if len(flared):
        end = np.minimum(t[flared], FLARE_END)
        out[flared] += rows["flare"][row[flared]] * ((1 - np.exp(-_FALL * end)) / _FALL - 0.01 * end)
    return out


def _pipe(rows: NDArray[np.void], row: NDArray, taper: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    power = rows["pipe"][row]
    # A tip as thick as the base has nothing to share out; the limit keeps divisions finite.
    return power, rows["start"][row, 0, 0], np.minimum(taper, 1 - 1e-6) ** power


def _drawn(rows: NDArray[np.void], row: NDArray, t: NDArray[np.float64]) -> tuple[NDArray, NDArray]:
    """Profile of branches that are drawn by hand, linear between their knots, and its integral."""
    radii, number = rows["radii"][row], rows["segments"][row]
    along = t * number
    segment = np.minimum(along.astype(np.int64), number - 1)
    part, every = along - segment, np.arange(len(row))
    low, high = radii[every, segment], radii[every, segment + 1]
    whole = np.concatenate([np.zeros((len(row), 1)), np.cumsum((radii[:, 1:] + radii[:, :-1]) / 2, axis=1)], axis=1)
    return low + (high - low) * part, (whole[every, segment] + part * (low + (high - low) * part / 2)) / number
