# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The interface in other languages: a file in the folder ``locale`` for each, named by Blender's code of the language.

A file maps English texts to translations, by Blender's contexts "Operator" and "*". What is missing stays English.
"""

import json
import sys
from pathlib import Path

from bpy.app import translations

from ..errors import TetFloraError
from .runtime import Part

FOLDER = Path(__file__).with_name("locale")
CONTEXTS = ("Operator", "*")

Entries = dict[tuple[str, str], str]


def _read_language(path: Path) -> Entries:
    """Translations in a file by context and English text, as Blender takes them; errors name the file and the place."""
    try:
        groups = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise TetFloraError(f"Cannot read the translation {path}: {error}") from None
    if not isinstance(groups, dict) or not set(groups) <= set(CONTEXTS):
        raise TetFloraError(f'{path}: use the groups "Operator" and "*", and no others')
    entries = {}
    for context, texts in groups.items():
        if not isinstance(texts, dict):
            raise TetFloraError(f'{path}: "{context}" must map English texts to translations')
        for english, translation in texts.items():
            if not isinstance(translation, str) or not translation.strip():
                raise TetFloraError(f'{path}: the translation of "{english}" is not a text; add one or delete the line')
            entries[context, english] = translation
    return entries


def read_languages(folder: Path = FOLDER) -> dict[str, Entries]:
    """Translations by language; a file that cannot be used is reported on stderr and left out."""
    languages = {}
    for path in sorted(folder.glob("*.json")):
        try:
            languages[path.stem] = _read_language(path)
        except TetFloraError as error:
            print(f"TetFlora: error: {error}", file=sys.stderr, flush=True)
    return languages


register, unregister = Part(
    lambda: translations.register(__name__, read_languages()), lambda: translations.unregister(__name__)
)
