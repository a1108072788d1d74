# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Real places: elevation and canopy height, tree inventories and outlines from files; no Blender in it."""
