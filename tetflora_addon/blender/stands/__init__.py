# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Stands that grow on grounds of the scene: their settings, the job, and what is made of its records."""
