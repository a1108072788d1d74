# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where plants go: rules and ground in, places out. Arrays only; `blender.placing.populations` makes plants of them."""
