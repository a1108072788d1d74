# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Wind: how far branches bend and leaves turn at a moment, as a function of their keys, their places and the time.

A branch turns by equal parts at its base and at each joint, toward where the wind pushes it: so it bends, stays as
long as it is, and carries what grows on it along. It leans by a mean, more so in gusts, which travel over the land with
the wind, and sways about that at its natural frequency. Each order adds its own movement, slow at the trunk and quick
at the twigs, as in "Physically Guided Animation of Trees" (Habel, Kusternig and Wimmer, 2009); that branches which
move by themselves keep real trees from swaying like poles is shown in "Mechanical stability of trees under
dynamic loads" (James, Haritos and Ades, 2006).

Rows of a flora in the wind have the columns of `WIND_COLUMNS` besides; others have not, and pay nothing for them.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Floats32, Integers, Keys, Table, columns, cross, dot
from ..errors import TetFloraError
from ..parameters import FACTOR, setting, within
from .hashing import Draw, uniform
from .rows import SPUR_ORDER, with_columns
from .seeds import Branches

#: Radians by which the tip of a trunk `_SLENDER` times as long as thick leans at `_STRONG` m/s; and over that for
#: limbs, their branches, and all beyond, as they carry more leaves for their wood. A cantilever leans by the fourth
#: power of the ratio; plants' wood is not the same everywhere, and has grown in the wind (1.5 looks right).
_LEAN, _SLENDER, _POWER, _LEAN_LIMITS = 0.03, 60.0, 1.5, (0.01, 0.45)
_OVER_TRUNK = np.array([1.0, 3.0, 5.0, 6.0])
#: Meters a second at which the lean is that. Drag grows no faster than the speed where leaves and twigs give way
#: (de Langre, "Effects of Wind on Plants", 2008), and slower in a storm.
_STRONG, _STORM = 10.0, 30.0
#: Frequency of a cantilever, 1.875² / 4π √(E / ρ) radius / length² for wood of 8 GPa and 900 kg/m³ (Euler and
#: Bernoulli), for what its own branches and leaves weigh besides. Branches as stiff as to be quicker hardly move.
_SPEED_OF_BENDING, _LOADED, _RATES = 834.0, 0.4, (0.1, 2.5)
_SWAY = np.array([0.5, 0.5, 0.25])  # sway over lean: along the wind, across it, and up and down
_SWAY_RATES = np.array([1.0, 1.13, 1.29])  # over the natural frequency, or all would move on ellipses
_SWAY_DRAWS = (Draw.SWAY_ALONG, Draw.SWAY_ACROSS, Draw.SWAY_UP)
#: Frequencies of gusts in hertz, weights, and cycles a meter across the wind.
_GUST_RATES = np.array([0.06, 0.17, 0.43])
_GUST_WEIGHTS = np.array([0.5, 0.3, 0.2])
_GUST_ACROSS = np.array([0.004, -0.013, 0.031])
#: Sine of the angle by which leaves flutter at `_STRONG`, and the rate in hertz of a leaf of so many meters.
_FLUTTER, _FLUTTER_MOST, _FLUTTER_RATE, _FLUTTER_SIZE = 0.22, 0.45, 3.0, 0.06
#: Cycles by which plants drawn by hand are apart for each meter between them: their branches have no key in common.
_APART = np.array([0.37, 0.23, 0.0])

#: Seconds between two looks: the velocity is that of the instant, as near as single precision tells.
_MOMENT = 1e-3

AIR_DTYPE = np.dtype(
    [(name, np.float64) for name in ("time", "loop", "moment", "speed", "gusts")]
    + [("axes", np.float64, (3, 3)), ("origin", np.float64, (3,))]
)
"""The wind: seconds, period after which all repeats (0: never), seconds between the two looks that tell how fast
things move (0: not needed), meters a second, fraction by which gusts are stronger or
weaker, as rows where it blows to, across that, and up, and where in the world positions are counted from, meters."""

