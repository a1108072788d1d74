# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Jobs for render farms: a tool beside the extension, see docs/farm.md."""
