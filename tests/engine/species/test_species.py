# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Species files: what is shipped is right, and whatever is wrong is named with its file, key and allowed range."""

from __future__ import annotations

import copy
import json
import math
import random
import re
import tracemalloc
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from devtools import species_docs
from tests.engine import support
from tetflora_addon.compiled.flora import compile_species
from tetflora_addon.compiled.orientation import leaf_moments
from tetflora_addon.errors import SpeciesError
from tetflora_addon.leaves.models import LEAF_MODELS, MAX_LEAF_POLYGONS, leaf_model
from tetflora_addon.parameters import keys_of
from tetflora_addon.species.catalog import (
    MAX_FILE_BYTES,
    ORDER_KEYS,
    list_species,
    load_species,
    read_species,
    species_from_dict,
)
from tetflora_addon.species.skeletons import MAX_ORDERS
from tetflora_addon.species.species import CROWN_PROFILES, Ages, Bud, Dead, Ecology, LeafYear, Range, Year, crown_ratio


def refusal(data: Any) -> str:
    with pytest.raises(SpeciesError) as caught:
        species_from_dict(data, "oak", "oak.json")
    message = str(caught.value)
    assert message.startswith("oak.json: "), message
    return message


@pytest.mark.parametrize("name", support.SPECIES)
def test_shipped_species_are_valid(name: str) -> None:
    species = load_species(name)
    assert species.identifier == name
    assert species.description
    assert list_species()[name].name == species.name


def test_the_broadleaf_tree_is_that_of_the_paper() -> None:
    """Eighty trees, 3.79 million polygons (paper, section 8.1)."""
    flora = support.alone("broadleaf_tree", np.inf)
    assert flora.polygons[0] * 80 == pytest.approx(3.79e6, rel=0.02)


ORDER_MISTAKES = [
    ("lenght", [1, 0], "unknown key"),
    ("length", [1], "within 0.001 to 200"),
    ("length", "3", "within 0.001 to 200"),
    ("length", [0, 0], "0.001 to 200"),
    ("length", [201, 0], "0.001 to 200"),
    ("length", [1, 2], "-1 to 3, must be from 0.001 to 200"),
    ("length", [1, -0.5], "0 to 199.999"),
    ("length", None, "missing"),
    ("length", ["1", 0], "number"),
    ("length", [True, 0], "number"),
    ("taper", math.nan, "0 to 1"),
    ("taper", math.inf, "0 to 1"),
    ("taper", -math.inf, "0 to 1"),
    ("flare", [0.5, 0], "number from 0 to 4"),
    ("pipe", 4.5, "0 to 4"),
    ("forks", [1, 1.5], "0 to 8"),
    ("leaf_kind", "fruit", "leaf, blossom"),
    ("leaf_color_tip", [0.1, 0.2], "[r, g, b]"),
    ("leaf_color_tip", [0.1, 0.2, 3], "0 to 1"),
    ("leaf_color_young", 0.3, "[r, g, b]"),
    ("leaf_color_young", [0.1, -0.2, 0.3], "0 to 1"),
    ("leaf_light_tip", [0.5, 0.1], "number from 0 to 1"),
    ("leaf_light_tip", 1.1, "0 to 1"),
    ("leaf_size_young", 0, "0.05 to 5"),
    ("taper", 10**400, "0 to 1"),
    ("segments", 2.5, "whole"),
    ("segments", 0, "1 to 32"),
    ("sides", 2, "3 to 64"),
    ("branches", [-3, 0], "0 to 10000"),
    ("branches", [3, 4], "0 to 10000"),
    ("leaves", [100_001, 0], "0 to 100000"),
    ("angle", [175, 10], "0 to 180"),
    ("angle_tip", 181, "0 to 180"),
    ("crown", "cubic", "conical"),
    ("crown", ["conical"], "conical"),
    ("crown", 3, "conical"),
    ("leaf_color", [[0.1, 0.2], [0, 0, 0]], "0 to 1"),
    ("leaf_color", [[0.1, 0.2, 0.3], [0.2, 0, 0]], "0 to 1"),
    ("branch_color", [1, 1, 1], "0 to 1"),
]


