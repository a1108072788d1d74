# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Real places: files of surveys and cities, coordinate systems, and trees seen from above.

What reads a file raises an `OSError` if it cannot be read, and a `SceneError` if it is broken, which names the line,
tag or feature. Texts called ``what`` or ``where`` begin messages of a `SceneError`, which says what to do.
"""
