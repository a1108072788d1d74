# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Stands: plants that grow beside each other for years, compete for light, die, and make room for others."""
