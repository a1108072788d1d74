# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""From decisions to buffers, block by block: plants, polygons, proxies. Numpy only."""