WIND_COLUMNS = [*((name, np.float64) for name in ("lean", "pace", "flutter", "flutter_rate")), ("air", AIR_DTYPE)]
"""``lean`` is the mean turn of a branch's tip, radians (of plants drawn by hand: for each meter above ground at scale
1); ``pace`` the natural frequency times the length, hertz meters (likewise: hertz at scale 1); ``flutter`` the largest
sine of leaves' turns in a wind without gusts, ``flutter_rate`` their frequency, hertz."""


@dataclass(frozen=True)
class Wind:
    """A wind at a moment. Fields with a label are properties of a scene, and documented by their tooltips.

    Raises
    ------
    TetFloraError
        A number that is none, a negative speed or loop, or gusts outside 0 to 1.
    """

    speed: float = setting(
        4.0,
        "Speed",
        "Mean speed in meters per second: 2 stirs leaves, 4 is a gentle breeze, 10 sways trees, 20 is a gale. Animate "
        "it slowly: plants react at once",
        **within(0.0, 25.0, 100.0) | {"unit": 'VELOCITY'},
    )
    #: Radians from +x toward +y.
    direction: float = setting(
        0.0, "Direction", "Where it blows to: 0° is +X, 90° is +Y", subtype='ANGLE', soft_min=-np.pi, soft_max=np.pi
    )
    gusts: float = setting(
        0.5,
        "Gusts",
        "Strength of gusts and lulls relative to the mean speed: 0 is an even wind, 1 makes gusts twice as strong. "
        "They travel with the wind",
        **FACTOR,
    )
    time: float = 0.0  # seconds
    loop: float = 0.0  # seconds after which all movement repeats; 0 for never
    moving: bool = False  # whether vertices shall have velocities
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)  # where in the world positions are counted from, meters

    def __post_init__(self) -> None:
        if not np.isfinite([self.speed, self.direction, self.gusts, self.time, self.loop]).all():
            raise TetFloraError("Wind: Speed, Direction, Gusts, Loop and the time must be finite numbers")
        if self.speed < 0 or self.loop < 0 or not 0 <= self.gusts <= 1:
            raise TetFloraError("Wind: Speed and Loop must be 0 or greater, and Gusts between 0 and 1")

    @property
    def strength(self) -> float:
        """How far things lean, 1 at `_STRONG` m/s."""
        return self.speed / _STRONG * (1 + _STRONG / _STORM) / (1 + self.speed / _STORM)


def windy_rows(rows: Table, length: Floats, radius: Floats, wind: Wind) -> Table:
    """Rows (r,) with what a wind does to them, in `WIND_COLUMNS` besides.

    ``length`` and ``radius`` (r,) are typical of their branches; only their ratio counts.
    """
    out = with_columns(rows, WIND_COLUMNS)
    slender = rows["nominal"] * length / np.maximum(radius, 1e-9)
    # A part of a branch between forks leans by its part.
    order = np.minimum(np.where(rows["order"] == SPUR_ORDER, 2, rows["order"]), len(_OVER_TRUNK) - 1)
    lean = _LEAN * _OVER_TRUNK[order] * (slender / _SLENDER) ** _POWER
    out["lean"] = np.clip(lean, *_LEAN_LIMITS) * wind.strength / rows["nominal"]
    out["pace"] = _LOADED * _SPEED_OF_BENDING / np.maximum(slender * rows["nominal"], 1e-9)
    for i in np.flatnonzero(rows["phantom"]):  # all branches drawn by hand follow their plant
        drawn = slice(*rows["drawn_rows"][i])
        for name in ("lean", "pace"):
            out[name][drawn] = out[name][i] / rows["length"][i, 0]
    out["flutter"] = min(_FLUTTER * wind.strength, _FLUTTER_MOST)
    size = np.clip(rows["leaf_size"][:, 0], _FLUTTER_SIZE / 4, _FLUTTER_SIZE * 4)
    out["flutter_rate"] = _FLUTTER_RATE * np.sqrt(_FLUTTER_SIZE / size)
    c, s = np.cos(wind.direction), np.sin(wind.direction)
    air = out["air"]
    air["time"], air["loop"], air["speed"], air["gusts"] = wind.time, wind.loop, max(wind.speed, 0.1), wind.gusts
    air["moment"] = _MOMENT if wind.moving else 0.0
    air["axes"] = [[c, s, 0], [-s, c, 0], [0, 0, 1]]
    air["origin"] = wind.origin
    return out


