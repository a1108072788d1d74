# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Assets in Blender: where their instances are, what their faces look like, and what stands for them in results."""
