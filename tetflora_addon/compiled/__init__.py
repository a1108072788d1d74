# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What is known of sub-plants before any is grown: bounds, means, extinction. Numpy only."""
