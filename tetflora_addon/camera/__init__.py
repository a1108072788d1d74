# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The camera as the engine sees it: projection, silhouettes, view cells. Numpy only."""
