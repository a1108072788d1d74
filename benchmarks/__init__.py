# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures that anyone can measure again: ``python -m benchmarks NAME [--quick] [--json PATH]``."""
