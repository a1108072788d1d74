# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a species is: its file, its catalog, levels of detail, forms drawn by hand. Numpy only."""
