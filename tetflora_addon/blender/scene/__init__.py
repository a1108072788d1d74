# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Reading the scene: camera, lights, plants, fields, instances, explicit objects."""
