# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Sub-plants opened into branches, cut into pieces, and turned into tubes and leaf meshes. Numpy only."""