@pytest.mark.parametrize(("key", "value", "part"), ORDER_MISTAKES)
def test_mistakes_in_an_order(key: str, value: Any, part: str) -> None:
    message = refusal(support.small(order0={key: value}))
    assert f"orders[0].{key}" in message
    assert part in message


def test_every_key_refuses_what_is_outside_its_range() -> None:
    """A key's limits are those of the table, on both sides; the limits themselves are allowed."""
    for name, key in ORDER_KEYS.items():
        if key.kind not in ("range", "number", "integer"):
            continue
        for limit, outside in ((key.low, key.low - 1), (key.high, key.high + 1)):
            wrap = (lambda v: [v, 0]) if key.kind == "range" else (lambda v: v)
            assert f"orders[0].{name}" in refusal(support.small(order0={name: wrap(outside)}))
            if name not in ("branches", "leaves", "spurs"):  # their highest would exceed the number of polygons
                species_from_dict(support.small(order0={name: wrap(limit)}), "oak", "oak.json")


def test_lengths_of_branches_are_relative() -> None:
    assert "orders[1].length" in refusal(support.small(order1={"length": [21, 0]}))


SPECIES_MISTAKES: list[tuple[str, Any, str]] = [
    ("format", 2, "must be 1"),
    ("format", True, "must be 1"),
    ("name", "  ", "1 to 1000"),
    ("name", 5, "string"),
    ("description", ["a"], "string"),
    ("color", 1, "unknown key"),
    ("Barks", "ridged", 'did you mean "bark"?'),
    ("orders", [], f"1 to {MAX_ORDERS}"),
    ("orders", {}, f"1 to {MAX_ORDERS}"),
    ("orders", [{}], "length: missing"),
    ("orders", [7], "object"),
    ("orders", support.SMALL["orders"] * 4000, f"1 to {MAX_ORDERS}"),
    ("leaf_transmission", 1.5, "0 to 1"),
    ("leaf_transmission", "half", "0 to 1"),
    ("leaf", {}, "exactly one"),
    ("leaf", {"model": "kite", "object": "Leaf"}, "exactly one"),
    ("leaf", {"model": "oak"}, "kite"),
    ("leaf", {"model": ["kite"]}, "kite"),
    ("leaf", {"object": ""}, "1 to 1000"),
    ("leaf", {"vertices": [[0, 0, 0]]}, "leaf.faces"),
    ("leaf", {"shape": "kite"}, "unknown key"),
    ("leaf", "kite", "object"),
    ("leaf", [], "1 to 8"),
    ("leaf", [{"model": "kite"}, {"model": "oak"}], "leaf[1].model"),
    ("blossom", {"model": "rose"}, "blossom.model"),
    ("blossom_transmission", -1, "0 to 1"),
    ("bark", "rough", "ridged"),
    ("quality", 0, "0.0001 to 1000"),
    ("quality", math.nan, "0.0001 to 1000"),
    ("exact", 1, "true or false"),
    ("spur", {"length": [0.1, 0]}, "spur.thickness"),
    ("spur", {"length": [0.1, 0], "thickness": [0.1, 0], "spurs": [1, 0]}, "spur.spurs"),
]


@pytest.mark.parametrize(("key", "value", "part"), SPECIES_MISTAKES)
def test_mistakes_in_a_species(key: str, value: Any, part: str) -> None:
    message = refusal(support.small(**{key: value}) if key != "orders" else {**support.small(), "orders": value})
    assert key in message
    assert part in message


@pytest.mark.parametrize("key", ["format", "name", "orders", "leaf"])
def test_missing_keys(key: str) -> None:
    data = support.small()
    del data[key]
    assert refusal(data) == f"oak.json: {key}: missing; add this key"


@pytest.mark.parametrize("data", [None, [], 3, "species", [[[]]]])
def test_what_is_not_an_object(data: Any) -> None:
    assert "must be an object" in refusal(data)


def test_last_order_has_no_branches() -> None:
    assert "orders[2].branches: must be [0, 0]" in refusal(support.small(order2={"branches": [1, 0]}))


