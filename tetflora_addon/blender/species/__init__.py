# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Species in the interface: choices, edits stored in the file, the editor, preset files."""
