# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Attacks on the engine: species, identifiers, paths, texts, cache entries, and polygons of any mesh."""

from __future__ import annotations

import copy
import hashlib
import json
import os
import random
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from tests.attack import material
from tests.attack.watch import Case, Jail
from tests.engine import support
from tetflora_addon import files, storage
from tetflora_addon.assets.patches import mesh_features
from tetflora_addon.compiled.flora import compile_species
from tetflora_addon.emission.polygons import kept_polygons, polygon_blocks
from tetflora_addon.errors import TetFloraError
from tetflora_addon.leaves.models import LEAF_MODELS
from tetflora_addon.parameters import Key
from tetflora_addon.refinement.loop import Refinement, refine
from tetflora_addon.refinement.polygons import Meshes, Polygons, Surface
from tetflora_addon.refinement.settings import RefinementSettings
from tetflora_addon.species.catalog import (
    ORDER_KEYS,
    list_species,
    load_species,
    odd_files,
    read_species,
    species_from_dict,
)

_SETTINGS = RefinementSettings(visibility_resolution=64, max_tetrahedra=4_000)
_FILES = (support.SMALL, support.RICH, *(support.shipped(name) for name in ("grass", "palm", "fern")))


def species(rng: random.Random, jail: Jail) -> None:
    """A file whose values are replaced by others, or lie at their limits; what is accepted grows into a picture."""
    data = copy.deepcopy(rng.choice(_FILES))
    if rng.random() < 0.5:
        data = material.mutated(rng, data)
    for _ in range(rng.randint(0, 6)):
        _to_a_limit(rng, data)
    path = jail.inside / "oak.json"
    path.write_bytes(_dumped(data))
    one = read_species(path)
    flora = compile_species([one])
    seeds = support.plants([rng.randrange(1000)], scale=10.0 ** rng.uniform(-3, 2))
    height = max(float(flora.rows["length"][0, 0]), 1e-3)
    _last(refine(flora, seeds, support.camera((0, -3 * height, height), (0, 0, height / 2)), _SETTINGS))


def _to_a_limit(rng: random.Random, data: Any) -> None:
    orders = data.get("orders") if isinstance(data, dict) else None
    order = rng.choice(orders) if isinstance(orders, list) and orders else None
    if not isinstance(order, dict):
        return
    if rng.random() < 0.1:
        data["leaf"] = _leaf(rng)
        return
    name = rng.choice(list(ORDER_KEYS))
    order[name] = _allowed(rng, ORDER_KEYS[name])


def _allowed(rng: random.Random, key: Key) -> Any:
    """A value that a key may have: often one of its limits."""
    if key.choices:
        return rng.choice(key.choices)
    if key.kind == "color":
        return [[rng.choice([0, 0.5, 1]) for _ in range(3)], [0, 0, 0]]
    if key.kind == "rgb":
        return [rng.choice([0, 0.5, 1]) for _ in range(3)]
    value = rng.choice([key.low, key.high, key.low + (key.high - key.low) * rng.random() ** 4])
    if key.kind == "integer":
        return int(value)
    if key.kind == "range" and rng.random() < 0.5:
        middle = (key.low + key.high) / 2
        return [middle, rng.choice([0, (key.high - key.low) / 2])]
    return value


