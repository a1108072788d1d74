# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""View cells: one refinement for all cameras that are nearly alike, so that the frames of an animation share it.

The space of cameras (place, direction, focal length) is divided into cells. Which cell a camera is in follows from that
camera alone, never from the frames before it: a frame of an animation and the same frame alone are refined alike, on
any machine. What is seen from a cell of space instead of from a point goes back to J. M. Airey, J. H. Rohlf and F. P.
Brooks, "Toward image realism with interactive update rates in complex virtual building environments" (I3D 1990).

All cameras of a cell are replaced by one that sees whatever any of them sees: it stands further back, its window is
wider, and it takes everything to be as near as it is to the nearest of them.
"""

from dataclasses import dataclass, replace
from itertools import product
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Integers, quaternions
from ..parameters import script_setting, setting
from .camera import Camera

#: How far beyond a cell, as fractions of it in place and angle, its camera still sees enough: while the shutter is
#: open, and for the other eye.
BEYOND, BEYOND_TURN = 0.1, 0.25
#: Cells of focal length, and of the distance that is sharp, in each doubling.
ZOOMS, FOCI = 16.0, 2.0
#: Width and height of cells over their length, for a window of which half is as wide as it is far away.
ACROSS = 2.0
#: Cells are twice as long, and twice that, where all that is refined is farther from their middle than so many times
#: the distance to their corners.
CLEAR = 4.0
#: Minimum fraction of the view's direction that corners of the window must have when the camera has turned: 84 degrees.
_AHEAD = 0.1
#: Where lattices begin, in cells, and a turn that comes before them: what artists type in (0, 90 degrees, whole meters)
#: then lies on no border, where rounding errors would decide.
_BEGIN = 0.381966
_BEFORE = np.array([0.8446, 0.2397, 0.3581, 0.3173])
_BEFORE /= np.linalg.norm(_BEFORE)
_BACK = _BEFORE * np.array([1.0, -1.0, -1.0, -1.0])
#: Fractions of a pixel to which the image's place on the sensor is rounded, as single precision asks for.
_FRACTIONS = 64.0


@dataclass(frozen=True)
class ViewCells:
    """How large the cells are. ``length`` is documented by its tooltip; ``turn`` is how far the camera turns before
    plants are refined again, in radians, by which the view is widened too.

    Across the line of sight cells are shorter than ``length``, since there the image changes faster.
    """

    length: float = setting(
        4.0,
        "Within Distance",
        "How far the camera moves along its line of sight before plants are refined again. Larger values are faster, "
        "with more geometry per frame; use 0.1 m or less for close-ups of single plants. Doubled, quadrupled and so on "
        "where all plants are far away",
        subtype='DISTANCE',
        min=0.001,
        soft_min=0.1,
        soft_max=50.0,
    )
    turn: float = script_setting(np.radians(3.0).item(), subtype='ANGLE', min=np.radians(0.05), max=np.radians(40.0))


@dataclass(frozen=True)
class Around:
    """Spheres about all that is refined: centers (n, 3) and radii (n,), meters. Roughly will do."""

    centers: Floats
    radii: Floats

    def leaves_clear(self, place: Floats, distance: float) -> bool:
        """Whether all of them are at least so far from a place (3,), meters."""
        away = np.linalg.norm(self.centers - place, axis=1) - self.radii
        return bool((away >= distance).all())


@dataclass(frozen=True)
class _Turns:
    """A cell of rotations: in the projection of unit quaternions from their center, coordinates of its middle (3,)."""

    largest: int
    middle: Floats
    step: float

    @classmethod
    def around(cls, frame: Floats, turn: float) -> Self:
        """The cell in which a rotation (3, 3) is; cells are ``turn`` radians wide."""
        largest = int(np.argmax(np.abs(_product(_BEFORE, quaternions(frame[None])[0]))))
        step = turn / 2.0  # an angle is twice that between quaternions
        return cls(largest, _middle(_projected(frame, largest), step), step)

    def frame(self, away: Floats) -> Floats:
        """Rotation (3, 3) so many steps (3,) away from the middle."""
        quaternion = np.insert(self.middle + away * self.step, self.largest, 1.0)
        return _matrix(_product(_BACK, quaternion / np.linalg.norm(quaternion)))

    def holds(self, frame: Floats, reach: float) -> bool:
        """Whether a rotation is within so many steps of the middle."""
        return bool((np.abs(_projected(frame, self.largest) - self.middle) <= reach * self.step).all())


def cell_camera(camera: Camera, cells: ViewCells, around: Around | None = None) -> Camera | None:
    """The camera that stands for all that are in the same cell as a camera: the same numbers for each of them.

    Parameters
    ----------
    camera : Camera
        As it was read, without margins. Its shutter and other eyes should stay in the cell or next to it, see `BEYOND`.
    around : Around, optional
        Where things are; cells far from all of them are larger. None for the same cells everywhere.

    Returns
    -------
    Camera or None
        None where a camera cannot share its refinement: it moves out of its cell while the shutter is open, its view is
        wider than any window, or it is a panorama of less than the whole sphere.
    """
    left, right, bottom, top = camera.window
    whole = right - left > 2.0 * np.pi - 1e-3 and top - bottom > np.pi - 1e-3
    if camera.kind == "PANO" and not whole:
        return None
    turns = _Turns.around(camera.frame, cells.turn)
    frame = turns.frame(np.zeros(3))
    others = camera.shutter
    camera = _zoomed(_with_all_windows(camera)) if camera.kind != "PANO" else camera
    left, right, bottom, top = camera.window
    half = np.array([right - left, top - bottom]) / 2.0
    narrow = np.minimum(ACROSS * half, 1.0) if camera.kind == "PERSP" else np.ones(2)
    steps = cells.length * np.array([*narrow, 1.0])
    if around is not None and len(around.radii) and camera.kind != "ORTHO":
        place = camera.position @ frame
        # Doubled as often as nothing is near the cell then. What decides is the cell, not where in it the camera is.
        while around.leaves_clear(frame @ _middle(place, 2.0 * steps), CLEAR * np.linalg.norm(steps)):
            steps = 2.0 * steps
    eye = frame @ _middle(camera.position @ frame, steps)
    reach = (0.5 + BEYOND) * steps
    for other in others:
        beyond = np.abs((other.position - eye) @ frame) > reach
        if beyond.any() or not turns.holds(other.frame, 0.5 + BEYOND_TURN):
            return None
    radius = float(np.linalg.norm(steps) / 2.0)
    lens, focus = _lens_of_cell(camera)
    alike = replace(camera, position=eye, frame=frame, cell_radius=radius, shutter=(), lens_radius=lens, focus=focus)
    if camera.kind == "PANO":
        return alike
    corners = [turns.frame((0.5 + BEYOND_TURN) * np.array(away)) for away in product((-1.0, 1.0), repeat=3)]
    return _standing_back(alike, np.array([frame.T @ corner for corner in corners]), reach)


def _standing_back(camera: Camera, turned: Floats, reach: Floats) -> Camera | None:
    """A camera that sees what it sees from a box of half sizes (3,) around the eye, turned (n, 3, 3) in each way."""
    left, right, bottom, top = camera.window
    middle = np.array([left + right, bottom + top]) / 2.0
    step = np.array([(right - left) / camera.width, (top - bottom) / camera.height])
    seen = np.array([(x, y, -1.0) for x in (left, right) for y in (bottom, top)])
    if camera.kind == "ORTHO":
        seen = np.concatenate([seen * np.array([1.0, 1.0, depth]) for depth in (camera.near, camera.far)])
    local = np.einsum("nij,kj->nki", turned, seen).reshape(-1, 3)
    shallowest, deepest = float((-local[:, 2]).min()), float((-local[:, 2]).max())
    if camera.kind == "PERSP":
        if (-local[:, 2] < _AHEAD * np.linalg.norm(local, axis=1)).any():
            return None
        local = local / -local[:, 2:]
    half = np.abs(local[:, :2] - middle).max(axis=0)
    if camera.kind == "ORTHO":
        half = half + reach[:2]
        # Far enough back for what is nearest when it has turned; the lens is larger as its focus is farther away.
        setback = float(reach[2]) + camera.near - shallowest
        near, far = camera.near, deepest + setback + float(reach[2])
        away = np.array([0.0, 0.0, setback])
        focus = camera.focus + setback
        lens = camera.lens_radius * focus / camera.focus if np.isfinite(focus) else camera.lens_radius
    else:
        # In a frame that is sheared with the window, it is |x| <= half (depth + setback) for all corners of the box.
        setback = float(((reach[:2] + np.abs(middle) * reach[2]) / half).max() + reach[2])
        near = shallowest * camera.near + setback - float(reach[2])
        far = deepest * camera.far + setback + float(reach[2])
        lens, focus = camera.lens_radius, camera.focus
        away = np.array([*-middle, 1.0]) * setback
    pixels = np.ceil(2.0 * half / step).astype(int)
    setback = setback if camera.kind == "PERSP" else 0.0
    depths = {"near": near, "far": far, "setback": setback, "lens_radius": lens, "focus": focus}
    position = camera.position + camera.frame @ away
    return replace(_with_window(camera, middle, pixels * step / 2.0, pixels), position=position, **depths)


def _with_window(camera: Camera, middle: Floats, half: Floats, pixels: Integers) -> Camera:
    """A camera with another window, by its middle and its half size (2,), and with so many pixels (2,)."""
    (left, bottom), (right, top) = middle - half, middle + half
    return replace(camera, window=(left, right, bottom, top), width=int(pixels[0]), height=int(pixels[1]))


def _with_all_windows(camera: Camera) -> Camera:
    """With whole pixels more around its image where other eyes look past it: their windows may be shifted."""
    low, high = np.array(camera.window[::2]), np.array(camera.window[1::2])
    step = (high - low) / [camera.width, camera.height]
    windows = np.array([camera.window, *(other.window for other in camera.shutter)])
    below = np.ceil((low - windows[:, ::2].min(axis=0)) / step - 1.0 / _FRACTIONS)
    above = np.ceil((windows[:, 1::2].max(axis=0) - high) / step - 1.0 / _FRACTIONS)
    (left, bottom), (right, top) = (low - below * step).tolist(), (high + above * step).tolist()
    across, up = (below + above).astype(int).tolist()
    return replace(camera, window=(left, right, bottom, top), width=camera.width + across, height=camera.height + up)


def _zoomed(camera: Camera) -> Camera:
    """With the widest window of all in its cell of focal length, in pixels as small as the finest of them."""
    left, right, bottom, top = camera.window
    step = np.array([(right - left) / camera.width, (top - bottom) / camera.height])
    place = np.array([[left, right], [bottom, top]]) / step[:, None]
    place = np.round(place * _FRACTIONS) / _FRACTIONS
    aspect = np.round(step[0] / step[1] * 1e4) / 1e4
    fine = 2.0 ** (_middle(np.log2(camera.pixel_size), 1.0 / ZOOMS) - 0.5 / ZOOMS)
    finest = fine * np.array([np.sqrt(aspect), 1.0 / np.sqrt(aspect)])
    widest = 2.0 ** (1.0 / ZOOMS)
    size = np.ceil(np.array([camera.width, camera.height]) * widest).astype(int)
    return _with_window(camera, place.mean(axis=1) * finest * np.sqrt(widest), size * finest / 2.0, size)


def _lens_of_cell(camera: Camera) -> tuple[float, float]:
    """Radius of the lens and depth that is sharp, as they are for all cameras of a cell."""
    if camera.lens_radius <= 0.0 or not np.isfinite(camera.focus):
        return camera.lens_radius, camera.focus
    radius, focus = (2.0 ** _middle(np.log2(x), 1.0 / FOCI) for x in (camera.lens_radius, camera.focus))
    return float(radius * 2.0 ** (0.5 / FOCI)), float(focus)


def _middle(place: NDArray | float, step: NDArray | float) -> Floats:
    """Middle of the cell of a lattice in which a place is."""
    return (np.floor(place / np.asarray(step) - _BEGIN) + _BEGIN + 0.5) * step


def _projected(frame: Floats, largest: int) -> Floats:
    """The other three parts (3,) of the quaternion of a rotation (3, 3), scaled so that one of the four is 1."""
    quaternion = _product(_BEFORE, quaternions(frame[None])[0])
    return np.delete(quaternion, largest) / quaternion[largest]


def _product(p: Floats, q: Floats) -> Floats:
    """Hamilton's product of quaternions (4,)."""
    vector = p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:])
    return np.array([p[0] * q[0] - p[1:] @ q[1:], *vector])


def _matrix(q: Floats) -> Floats:
    """Rotation (3, 3) of a unit quaternion."""
    w, v = q[0], q[1:]
    cross = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
    return np.eye(3) + 2.0 * w * cross + 2.0 * cross @ cross
