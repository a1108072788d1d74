# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The results of the paper (section 8), made anew: its figures 4 to 9, its animation, its figures on time and memory.

One module a figure, each with ``make(out, images, small)``: the images of the documentation go into the folder
``images``, all else into ``out``; what was measured is returned. ``small`` is for tests: few plants, few pixels.
"""