def _leaf(rng: random.Random) -> Any:
    """A leaf of an odd shape: of no extent across, of many corners, of huge coordinates."""
    if rng.random() < 0.3:
        return [{"model": rng.choice(list(LEAF_MODELS))} for _ in range(rng.randint(1, 8))]
    corners = rng.choice([3, 4, 100, 128, 129, 9000])
    size = rng.choice([1e-12, 1.0, 100.0, 101.0])
    turn = [2 * np.pi * k / corners for k in range(corners)]
    flat = rng.choice([0.0, 1.0])
    vertices = [[size * float(np.cos(t)), flat * size * float(np.sin(t)), 0.0] for t in turn]
    face = list(range(corners))
    # Beyond a million corners, far above what a leaf may have, there is only more text to write and read.
    faces = [face] * min(rng.choice([1, 1, 20, 3000]), 1 + 10**6 // corners)
    return {"vertices": vertices, "faces": faces}


def _dumped(data: Any) -> bytes:
    return json.dumps(data).encode(errors="surrogatepass")


def _last(loop: Any) -> Refinement:
    while True:
        try:
            next(loop)
        except StopIteration as stop:
            return stop.value


def texts(rng: random.Random, jail: Jail) -> None:
    """Bytes in place of a species file, in a folder whose other species must stay."""
    folder = jail.inside / "species"
    folder.mkdir(exist_ok=True)
    path = folder / f"{rng.choice(['oak', 'bush', 'con', 'a b'])}.json"
    content = material.json_text(rng)
    if rng.random() < 0.3:
        content = bytearray(_dumped(support.SMALL))
        content[rng.randrange(len(content))] = rng.choice([rng.randrange(256), ord("1"), ord(" "), ord("a")])
        content = bytes(content)
    path.write_bytes(content if isinstance(content, bytes) else content.encode(errors="surrogatepass"))
    try:
        assert {"bush", "conifer"} <= set(list_species([folder]))
        odd_files([folder])
        load_species(path.stem, [folder])
    finally:
        path.unlink()


def identifiers(rng: random.Random, jail: Jail) -> None:
    """A name in place of an identifier: a file of it lies right in its folder, or there is none."""
    name = material.identifier(rng, jail.outside)
    folder = jail.inside / "own"
    folder.mkdir(exist_ok=True)
    with suppress(TetFloraError):
        load_species(name, [folder])
    if files.is_identifier(name):
        path = files.path_in(folder, name + ".json")
        files.write_whole(path, "{}")
        assert os.listdir(folder) == [path.name]
        path.unlink()
    species_from_dict(support.SMALL, name, name)


def paths(rng: random.Random, jail: Jail) -> None:
    """A path in place of a name: links, folders, pipes and devices."""
    folder = jail.inside / "paths"
    folder.mkdir(exist_ok=True)
    for entry in folder.iterdir():
        entry.rmdir() if entry.is_dir() and not entry.is_symlink() else entry.unlink()
    target = folder / "file"
    way = rng.randrange(6)
    if way == 0:
        target.symlink_to(jail.outside / rng.choice(["secret.json", "deep", "nothing"]))
    elif way == 1:
        target.mkdir()
    elif way == 2:
        os.mkfifo(target)
    elif way == 3:
        target.write_bytes(rng.randbytes(rng.choice([0, 10, 5000])))
    elif way == 4:
        target = Path(rng.choice(["/dev/zero", "/dev/stdin", "/proc/self/mem", "/", "/etc"]))
    else:
        target = folder / material.identifier(rng, jail.outside)
    try:
        content = files.read_whole(target, 1000)
        assert len(content) <= 1000
    except OSError:
        pass
    try:
        path = files.path_in(folder, material.identifier(rng, jail.outside) if way == 5 else "file")
        files.write_whole(path, b"content")
    except OSError as error:
        raise TetFloraError(str(error)) from None


_VALUES = np.arange(12.0)


def cache(rng: random.Random, jail: Jail) -> None:
    """An entry of the cache that is damaged, packed, a link, or another one's: the result is the same."""
    folder = jail.inside / "cache"
    folder.mkdir(exist_ok=True)
    content = hashlib.sha256(rng.randbytes(8)).hexdigest()
    path = folder / f"tetflora-attack-1-{content}.npz"
    way = rng.randrange(8)
    if way == 0:
        path.symlink_to(jail.outside / rng.choice(["secret", "nothing"]))
    elif way == 1:
        path.mkdir()
    elif way == 2:
        os.mkfifo(path)
    else:
        path.write_bytes(material.cache_entry(rng, path.name, _VALUES))
    before = storage.current_folder()
    try:
        storage.set_folder(folder)
        for _ in range(2):
            found = storage.cached("attack", content, _VALUES.shape, lambda: _VALUES)
            assert found.shape == _VALUES.shape
        storage.clear()
    finally:
        storage.set_folder(before)
        if path.is_dir() and not path.is_symlink():
            path.rmdir()
        path.unlink(missing_ok=True)


def polygons(rng: random.Random, _jail: Jail) -> None:
    """A mesh of any faces: of many corners, of no area, far away, with a vertex twice, mirrored or flattened."""
    draw = np.random.default_rng(rng.randrange(1 << 30))
    size, number = 10.0 ** rng.uniform(-6, 6), rng.choice([3, 4, 50, 400])
    places = draw.uniform(-1, 1, (number, 3)) * size * np.array([1, 1, rng.choice([0, 1e-9, 1])])
    if rng.random() < 0.2:
        places[rng.randrange(number)] = rng.choice([np.nan, np.inf, 1e38])
    faces = [list(range(number))] if rng.random() < 0.3 else []
    for _ in range(rng.choice([1, 10, 300])):
        faces.append(draw.integers(0, number, rng.choice([3, 3, 4, 5, 40])).tolist())
    matrices = np.tile(np.eye(4), (rng.choice([1, 3]), 1, 1))
    matrices[:, :3, :3] *= draw.choice([1.0, -1.0, 0.0, 1e-3, 1e3], (len(matrices), 1, 3))
    matrices[:, :3, 3] = draw.uniform(-1, 1, (len(matrices), 3)) * 10.0 ** rng.uniform(-3, 6)
    sizes = [len(f) for f in faces]
    offsets = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int32)
    corners = np.concatenate(faces).astype(np.int32)
    triangles = [[s, s + k, s + k + 1] for s, n in zip(offsets, sizes, strict=False) for k in range(1, n - 1)]
    if not np.isfinite(places).all():
        features = np.zeros(len(faces), bool), np.zeros(len(faces), bool), np.ones(len(faces))
    else:
        features = mesh_features(places, corners, offsets)
    one = Surface(
        "mesh", places, corners, offsets, np.array(triangles, np.int32), np.zeros(len(faces), np.int32),
        np.full((1, 3), 0.5), np.zeros(1), np.ones(1), *features,
    )  # fmt: skip
    try:
        meshes = Meshes([one], np.zeros(len(matrices), int), matrices)
    except ValueError as error:
        assert "not finite" in str(error)
        raise TetFloraError(str(error)) from None
    whole = Polygons.everything(meshes)
    camera = support.camera((0, -3 * size, 0), (0, 0, 0), near=size / 10)
    result = _last(refine(support.small_flora(), support.plants([]), camera, _SETTINGS, None, whole))
    drawn = support.refined(support.small_flora(), result, camera, 1.2, 0.6)
    assert not list(drawn.mesh_blocks())
    assert all(np.isfinite(facets.center).all() for parts in drawn.facet_parts() for facets, _ in parts)
    for block in (*drawn.polygon_blocks(), *polygon_blocks(kept_polygons(result))):
        assert np.isfinite(block.buffers.positions).all()


#: Each kind and its share of all cases.
SHARES: dict[str, tuple[Case, float]] = {
    "species": (species, 0.2),
    "texts": (texts, 0.2),
    "identifiers": (identifiers, 0.2),
    "paths": (paths, 0.15),
    "cache": (cache, 0.15),
    "polygons": (polygons, 0.1),
}


def kinds(number: int) -> dict[str, tuple[Case, int]]:
    """Kinds of cases, and how many of each."""
    return {name: (case, round(share * number)) for name, (case, share) in SHARES.items()}
