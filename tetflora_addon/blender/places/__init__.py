# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Real places in Blender: terrain, fields of trees, and curves from files.

Steps of an import yield progress, and raise a `SceneError` if the file is broken or cannot lie in the scene. Closing
them leaves all as it was.
"""
