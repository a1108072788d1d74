# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a species is: ranges for each branch order and a sample leaf (paper, section 5)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from .leaf_models import LeafModel

MAX_ORDERS = 6


class Range(NamedTuple):
    """A value that differs from branch to branch: uniform in mean ± variation."""

    mean: float
    variation: float = 0.0

    @property
    def low(self) -> float:
        """Smallest possible value."""
        return self.mean - self.variation

    @property
    def high(self) -> float:
        """Largest possible value."""
        return self.mean + self.variation


class Colour(NamedTuple):
    """A linear colour that differs from leaf to leaf: mean ± variation, all channels together."""

    mean: tuple[float, float, float]
    variation: tuple[float, float, float]


@dataclass(frozen=True)
class Order:
    """One branch order; order 0 is the trunk.

    Attributes
    ----------
    length : Range
        Order 0: metres. Others: fraction of the parent's length, times the parent's ``crown`` shape.
    thickness : Range
        Order 0: radius at the base as a fraction of the length. Others: fraction of the parent's radius at the fork.
    taper : float
        Radius at the tip as a fraction of the radius at the base.
    segments, sides : int
        Straight pieces along, and faces around, a branch.
    curvature : Range
        Degrees by which a branch bends over its length; positive bends back towards the parent's direction.
    curvature_tip : float
        Degrees by which it would bend over its length if all of it bent like its outer half.
    whorl : int
        Branches that leave the parent at one place: 1 alternate, 2 opposite, more a whorl.
    angle : Range
        Degrees between parent and branch, for branches at the parent's base.
    angle_tip : float
        The same for branches at the parent's tip; linear between.
    azimuth : Range
        Degrees around the parent from one branch to the next.
    branches : Range
        Number of branches of the next order on one branch of this one.
    branch_start : float
        Fraction of the branch that stays bare of branches.
    crown : str
        How the length of the children varies along the branch, see `crown_shapes.CROWN_SHAPES`.
    count_by_length : float
        How far the numbers of branches and leaves follow the branch's length: 0 not at all, 1 in proportion.
    leaves : Range
        Number of leaves on one branch of this order itself.
    leaf_start : float
        Fraction of the branch that stays bare of leaves.
    leaf_size : Range
        Metres by which the leaf model, one unit long, is scaled.
    leaf_angle : Range
        Degrees between branch and leaf.
    leaf_azimuth : Range
        Degrees around the branch from one leaf to the next.
    leaf_light : float
        0: a leaf's upper side faces the tip of its branch; 1: it faces the sky.
    branch_colour, leaf_colour : Colour
        Linear RGB.
    """

    length: Range
    thickness: Range
    taper: float
    segments: int
    sides: int
    curvature: Range
    curvature_tip: float
    angle: Range
    angle_tip: float
    azimuth: Range
    whorl: int
    branches: Range
    branch_start: float
    crown: str
    count_by_length: float
    leaves: Range
    leaf_start: float
    leaf_size: Range
    leaf_angle: Range
    leaf_azimuth: Range
    leaf_light: float
    branch_colour: Colour
    leaf_colour: Colour


@dataclass(frozen=True)
class Species:
    """A species as read from its file.

    Attributes
    ----------
    identifier, name, description : str
        Identifier is the file's name without its ending.
    orders : tuple of Order
        From the trunk up; at most `MAX_ORDERS`.
    leaf : LeafModel or str
        The sample leaf; a string is the name of a Blender mesh object, which the bridge to Blender replaces by a model.
    leaf_transmission : float
        Share of the light scattered by a leaf that goes through it, 0 to 1.
    """

    identifier: str
    name: str
    description: str
    orders: tuple[Order, ...]
    leaf: LeafModel | str
    leaf_transmission: float
