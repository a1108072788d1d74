# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""From summaries of tetrahedra to facets, microspheres, and shells. Numpy only."""
