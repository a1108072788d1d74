# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a species is: ranges for each branch order and a sample leaf (paper, section 5).

`crown_ratio` gives the length of branches along their parent.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..leaves.models import LeafModel
from .ecology import Ecology
from .growing import Ages, PartGrown
from .skeletons import Skeleton
from .year import Year

LEAF_KINDS = ("leaf", "blossom")
LEAF_ENVELOPES = ("none", "sphere", "cylinder", "cone", "box")
"""Solids around a branch that leaves may fill."""
LEAF_INCLINATIONS = ("branch", "spherical", "planophile", "erectophile", "plagiophile", "extremophile", "uniform")
"""How leaves stand: as the branch has it, or by a distribution of the angle between their normals and its axis."""
BARKS = (
    "ridged", "plated", "smooth", "banded", "ringed", "fibrous", "jointed", "netted", "peeling", "scaly",
    "interlaced", "pitted", "papery",
)  # fmt: skip
"""Characters of bark that materials know."""


#: A fork is there once its stems are so long, in lengths of the full-grown branch.
_FORKS_FROM = 1e-4


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
    taper : Range
        Radius at the tip as a fraction of the radius at the base.
    flare : float
        How much thicker the very base is, as a fraction of the radius.
    pipe : float
        Exponent of the pipe model, which then shapes the branch and its children's radii; 0 for plain ratios.
    segments, sides : int
        Straight pieces along, and faces around, a branch.
    curvature : Range
        Degrees by which a branch bends over its length; positive bends back towards the parent's direction.
    curvature_tip : float
        Degrees by which it would bend over its length if all of it bent like its outer half.
    attraction : Range
        Degrees by which it turns to the sky over its length where it lies level; negative to the ground.
    spray : float
        How far branches leave their parent level, to its left and right, instead of all around.
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
    branch_start : Range
        Fraction of the branch that stays bare of branches.
    forks : Range
        Stems into which the branch divides; 0 where it does not.
    fork_at : float
        Fraction of the length at which it does so first.
    fork_angle : Range
        Degrees by which each stem turns away.
    fork_levels : int
        How many times it divides, at even distances from there to the tip.
    spurs : Range
        Number of the species' short shoots on one branch.
    spur_start : Range
        Fraction of the branch that stays bare of them.
    crown : str
        How the length of the children varies along the branch, see `CROWN_SHAPES`.
    count_by_length : float
        How far the numbers of branches and leaves follow the branch's length: 0 not at all, 1 in proportion.
    leaves : Range
        Number of leaves on one branch of this order itself.
    leaf_kind : str
        Which of `LEAF_KINDS` the branch bears.
    leaf_whorl : int
        Leaves at one place: 2 opposite, more a whorl or a fascicle.
    leaf_start : Range
        Fraction of the branch that stays bare of leaves.
    leaf_size : Range
        Metres by which the leaf model, one unit long, is scaled.
    leaf_angle : Range
        Degrees between branch and leaf.
    leaf_azimuth : Range
        Degrees around the branch from one leaf to the next.
    leaf_light : Range
        0: a leaf's upper side faces the tip of its branch; 1: it faces the sky.
    leaf_light_tip : float
        The same of leaves at the outside of the crown.
    leaf_spray : float
        How far leaves stand level to the left and right of their branch, instead of all around.
    leaf_droop : float
        0: a leaf keeps its direction; 1: it hangs down.
    leaf_size_tip : float
        Size of leaves at the outside of the crown, as a factor on that of those inside.
    leaf_size_young : float
        Size of leaves at the end of a branch, as a factor on what it would be elsewhere.
    branch_colour, leaf_colour : Colour
        Linear RGB; of leaves, inside the crown.
    leaf_colour_tip : tuple of float
        Mean colour of leaves at the outside of the crown.
    leaf_colour_young : tuple of float
        Mean colour of leaves at the end of a branch, inside the crown.
    leaf_envelope : str
        Which of `LEAF_ENVELOPES` the leaves fill, from where they begin to the tip of the branch.
    leaf_envelope_radius : float
        Its radius, or half of the side of a box, as a fraction of the branch's length.
    leaf_inclination : str
        Which of `LEAF_INCLINATIONS` the leaves have.
    growing : PartGrown or None
        How far it has grown; None where it is as long as it will be.
    """

    length: Range
    thickness: Range
    taper: Range
    flare: float
    pipe: float
    segments: int
    sides: int
    curvature: Range
    curvature_tip: float
    attraction: Range
    angle: Range
    angle_tip: float
    azimuth: Range
    spray: float
    whorl: int
    branches: Range
    branch_start: Range
    crown: str
    count_by_length: float
    forks: Range
    fork_at: float
    fork_angle: Range
    fork_levels: int
    spurs: Range
    spur_start: Range
    leaf_kind: str
    leaves: Range
    leaf_whorl: int
    leaf_start: Range
    leaf_size: Range
    leaf_size_tip: float
    leaf_size_young: float
    leaf_angle: Range
    leaf_azimuth: Range
    leaf_light: Range
    leaf_light_tip: float
    leaf_spray: float
    leaf_droop: float
    branch_colour: Colour
    leaf_colour: Colour
    leaf_colour_tip: tuple[float, float, float]
    leaf_colour_young: tuple[float, float, float]
    leaf_envelope: str = "none"
    leaf_envelope_radius: float = 0.5
    leaf_inclination: str = "branch"
    growing: PartGrown | None = None


@dataclass(frozen=True)
class Bud:
    """The buds of shoots with leaves: one at the end of each, others in the axils of its leaves.

    Attributes
    ----------
    length : float
        Metres.
    width : float
        Fraction of the length.
    lateral : float
        Fraction of the leaves with a bud in their axil.
    colour : tuple of float
        Linear RGB.
    """

    length: float
    width: float
    lateral: float
    colour: tuple[float, float, float]


@dataclass(frozen=True)
class Dead:
    """Dead branches of a trunk below and in the lower crown: broken off or bare.

    Attributes
    ----------
    number : Range
        On the trunk.
    low, high : float
        Where they begin, as a fraction of the part that is bare of branches, and end, as a fraction of the rest.
    on_limbs : Range
        On each limb (branch of order 1), likewise.
    orders : tuple of Order
        The dead branches; then, if any, the twigs on these.
    """

    number: Range
    low: float
    high: float
    on_limbs: Range
    orders: tuple[Order, ...]


@dataclass(frozen=True)
class Species:
    """A species as read from its file.

    Attributes
    ----------
    identifier, name, description : str
        Identifier is the file's name without its ending.
    orders : tuple of Order
        From the trunk up; at most `skeletons.MAX_ORDERS`.
    leaf, blossom : tuple of LeafModel or str
        Forms of the sample leaf, and of blossoms or fruit, where there are any; each leaf has one of them by chance. A
        string is the name of a Blender mesh object, which the bridge to Blender replaces by a model.
    leaf_transmission, blossom_transmission : float
        Fraction of the light scattered by a leaf or blossom that goes through it, 0 to 1.
    spur : Order or None
        A short shoot; its length is in metres and its thickness a fraction of that, as for a trunk.
    bud : Bud or None
    dead : Dead or None
    bark : str
        One of `BARKS`.
    quality : float
        Polygons of a plant, of those that the description gives; compiling applies it.
    habit : float
        How far trees, which stand free as described, are those of a dense stand, 0 to 1; compiling applies it.
    stand_leaves : float
        Fraction of the leaves on a twig that are left in a dense stand, 0.05 to 1.
    exact : bool
        Every plant is the same: ranges have their means, and seeds do not matter.
    form : Skeleton or None
        Trunk and lower orders modelled by hand; only the orders above are grown.
    aged : (Species, float) or None
        Of what, and at how many years, this is another age; see `ages.with_age`.
    year : Year or None
        When leaves appear, turn and fall.
    ages : Ages or None
        How it grows.
    ecology : Ecology or None
        What it needs among others.
    """

    identifier: str
    name: str
    description: str
    orders: tuple[Order, ...]
    leaf: tuple[LeafModel | str, ...]
    leaf_transmission: float = 0.4
    blossom: tuple[LeafModel | str, ...] = ()
    blossom_transmission: float = 0.4
    spur: Order | None = None
    bud: Bud | None = None
    dead: Dead | None = None
    bark: str = "ridged"
    quality: float = 1.0
    habit: float = 0.0
    stand_leaves: float = 1.0
    exact: bool = False
    form: Skeleton | None = None
    aged: tuple[Species, float] | None = None
    year: Year | None = None
    ages: Ages | None = None
    ecology: Ecology | None = None

    def forms(self, kind: int) -> tuple[LeafModel | str, ...]:
        """Forms of leaves of a kind, by its index in `LEAF_KINDS`; leaves where there are no blossoms."""
        return self.blossom or self.leaf if kind else self.leaf


def fork_cuts(order: Order) -> list[float]:
    """Ends of the parts into which forks divide the branches of an order, fractions of the length from 0 to 1."""
    cuts = whole_cuts(order)
    if order.growing is None:
        return cuts
    now = order.growing.now
    return [*(cut / now for cut in cuts[: len(cuts) - 1]), 1.0]


def whole_cuts(order: Order) -> list[float]:
    """The same as fractions of the length when it is full-grown; forks that it has not reached yet are left out."""
    if order.forks.high <= 0:
        return [0.0, 1.0]
    levels = order.fork_levels
    cuts = [0.0, *(order.fork_at + (1 - order.fork_at) * k / levels for k in range(levels)), 1.0]
    if order.growing is None:
        return cuts
    reached = max(sum(cut < order.growing.now - _FORKS_FROM for cut in cuts[:-1]), 1)
    return cuts[: reached + 1]


CROWN_SHAPES = (
    "conical",
    "spherical",
    "hemispherical",
    "cylindrical",
    "tapered",
    "flame",
    "inverse conical",
    "tend flame",
    "receding",
)
"""Names of the shapes, in the order of their numbers (Weber and Penn, SIGGRAPH 1995, section 4.3), and one more."""


def crown_ratio(shape: NDArray[np.integer], r: NDArray[np.float64]) -> NDArray[np.float64]:
    """Length ratio of a child, 0 to 1.

    Parameters
    ----------
    shape : (...) int
        Index into `CROWN_SHAPES`.
    r : (...) float64
        1 at the lowest child, 0 at the parent's tip.

    Notes
    -----
    Weber and Penn 1995, table of ShapeRatio. "Receding" is their rule for the branches of branches (section 4.3):
    parent's length less 0.6 of the way to the child. Their number of leaves and of further branches, less by half
    towards the tip, is what ``count_by_length`` 5/6 makes of it. The lower end of the two flames is raised from 0 to
    0.05, so that no branch has zero length.
    """
    r = np.clip(r, 0.0, 1.0)
    return np.choose(
        shape,
        [
            0.2 + 0.8 * r,
            0.2 + 0.8 * np.sin(np.pi * r),
            0.2 + 0.8 * np.sin(0.5 * np.pi * r),
            np.ones_like(r),
            0.5 + 0.5 * r,
            np.maximum(np.where(r <= 0.7, r / 0.7, (1 - r) / 0.3), 0.05),
            1 - 0.8 * r,
            np.where(r <= 0.7, 0.5 + 0.5 * r / 0.7, 0.5 + 0.5 * (1 - r) / 0.3),
            0.4 + 0.6 * r,
        ],
    )
