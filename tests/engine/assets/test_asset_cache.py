# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Compiled assets come back from the disk to the last bit; whatever else lies there counts as absent."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.engine.assets import trees
from tests.engine.refinement.test_asset_parts import opened_to_the_end, placed_of
from tests.limits import full_disk
from tetflora_addon import storage
from tetflora_addon.assets import asset_cache
from tetflora_addon.assets.asset import Asset
from tetflora_addon.assets.measures import kite_mesh


@pytest.fixture
def folder(tmp_path: Path) -> Iterator[Path]:
    """A folder that is used and not there yet."""
    storage.set_folder(tmp_path / "cache")
    asset_cache.forget()
    yield tmp_path / "cache" / "assets"
    asset_cache.forget()
    storage.set_folder(None)


def asset(digest: str = "ab") -> Asset:
    return replace(trees.compiled("varied"), digest=digest)


def stored(folder: Path, digest: str = "ab") -> Path:
    asset_cache.keep(asset(digest))
    asset_cache.forget()
    return folder / f"tetflora-compiled-{asset_cache.METHOD}-{digest}.npz"


def same(one: Asset, other: Asset) -> bool:
    columns = [
        (getattr(getattr(one, name), key), getattr(getattr(other, name), key))
        for name in ("clusters", "samples", "leaves")
        for key in vars(getattr(one, name))
    ]
    columns += [(one.part, other.part), (one.face, other.face)]
    exact = all(a.dtype == b.dtype and a.tobytes() == b.tobytes() for a, b in columns)
    return exact and (one.name, one.digest) == (other.name, other.digest)


def test_what_was_compiled_comes_back(folder: Path) -> None:
    assert asset_cache.find("ab") is None
    path = stored(folder)
    assert [p.name for p in folder.iterdir()] == [path.name]
    found = asset_cache.find("ab")
    assert same(found, asset())
    assert asset_cache.find("ab") is found  # in memory from now on
    assert asset_cache.find("abc") is asset_cache.find("a") is None
    assert storage.last_problem() == ""


def test_in_memory_without_a_folder(tmp_path: Path) -> None:
    storage.set_folder(None)
    asset_cache.forget()
    asset_cache.keep(asset())
    assert same(asset_cache.find("ab"), asset())
    asset_cache.forget()
    assert asset_cache.find("ab") is None


@pytest.mark.parametrize("digest", ["", "../ab", "AB", "ab/cd", "ab\n", "xy", "ab.npz"])
def test_digests_lead_nowhere_else(folder: Path, digest: str) -> None:
    asset_cache.keep(asset(digest))
    assert not folder.exists() or not list(folder.iterdir())
    assert not [p for p in folder.parent.parent.rglob("*") if p.is_file()]
    asset_cache.forget()
    assert asset_cache.find(digest) is None


