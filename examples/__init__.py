# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes and images that the demo, the benchmarks and the documentation are made from; not part of the extension."""