def test_too_many_polygons_are_refused() -> None:
    many = {"leaves": [10_000, 0], "branches": [300, 0]}
    data = support.small(order0=many, order1=many, order2={"leaves": [10_000, 0]})  # 9 × 10⁸ leaves
    message = refusal(data)
    assert "polygons" in message
    assert "the limit is" in message


SQUARE = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
BAD_LEAVES: list[tuple[dict[str, Any], str]] = [
    ({"vertices": SQUARE, "faces": [[0, 1, 4]]}, "vertex 4"),
    ({"vertices": SQUARE, "faces": [[0, 1, -1]]}, "vertex -1"),
    ({"vertices": SQUARE, "faces": [[0, 1, 10**11]]}, "vertex"),
    ({"vertices": SQUARE, "faces": [[0, 1, 10**30]]}, "vertex"),
    ({"vertices": SQUARE, "faces": [[0, 1]]}, "3 or more"),
    ({"vertices": SQUARE, "faces": []}, "faces"),
    ({"vertices": SQUARE, "faces": [[0, 1, True]]}, "faces"),
    ({"vertices": SQUARE, "faces": [[0, 1, 1]]}, "twice"),
    ({"vertices": SQUARE, "faces": [[0, 1, 2]] * (MAX_LEAF_POLYGONS + 1)}, str(MAX_LEAF_POLYGONS)),
    ({"vertices": SQUARE * 5000, "faces": [[0, 1, 2]]}, "vertices"),
    ({"vertices": [[0, 0, 0]] * 4, "faces": [[0, 1, 2]]}, "zero area"),
    ({"vertices": [[0, 0, math.nan], *SQUARE], "faces": [[0, 1, 2]]}, "finite"),
    ({"vertices": [[0, 0, 1e200], *SQUARE], "faces": [[0, 1, 2]]}, "vertices"),
    ({"vertices": [[0, 0], [1, 0], [1, 1]], "faces": [[0, 1, 2]]}, "[x, y, z]"),
    ({"vertices": [[0, 0, 0], [1, 0], [1, 1]], "faces": [[0, 1, 2]]}, "[x, y, z]"),
    ({"vertices": [["0", "0", "1"], *SQUARE], "faces": [[0, 1, 2]]}, "[x, y, z]"),
    ({"vertices": "abc", "faces": [[0, 1, 2]]}, "[x, y, z]"),
    ({"vertices": None, "faces": [[0, 1, 2]]}, "[x, y, z]"),
    ({"vertices": [], "faces": [[0, 1, 2]]}, "[x, y, z]"),
    ({"vertices": SQUARE, "faces": [[0, 1, 2]], "uv": [[0, 0]]}, "uv"),
    ({"vertices": SQUARE, "faces": [[0, 1, 2]], "uv": [[0, math.inf]] * 4}, "uv"),
    ({"vertices": SQUARE, "faces": [[0, 1, 2]], "uv": [[0, 1e300]] * 4}, "uv"),
    ({"vertices": SQUARE, "faces": [[0, 1, 2]], "uv": [["0", "0"]] * 4}, "uv"),
]


@pytest.mark.parametrize(("leaf", "part"), BAD_LEAVES)
def test_bad_leaves(leaf: dict[str, Any], part: str) -> None:
    message = refusal(support.small(leaf=leaf))
    assert "oak.json: leaf" in message
    assert part in message


def test_a_leaf_keeps_only_vertices_that_faces_use() -> None:
    loose = leaf_model([[9, 9, 9], *SQUARE, [5, 5, 5]], [[1, 2, 3, 4]])
    assert loose == leaf_model(SQUARE, [[0, 1, 2, 3]])
    assert loose.reach == pytest.approx(math.sqrt(2))
    assert loose.area == pytest.approx(1)


def test_a_leaf_that_is_an_object_has_to_be_resolved() -> None:
    species = species_from_dict(support.small(leaf={"object": "Oak leaf"}), "oak", "oak.json")
    with pytest.raises(SpeciesError, match="Oak leaf"):
        compile_species([species])


