# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Growing plants from seeds: hashes, branches, their axes, leaves, wind. Numpy only."""
