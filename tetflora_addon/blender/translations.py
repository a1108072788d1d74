# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the interface says in other languages: German for labels so far. Whoever adds a language adds a dictionary.

Blender looks texts of operators up under "Operator", all others under "*"; what is missing stays English.
"""

import bpy

_OPERATORS = {
    "First Forest": "Erster Wald",
    "Populate": "Bepflanzen",
    "Paint Plants": "Pflanzen malen",
    "Place Plants by Clicking": "Pflanzen durch Klicken setzen",
    "Drop Plants to Ground": "Pflanzen auf den Boden setzen",
    "Add Plant": "Pflanze hinzufügen",
    "Change Species": "Art wechseln",
    "Re-roll Seeds": "Startwerte neu würfeln",
    "Select Species": "Art auswählen",
    "Refine": "Verfeinern",
    "Clear": "Leeren",
    "Clear Cache": "Zwischenspeicher leeren",
}
_LABELS = {
    "Plants": "Pflanzen",
    "Selected Plants": "Ausgewählte Pflanzen",
    "Paint Plants": "Pflanzen malen",
    "Populate": "Bepflanzen",
    "Refinement": "Verfeinerung",
    "Begin": "Anfangen",
    "Species": "Art",
    "Seed": "Startwert",
    "Radius": "Radius",
    "Density": "Dichte",
    "Strength": "Stärke",
    "Least Distance": "Mindestabstand",
    "Scale From": "Größe von",
    "Paint": "Malen",
    "Erase": "Löschen",
    "Thin": "Ausdünnen",
    "One Species": "Eine Art",
    "As in Populate": "Wie in Bepflanzen",
    "Quality": "Qualität",
    "Cutoff": "Abbruch",
    "Leaf Limit": "Blattgrenze",
    "Statistics": "Statistik",
    "Wind": "Wind",
    "Speed": "Geschwindigkeit",
    "Direction": "Richtung",
    "Gusts": "Böen",
    "Loop": "Schleife",
    "Limits": "Grenzen",
    "Films": "Filme",
    "Share Between Frames": "Zwischen Bildern teilen",
    "Within Distance": "Innerhalb der Strecke",
    "Within Angle": "Innerhalb des Winkels",
    "Keep at Most": "Höchstens behalten",
    "Species Folder": "Artenordner",
    "Quality of New Scenes": "Qualität neuer Szenen",
    "Memory of New Scenes": "Speicher neuer Szenen",
    "Keep What Is Found Out": "Gefundenes behalten",
    "Cache Folder": "Zwischenspeicherordner",
}

#: Texts by language, each with its context, as Blender takes them.
DICTIONARY = {
    "de_DE": {
        **{("Operator", text): german for text, german in _OPERATORS.items()},
        **{("*", text): german for text, german in _LABELS.items()},
    }
}
# The name under which Blender keeps them.
_NAME = __name__


def register() -> None:
    """Make the translations known."""
    bpy.app.translations.register(_NAME, DICTIONARY)


def unregister() -> None:
    """Take them back."""
    bpy.app.translations.unregister(_NAME)
