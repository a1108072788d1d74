# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The shadow pass: light that reaches tetrahedra and facets, and what they scatter to the camera. Numpy only."""
