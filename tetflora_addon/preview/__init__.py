# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a viewport can show of a refinement while it is worked on: levels, projected tetrahedra, plants of few faces."""
