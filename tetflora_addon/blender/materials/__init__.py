# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Node trees: leaves, bark, proxies, and the mean colors of existing materials."""
