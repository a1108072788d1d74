# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the demo says while it runs."""

from __future__ import annotations

from examples import demo
from tetflora_addon.jobs import Progress


def test_each_state_is_said_once(capsys):
    def steps():
        for fraction, message in (
            (0.05, "Refining"),
            (0.6, "Making polygons"),
            (0.601, "Making polygons"),
            (0.7, "Done"),
        ):
            yield Progress(fraction, message)
        return "figures"

    assert demo.follow(steps()) == "figures"
    said = [line.split("]")[1].split() for line in capsys.readouterr().out.splitlines()]
    assert said == [["5", "%", "Refining"], ["60", "%", "Making", "polygons"], ["70", "%", "Done"]]
