# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Identifiers of all operators, in one place: panels, menus, tests and key maps refer to these."""

ADD_PLANT = "tetflora.add_plant"
POPULATE = "tetflora.populate"
ASSIGN_SPECIES = "tetflora.assign_species"
RESEED = "tetflora.reseed"
SELECT_SPECIES = "tetflora.select_species"
REMOVE_PLANTS = "tetflora.remove_plants"
MARK_OCCLUDER = "tetflora.mark_occluder"
EDIT_LIST = "tetflora.edit_list"
REFINE = "tetflora.refine"
CLEAR = "tetflora.clear"
