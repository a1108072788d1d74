# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tetrahedra, their bisection, and the binary tree of planes; numpy only."""
