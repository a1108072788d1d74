# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where objects are, and what rotation and scale their matrices amount to."""

import bpy
import numpy as np
from numpy.typing import NDArray

_TINY = 1e-9  # of an axis: no scale that anybody means


def world_matrix(obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> NDArray[np.float64]:
    """An object's matrix in world space, (4, 4) float64, as the dependency graph evaluates it.

    Objects that are switched off in viewports but render are not evaluated there, and their stored matrix may be old.
    It is worked out from the transforms of the object and its parents then; constraints do not count.
    """
    evaluated = obj.evaluated_get(depsgraph)
    if evaluated.is_evaluated:
        return np.array(evaluated.matrix_world)
    own = np.array(obj.matrix_basis)
    if obj.parent is None:
        return own
    return world_matrix(obj.parent, depsgraph) @ np.array(obj.matrix_parent_inverse) @ own


def frames_of(linear: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
    """Rotations and uniform scales of linear maps.

    Parameters
    ----------
    linear : (n, 3, 3) float64
        Upper left part of object matrices, with any scale, shear and mirroring.

    Returns
    -------
    frame : (n, 3, 3) float64
        Proper rotations that keep the direction of z and the azimuth of x; shear and mirroring go.
    scale : (n,) float64
        Mean length of the three axes.
    sound : (n,) bool
        False where an axis has no length or is no number; the frame then means nothing.
    """
    lengths = np.linalg.norm(linear, axis=1)  # (n, 3): of the columns
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        z = linear[:, :, 2] / lengths[:, 2:]
        x = linear[:, :, 0] / lengths[:, :1]
        x = x - z * np.sum(x * z, axis=1, keepdims=True)
        rest = np.linalg.norm(x, axis=1, keepdims=True)
        x = x / rest
        frame = np.stack([x, np.cross(z, x), z], axis=2)
        sound = (lengths > _TINY).all(axis=1) & (rest[:, 0] > _TINY) & np.isfinite(frame).all(axis=(1, 2))
    return frame, lengths.mean(axis=1), sound