@pytest.mark.parametrize("name", LEAF_MODELS)
def test_built_in_leaves(name: str) -> None:
    """One unit long or nearly, base at the origin, upper side up, moment of trace 1."""
    model = LEAF_MODELS[name]
    assert 0.95 < np.ptp(model.positions[:, 1]) < 1.1 or name == "needles"
    assert model.reach < 1.1
    assert np.trace(model.moment) == pytest.approx(1)
    assert (model.face_vectors[:, 2] > 0).all()
    assert np.unique(model.corner_verts).tolist() == list(range(len(model.positions)))


def test_crown_shapes_are_ratios() -> None:
    r = np.linspace(0, 1, 101)
    for shape, name in enumerate(CROWN_PROFILES):
        ratio = crown_ratio(np.full(101, shape), r)
        assert (ratio > 0).all(), name
        assert ratio.max() == pytest.approx(1), name


@pytest.mark.parametrize(
    ("content", "part"),
    [
        (b"", "JSON"),
        (b"{", "JSON"),
        (b'{"format": 1,}', "JSON"),
        (b"\xff\xfe{}", "JSON: not UTF-8 text"),
        (b"[" * 100_000, "JSON"),
        (b"1" * 5000, "must be an object"),
        (b"[1]", "object"),
        (b" " * (MAX_FILE_BYTES + 1), f"larger than {MAX_FILE_BYTES:,}"),
    ],
    ids=["empty", "cut", "comma", "encoding", "nested", "digits", "list", "large"],
)
def test_broken_files_are_named_and_do_not_hide_the_others(content: bytes, part: str, tmp_path: Path) -> None:
    path = tmp_path / "broken.json"
    path.write_bytes(content)
    with pytest.raises(SpeciesError) as caught:
        read_species(path)
    assert str(caught.value).startswith("broken.json: ")
    assert part in str(caught.value)
    assert set(list_species([tmp_path])) == {"broken", *support.SPECIES}


def test_a_key_twice_in_one_object_is_told(tmp_path: Path) -> None:
    text = json.dumps(support.small()).replace('"branches": ', '"branches": [9, 0], "branches": ', 1)
    path = tmp_path / "twice.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(SpeciesError, match=r"twice\.json: branches: duplicate key"):
        read_species(path)


def test_a_mark_of_the_encoding_does_no_harm(tmp_path: Path) -> None:
    path = tmp_path / "marked.json"
    path.write_text(json.dumps(support.small(name="Größe")), encoding="utf-8-sig")
    assert read_species(path).name == list_species([tmp_path])["marked"].name == "Größe"


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    (tmp_path / "folder.json").mkdir()
    (tmp_path / "dangling.json").symlink_to(tmp_path / "nowhere.json")
    assert set(list_species([tmp_path, tmp_path / "missing"])) == set(support.SPECIES)
    with pytest.raises(SpeciesError, match=r"gone\.json: cannot be read"):
        read_species(tmp_path / "gone.json")
    with pytest.raises(SpeciesError, match=r"Unknown species.*broadleaf_tree"):
        load_species("triffid")


def test_a_users_file_replaces_a_shipped_one_and_is_read_again_when_it_changes(tmp_path: Path) -> None:
    path = tmp_path / "bush.json"
    for name in ("Mine", "Mine, changed"):
        path.write_text(json.dumps(support.small(name=name)), encoding="utf-8")
        assert load_species("bush", [tmp_path]).name == name
    assert load_species("bush").name == "Bush"


def _places(data: Any, path: tuple = ()) -> list[tuple]:
    items = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    return [path, *(p for k, v in items for p in _places(v, (*path, k)))]


JUNK: list[Any] = [None, True, -1, 0, 1, 3, 1e9, 10**30, 1e308, math.nan, -math.inf, 0.1, "", "kite", "conical",
                   [], {}, [1], [3, 1], [0, 0], [[0, 1, 2]], [[]], {"object": "x"}, [None, None]]  # fmt: skip
LEAF = {"vertices": SQUARE, "faces": [[0, 1, 2, 3]], "uv": [[0, 0], [1, 0], [1, 1], [0, 1]]}


