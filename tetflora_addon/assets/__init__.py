# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Assets: models that are instanced, compiled once into clusters as species are into sub-plants."""