def is_windy(rows: Table) -> bool:
    """Whether rows are those of a flora in the wind."""
    return "air" in rows.dtype.names


def moment(rows: Table) -> float:
    """Seconds to the second moment for which positions are computed; 0 without velocities."""
    return float(rows["air"]["moment"][0]) if is_windy(rows) else 0.0


def widest_sway(rows: Table) -> Floats:
    """Largest turn (...) of tips of branches of rows (...) at any time, radians (for those drawn by hand by meter)."""
    if not is_windy(rows):
        return np.zeros(rows.shape)
    return rows["lean"] * (1 + rows["air"]["gusts"]) * np.linalg.norm(_SWAY + [1, 0, 0])


def sway(rows: Table, branches: Branches, ahead: float = 0.0) -> Floats:
    """Rotation vectors (n, 3), radians, of branches' tips against their bases.

    For plants drawn by hand ``branches`` are whole plants, and what comes out is for each meter of height at scale 1.

    Parameters
    ----------
    ahead : float
        Seconds after the moment of the rows.
    """
    row, air = branches.row, rows["air"][0]
    drawn = rows["drawn"][row]
    rate = np.clip(rows["pace"][row] / np.maximum(np.where(drawn, branches.scale, branches.length), 1e-9), *_RATES)
    key, place = branches.key, 0.0
    if drawn.any():
        key = np.where(drawn, np.uint64(0), key)
        place = np.where(drawn, (branches.position + air["origin"]) @ _APART, 0.0)
    force = np.zeros((3, len(row)))
    for axis, (amplitude, quicker, draw) in enumerate(zip(_SWAY, _SWAY_RATES, _SWAY_DRAWS, strict=True)):
        force[axis] = amplitude * np.sin(2 * np.pi * _cycles(air, rate * quicker, ahead, uniform(key, draw) + place))
    force[0] += 1.0
    force *= rows["lean"][row] * gusts(rows, branches.position, ahead)
    # Toward the force by an angle that is largest where it comes from the side.
    return cross(branches.frame[:, :, 2], force.T @ air["axes"])


def gusts(rows: Table, position: Floats, ahead: float = 0.0) -> Floats:
    """Strength (n,) of the wind at places (n, 3) over its mean: within 1 ∓ Gusts."""
    air = rows["air"][0]
    position = position + air["origin"]
    along, across = position @ air["axes"][0], position @ air["axes"][1]
    out = np.ones(len(position))
    for rate, weight, sideways in zip(_GUST_RATES, _GUST_WEIGHTS, _GUST_ACROSS, strict=True):
        whole = _whole(air, rate)
        phase = sideways * across - whole / air["speed"] * along
        out += air["gusts"] * weight * np.sin(2 * np.pi * _cycles(air, whole, ahead, phase))
    return out


def _whole(air: np.void, rate: Floats | float) -> Floats:
    """Rates that fit a whole number of times, and at least once, into the loop."""
    return np.maximum(np.rint(rate * air["loop"]), 1.0) / air["loop"] if air["loop"] > 0 else rate


def _cycles(air: np.void, rate: Floats | float, ahead: float, phase: Floats | float) -> Floats:
    """Cycles (n,), less than one, that something of a rate (n,) is in at the moment."""
    time = air["time"] + ahead
    if air["loop"] > 0:
        time %= air["loop"]
    return (_whole(air, rate) * time + phase) % 1.0


def turned_by(frame: Floats, axis: Floats, angle: Floats) -> Floats:
    """Frames (n, 3, 3) turned about unit vectors (n, 3) by angles (n,) (Rodrigues)."""
    cos, sin = np.cos(angle)[:, None], np.sin(angle)[:, None]
    x, z = (_rotated(frame[:, :, column], axis, cos, sin) for column in (0, 2))
    return columns(x, cross(z, x), z)


def turned_vectors(vector: Floats, axis: Floats, angle: Floats) -> Floats:
    """Vectors (n, 3) turned in the same way."""
    return _rotated(vector, axis, np.cos(angle)[:, None], np.sin(angle)[:, None])


