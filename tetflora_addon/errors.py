# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Errors that a user can cause; their message names the thing and says what to do next."""


class TetFloraError(Exception):
    """Something the user gave or asked for cannot be used as it is."""


class SpeciesError(TetFloraError):
    """A species file or leaf model is broken or unknown."""


class SceneError(TetFloraError):
    """The scene lacks something that refinement needs, or holds something that it cannot use."""
