# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Reading leaves from a species file: polygons, models and outlines, which are checked field by field."""

from dataclasses import replace
from typing import Any

import numpy as np

from ..errors import SpeciesError, quoted
from ..parameters import FileReader
from .levels import TOLERANCES, fitted, shown_area, surface_of
from .models import LEAF_MODELS, OUTLINES, LeafModel, Spines, closed_parts, leaf_model
from .outlines import Blade
from .surfaces import Compound, Needles, check_outline

#: Most forms of a leaf.
MAX_FORMS = 8
LEAF_KEYS = ("model", "object", "vertices", "faces", "uv", "outline", "spines")


def read_forms(reader: FileReader, data: Any, key: str) -> tuple[LeafModel | str, ...]:
    """A leaf, or a list of forms among which each leaf has one by chance.

    Raises
    ------
    SpeciesError
        Names the field and what it may be.
    """
    if not isinstance(data, list):
        return (_read_leaf(reader, data, key),)
    if not 1 <= len(data) <= MAX_FORMS:
        raise reader.fail(key, f"must have 1 to {MAX_FORMS} forms, has {len(data)}")
    return tuple(_read_leaf(reader, one, f"{key}[{i}]") for i, one in enumerate(data))


def _read_leaf(reader: FileReader, data: Any, where: str) -> LeafModel | str:
    reader.keys(data, where, LEAF_KEYS)
    forms = [k for k in ("model", "object", "vertices") if k in data]
    if "spines" in data and "vertices" not in data:
        raise reader.fail(f"{where}.spines", "must be left out where there are no vertices with faces")
    if len(forms) != 1 and not (not forms and "outline" in data):
        raise reader.fail(
            where,
            "must have exactly one of model (built-in), object (Blender mesh) or vertices with faces, or an outline",
        )
    if "outline" in data:
        if "object" in data:
            raise reader.fail(
                f"{where}.outline", "must be left out where the leaf is an object, which is drawn as it is"
            )
        shape = _read_outline(reader, data["outline"], f"{where}.outline")
        rest = {key: value for key, value in data.items() if key != "outline"}
        if not forms:
            reader.keys(rest, where, ())
            return _outlined_model(shape)
        return replace(_read_leaf(reader, rest, where), shape=shape)
    if "model" in data:
        if not isinstance(data["model"], str) or data["model"] not in LEAF_MODELS:
            raise reader.fail(f"{where}.model", f"must be one of {', '.join(LEAF_MODELS)}, not {quoted(data['model'])}")
        return LEAF_MODELS[data["model"]]
    if "object" in data:
        return reader.text(data["object"], f"{where}.object")
    faces = data.get("faces")
    if not isinstance(faces, list) or not all(
        isinstance(f, list) and all(isinstance(v, int) and not isinstance(v, bool) for v in f) for f in faces
    ):
        raise reader.fail(f"{where}.faces", "must be a list of faces, each a list of vertex indices")
    for key, form in (("vertices", "[x, y, z]"), ("uv", "[u, v]")):
        if key in data and not _is_list_of_points(data[key], form.count(",") + 1):
            raise reader.fail(f"{where}.{key}", f"must be a list of {form} numbers")
    try:
        model = leaf_model(data["vertices"], faces, data.get("uv"))
    except SpeciesError as error:
        raise reader.fail(where, str(error)) from None
    if "spines" not in data:
        return model
    if not (closed_parts(model) >= 0).any():
        raise reader.fail(f"{where}.spines", "must be left out, because the polygons have no closed part to stand on")
    return replace(model, spines=reader.read(Spines, data["spines"], f"{where}.spines"))


def _is_list_of_points(value: Any, size: int) -> bool:
    # numpy would take texts and truths for numbers, and stumble over integers that no float can hold.
    return isinstance(value, list) and all(
        isinstance(point, list)
        and len(point) == size
        and all(isinstance(x, int | float) and not isinstance(x, bool) and not abs(x) > 1e300 for x in point)
        for point in value
    )


def _read_outline(reader: FileReader, data: Any, where: str) -> Blade | Needles | Compound:
    """An outline from what a species file has for it."""
    kind = "blade"
    if isinstance(data, dict) and "kind" in data:
        kind = reader.choice(data["kind"], f"{where}.kind", tuple(OUTLINES))
    rest = {key: value for key, value in data.items() if key != "kind"} if isinstance(data, dict) else data
    readers = {"leaflet": lambda value, path: _read_leaflet(reader, value, path)} if kind == "compound" else {}
    shape = reader.read(OUTLINES[kind], rest, where, readers)
    if isinstance(shape, Blade):
        if shape.palmate and 0 < shape.lobes < 3:
            raise reader.fail(f"{where}.lobes", f"must be 0, or 3 to 12 with palmate lobes, not {shape.lobes}")
        try:
            check_outline(shape)
        except SpeciesError as error:
            raise reader.fail(where, str(error)) from None
    if isinstance(shape, Compound) and not (shape.pairs or shape.around or shape.terminal):
        raise reader.fail(f"{where}.pairs", "must be at least 1 where there are no leaflets around and no terminal one")
    return shape


def _read_leaflet(reader: FileReader, data: Any, where: str) -> Blade:
    shape = _read_outline(reader, data, where)
    if not isinstance(shape, Blade):
        raise reader.fail(f"{where}.kind", "must be blade, because leaflets are simple")
    return shape


def _outlined_model(shape: Blade | Needles | Compound) -> LeafModel:
    """The coarsest level of an outline that has no other: few faces, which show as much as the outline."""
    leaf = fitted(shape, TOLERANCES[0], shown_area(shape, surface_of(shape, TOLERANCES[2], 0.0)), amount=0.0)
    positions, uv = np.round(leaf.positions[0], 6), leaf.uv.astype(np.float32)
    return LeafModel(positions, leaf.corner_verts, leaf.face_offsets, uv, shape=shape)
