# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Refinement as a job, refinement at render with the frame cache, and single plants as meshes."""
