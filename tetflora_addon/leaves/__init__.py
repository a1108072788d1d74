# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a leaf is: outlines, needles and leaflets as parameters, and the polygons that stand for them. Numpy only."""
