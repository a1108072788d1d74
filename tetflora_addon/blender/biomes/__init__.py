# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Biomes: layers of plants, ground cover and soil that are added together, from files that can be shared."""
