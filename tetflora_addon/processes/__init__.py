# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Other Pythons that make blocks of results beside this one; the engine needs no Blender, so they need none either."""
