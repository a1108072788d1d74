# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Plants for other programs: few that stand for many, in levels of detail, as files that these understand."""