def _mutated(rng: random.Random) -> Any:
    kinds = [support.SMALL, {**support.SMALL, "leaf": LEAF}, support.shipped("conifer"), support.RICH]
    data = copy.deepcopy(rng.choice(kinds))
    for _ in range(rng.randint(1, 3)):
        *parents, last = rng.choice(_places(data)[1:])
        place = data
        for step in parents:
            place = place[step]
        change: Callable[[], Any] = rng.choice(
            [
                lambda p=place, k=last: p.pop(k),
                lambda p=place, k=last: p.__setitem__(k, copy.deepcopy(rng.choice(JUNK))),
            ]
        )
        change()
        if not data:
            break
    return data


def test_mutated_files_are_read_or_refused_and_nothing_else(tmp_path: Path) -> None:
    """What passes has finite, positive expectations; what does not names the file. 250 files from a fixed seed.

    Reading and compiling them never takes more memory than a plant of many orders does.
    """
    rng = random.Random(2)
    read = 0
    tracemalloc.start()
    for number in range(250):
        path = tmp_path / f"f{number}.json"
        path.write_text(json.dumps(_mutated(rng)), encoding="utf-8")
        try:
            species = read_species(path)
            flora = compile_species([species]) if number % 10 == 0 else None
        except SpeciesError as error:
            assert path.stem in str(error)
            continue
        read += 1
        if flora:
            assert np.isfinite(flora.bound).all()
            assert (flora.fixed_wood > 0).all()
            assert np.isfinite(flora.polygons).all()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 300e6
    assert 15 < read < 235  # the fuzz reaches both outcomes


def test_rare_leaves_and_branches_compile() -> None:
    """Means so small that no sampled path has met a leaf, or a branch, must not stop the compiler."""
    for changes in (
        {"order1": {"leaves": [0.00001, 0]}, "order2": {"leaves": [0.00001, 0]}},
        {"order0": {"branches": [0.00001, 0]}},
        {"order1": {"branches": [0.00001, 0], "leaves": [0, 0]}},
        {"order1": {"leaves": [0, 0]}, "order2": {"leaves": [0, 0]}},
    ):
        flora = support.compiled(support.small(**changes))
        assert np.isfinite(flora.samples.leaves.position).all()
        rows = np.flatnonzero(flora.area_nodes[:, 0] > 0)
        subplants = support.trunks(flora.rows, support.plants(np.arange(len(rows))))
        subplants = replace(subplants, row=rows.astype(np.int32))
        traces = np.trace(leaf_moments(flora.orientation, subplants), axis1=1, axis2=2)
        assert traces == pytest.approx(np.ones_like(traces))


def test_documentation_is_current() -> None:
    """``python -m devtools.species_docs`` writes the table of keys from the table that the reader uses."""
    text = species_docs.PAGE.read_text(encoding="utf-8")
    assert species_docs.updated(text) == text
    for name in ORDER_KEYS:
        assert f"`{name}`" in text


def numbers_of(text: str) -> set[float]:
    return {float(n.replace(",", "").replace("−", "-")) for n in re.findall(r"[−-]?\d[\d,]*(?:\.\d+)?", text)}


@pytest.mark.parametrize(
    ("table", "kind"),
    [
        ("`bud`", Bud), ("`dead`", Dead), ("`year`", Year), ("`leaf`, `blossom`", LeafYear), ("`age`", Ages),
        ("`ecology`", Ecology),
    ],
)  # fmt: skip
def test_tables_of_parts_say_what_the_reader_takes(table: str, kind: type) -> None:
    """Limits, where a row tells any, and numbers that stand for a key that is left out."""
    text = species_docs.PAGE.read_text(encoding="utf-8")
    rows = text.split(f"\n| {table} | contents |\n")[1].split("\n\n")[0].splitlines()[1:]
    for name, key in keys_of(kind).items():
        (row,) = [row for row in rows if f"`{name}`" in row.split("|")[1]]
        told = row.split("|", 2)[2]
        default = [] if key.needed or not isinstance(key.default, (float, int, tuple, Range)) else key.default
        default = [default.mean, default.variation] if isinstance(default, Range) else np.ravel(default)
        if "default" in told and "none" not in told:
            assert numbers_of(told) >= set(default), row
        limits = [tuple(map(float, pair)) for pair in re.findall(r"(\d[\d.]*) to (\d[\d.]*\d|\d)", told)]
        assert not limits or (key.low, key.high) in limits, row
