# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender and the extension are there before the tests are collected, so they import both at the top of the file."""

from devtools import session

session.start()
