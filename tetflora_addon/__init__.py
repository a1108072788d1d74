# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The engine (rooms for plants, tetrahedra, refinement, proxies, light, emission) and its bridge to Blender."""