def _rotated(vector: NDArray, axis: NDArray, cos: NDArray, sin: NDArray) -> Floats:
    return cos * vector + sin * cross(axis, vector) + (1 - cos) * dot(axis, vector) * axis


def axis_and_angle(turn: Floats) -> tuple[Floats, Floats]:
    """Unit vectors (n, 3) and lengths (n,) of rotation vectors (n, 3); any axis for no turn."""
    angle = np.sqrt(dot(turn, turn))
    return turn / np.maximum(angle, 1e-300), angle[:, 0]


def rotation_vectors(turn: Floats) -> Floats:
    """Rotation vectors (n, 3) of rotations (n, 3, 3) by less than half a turn."""
    skew = turn - turn.transpose(0, 2, 1)
    vector = np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=1) / 2.0
    sine = np.linalg.norm(vector, axis=1)
    angle = np.arctan2(sine, (np.trace(turn, axis1=1, axis2=2) - 1.0) / 2.0)
    return vector * np.where(sine > 1e-12, angle / np.maximum(sine, 1e-300), 1.0)[:, None]


def leaned(points: Floats, up: Floats, turn: Floats) -> Floats:
    """Points of plants drawn by hand, bent over: all at one height turn alike, so that nothing comes apart.

    Parameters
    ----------
    points : (n, k, 3) float64
        From where the plants stand.
    up : (n, 3) float64
        Unit vectors along the plants' upright axes.
    turn : (n, 3) float64
        Rotation vector across ``up`` for each meter of height.

    Returns
    -------
    (n, k, 3) float64
    """
    height = np.einsum("nki,ni->nk", points, up)
    axis, rate = axis_and_angle(turn)
    aside = np.cross(axis, up)
    above = np.maximum(height, 0.0)
    angle = rate[:, None] * above
    # The upright axis becomes an arc of the same length.
    steep = np.maximum(rate, 1e-300)[:, None]
    along = np.where(angle > 1e-9, np.sin(angle) / steep, above)
    beside = np.where(angle > 1e-9, (1 - np.cos(angle)) / steep, above * angle / 2)
    level = points - above[:, :, None] * up[:, None]
    around = np.repeat(axis, level.shape[1], axis=0)
    level = turned_vectors(level.reshape(-1, 3), around, angle.ravel()).reshape(level.shape)
    return along[..., None] * up[:, None] + beside[..., None] * aside[:, None] + level


def fluttered(rows: Table, row: Integers, frame: Floats32, key: Keys, gust: Floats, ahead: float = 0.0) -> Floats32:
    """Frames of leaves (n, 3, 3) turned about their bases: up and down, and about their midribs.

    Parameters
    ----------
    rows : parameter table in the wind
    row : (n,) or (1,) int
    frame : (n, 3, 3) float32
        Across, along the midrib, upper side.
    key : (n,) uint64
        Of the leaves; its bits are as good as random numbers, and there are very many leaves.
    gust : (n,) float64
        Of `gusts` where they are.
    ahead : float
        Seconds after the moment of the rows.
    """
    air = rows["air"][0]
    bits = [((key >> np.uint64(shift)) & np.uint64(0xFFFFF)).astype(np.float64) * 2.0**-20 for shift in (44, 24, 4)]
    rate = rows["flutter_rate"][row] * (0.75 + 0.5 * bits[2])
    most = (rows["flutter"][row] * gust).astype(np.float32)
    cycles = _cycles(air, rate, ahead, bits[0]), _cycles(air, rate * 1.37, ahead, bits[1])
    pitch, roll = (most * np.sin((2 * np.pi * of).astype(np.float32)) for of in cycles)
    out = np.zeros((3, 3, len(frame)), np.float32)
    across, along, up = frame.transpose(2, 1, 0)
    for sine, first, second, i, j in ((pitch, along, up, 1, 2), (roll, across, out[2], 0, 2)):
        cosine = np.sqrt(1 - sine * sine)
        new = cosine * second - sine * first
        out[i] = cosine * first + sine * second
        out[j] = new
    return out.transpose(2, 1, 0)