def test_memory_keeps_what_was_asked_for_last(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    storage.set_folder(None)
    monkeypatch.setattr(asset_cache, "_MOST_MEMORY", 3 * asset().nbytes)
    for digest in ("a1", "a2", "a3"):
        asset_cache.keep(asset(digest))
    assert asset_cache.find("a1") is not None
    asset_cache.keep(asset("a4"))
    assert [d for d in ("a1", "a2", "a3", "a4") if asset_cache.find(d) is not None] == ["a1", "a3", "a4"]
    monkeypatch.setattr(asset_cache, "_MOST_MEMORY", 1)
    asset_cache.keep(asset("a5"))  # the last one stays, however large
    assert asset_cache.find("a5") is not None and asset_cache.find("a4") is None


def test_the_folder_keeps_what_was_asked_for_last(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    size = stored(folder, "a1").stat().st_size
    monkeypatch.setattr(asset_cache, "_MOST_FILES", 3 * size)
    foreign = folder / "notes.npz"
    foreign.write_bytes(b"mine" * size)
    for digest in ("a2", "a3", "a4", "a5"):
        stored(folder, digest)
    assert foreign.exists()
    assert len([p for p in folder.iterdir() if p != foreign]) <= 3
    assert same(asset_cache.find("a5"), asset("a5"))


@pytest.mark.parametrize("how", ["empty", "junk", "cut", "packed", "of another", "other type", "not finite", "objects"])
def test_damaged_packed_and_foreign_files_count_as_absent(folder: Path, how: str) -> None:
    path = stored(folder)
    whole = path.read_bytes()
    columns = dict(np.load(io.BytesIO(whole)))
    if how == "packed":
        content = io.BytesIO()
        np.savez_compressed(content, **columns)
        path.write_bytes(content.getvalue())
    elif how in {"of another", "other type", "not finite", "objects"}:
        area = columns["clusters.leaf_area"]
        changed = {
            "of another": {"digest": np.array("cd")},
            "other type": {"clusters.leaf_area": area.astype(np.float32)},
            "not finite": {"clusters.leaf_area": area * np.nan},
            "objects": {"name": np.array([{}], object)},
        }[how]
        with path.open("wb") as file:
            np.savez(file, **{**columns, **changed})
    else:
        path.write_bytes({"empty": b"", "junk": b"junk" * 999, "cut": whole[: len(whole) // 2]}[how])
    assert asset_cache.find("ab") is None
    assert str(path) in storage.last_problem()
    asset_cache.keep(asset())
    asset_cache.forget()
    assert same(asset_cache.find("ab"), asset())


def test_a_link_or_a_folder_instead_of_a_file(folder: Path, tmp_path: Path) -> None:
    path = stored(folder)
    path.rename(tmp_path / "elsewhere.npz")
    path.mkdir()
    assert asset_cache.find("ab") is None
    asset_cache.keep(asset())
    asset_cache.forget()
    assert asset_cache.find("ab") is None


def test_a_full_disk_stops_nobody(folder: Path, capsys: pytest.CaptureFixture) -> None:
    with full_disk(10_000):
        asset_cache.keep(asset())
    assert capsys.readouterr().err.count("warning") == 1
    assert same(asset_cache.find("ab"), asset())
    asset_cache.forget()
    assert asset_cache.find("ab") is None
    assert not list(folder.iterdir())


def use(one: Asset) -> None:
    """What refinement does with an asset."""
    parts = opened_to_the_end(placed_of(one))
    assert len(parts)
    for cluster in range(len(one.clusters)):
        one.faces_of(cluster)
        kite_mesh(one.leaves_of(cluster))


@pytest.mark.parametrize("seed", range(30))
def test_files_that_somebody_has_changed_never_raise(folder: Path, seed: int) -> None:
    """Bytes anywhere, or numbers in arrays: absent, or an asset that can be used."""
    rng = np.random.default_rng(seed)
    path = stored(folder)
    if seed % 3 == 0:
        whole = bytearray(path.read_bytes())
        for place in rng.integers(0, len(whole), rng.integers(1, 40)).tolist():
            whole[place] = int(rng.integers(0, 256))
        path.write_bytes(whole)
    else:
        columns = {key: value.copy() for key, value in np.load(path).items()}
        for name in rng.choice([n for n in columns if n not in {"name", "digest"}], 2).tolist():
            column, kind = columns[name], columns[name].dtype.kind
            if seed % 3 == 1:
                extremes = [0, -1, 1, 3, 10**6, 2**31 - 1, -(2**31)]
                column.reshape(-1)[rng.integers(0, column.size)] = rng.choice(extremes if kind == "i" else [0.0, -1.0])
            else:
                columns[name] = column[: rng.integers(0, len(column))]
        with path.open("wb") as file:
            np.savez(file, **columns)
    found = asset_cache.find("ab")
    if found is not None:
        use(found)


@pytest.mark.parametrize("name", ["child", "children", "first_face", "first_leaf", "leaf_sample", "wood_samples"])
@pytest.mark.parametrize("value", [2**31 - 1, 2**31 - 2, -1, -(2**31)])
def test_numbers_that_overflow_point_beyond_themselves(folder: Path, name: str, value: int) -> None:
    path = stored(folder)
    columns = {key: stored_.copy() for key, stored_ in np.load(path).items()}
    columns[f"clusters.{name}"][0] = value
    with path.open("wb") as file:
        np.savez(file, **columns)
    assert asset_cache.find("ab") is None


@pytest.mark.parametrize("value", [2**63 - 1, 2**63 - 5, 2**40])
def test_long_numbers_too(folder: Path, value: int) -> None:
    path = stored(folder)
    columns = {key: stored_.copy() for key, stored_ in np.load(path).items()}
    columns["clusters.first_face"][3] = value
    with path.open("wb") as file:
        np.savez(file, **columns)
    assert asset_cache.find("ab") is None


def test_a_file_that_claims_to_be_large_is_not_believed(folder: Path) -> None:
    """An archive whose header announces more than it has."""
    path = stored(folder)
    content = io.BytesIO()
    with zipfile.ZipFile(path) as old, zipfile.ZipFile(content, "w") as new:
        for name in old.namelist():
            data = old.read(name)
            if name == "part.npy":
                data = data.replace(
                    b"(%d,)" % len(asset().part), b"(99999999999,)"[: len(b"(%d,)" % len(asset().part))]
                )
            new.writestr(name, data)
    path.write_bytes(content.getvalue())
    found = asset_cache.find("ab")
    assert found is None or same(found, asset())


def test_clearing_deletes_what_is_ours(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(storage, "_folder", tmp_path)
    folder = tmp_path / "assets"
    folder.mkdir()
    own = folder / f"tetflora-compiled-{asset_cache.METHOD}-ab12.npz"
    own.write_bytes(b"one")
    (folder / "notes.txt").write_text("stays")
    assert asset_cache.clear() == 1
    assert not own.exists()
    assert (folder / "notes.txt").exists()
    assert asset_cache.clear() == 0
