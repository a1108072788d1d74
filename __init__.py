# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""TetFlora, a Blender extension: entry points that Blender calls, nothing else."""

from . import operators, panels
from .tetflora_addon import blender
from .tetflora_addon.blender.runtime import in_order

# Properties first: operators and panels refer to them. An error in any part goes through to the user.
register, unregister = in_order(blender, operators, panels)
