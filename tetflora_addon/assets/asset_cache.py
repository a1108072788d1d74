# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Compiled assets are kept by their digest: in memory for the session, and in a folder of the cache across sessions.

Files are read as those of strangers: one that is damaged, packed, too large or points beyond itself counts as absent.
"""

import re
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .. import storage
from .asset import COUNTS, Asset, AssetKites, Clusters, SurfaceSamples

#: Raise it when assets are compiled in another way.
METHOD = 8
#: Bytes of a file at most, of all files of a user, and of what is kept in memory.
_MOST, _MOST_FILES, _MOST_MEMORY = 1 << 30, 4 << 30, 768 << 20
_NAMES = re.compile(r"tetflora-compiled-\d+-[0-9a-f]+\.npz")
_KINDS = {"clusters": Clusters, "samples": SurfaceSamples, "leaves": AssetKites}

_known: dict[str, Asset] = {}  # least recently asked for first


def find(digest: str) -> Asset | None:
    """A compiled asset by the digest of its source; None if nobody has compiled it, or it is gone."""
    asset = _known.pop(digest, None)
    if asset is None and (path := _path(digest)) is not None:
        asset = _read(path, digest)
    if asset is not None:
        _remember(asset)
    return asset


def keep(asset: Asset) -> None:
    """Keep an asset; trouble with the folder is reported once and stops nothing."""
    _remember(asset)
    path = _path(asset.digest)
    if path is None:
        return
    every = ((name, f.name) for name, kind in _KINDS.items() for f in fields(kind))
    columns = {f"{name}.{column}": getattr(getattr(asset, name), column) for name, column in every}
    columns |= {"name": np.array(asset.name), "digest": np.array(asset.digest), "part": asset.part, "face": asset.face}
    storage.write_arrays(path, _NAMES, _MOST_FILES, **columns)


def clear() -> int:
    """Delete all compiled assets of this user in the folder, and drop those in memory; returns how many files.

    Errors are those of `storage.clear`.
    """
    forget()
    used = storage.current_folder()
    return storage.clear(used / "assets", _NAMES) if used is not None else 0


def forget() -> None:
    """Drop what is kept in memory."""
    _known.clear()


def _remember(asset: Asset) -> None:
    _known.pop(asset.digest, None)
    _known[asset.digest] = asset
    while len(_known) > 1 and sum(one.nbytes for one in _known.values()) > _MOST_MEMORY:
        del _known[next(iter(_known))]


def _path(digest: str) -> Path | None:
    folder = storage.current_folder()
    if folder is None or not re.fullmatch("[0-9a-f]+", digest):
        return None
    return folder / "assets" / f"tetflora-compiled-{METHOD}-{digest}.npz"


def _read(path: Path, digest: str) -> Asset | None:
    def checked(stored: Mapping[str, NDArray]) -> Asset:
        arrays = [kind(*(stored[f"{name}.{f.name}"] for f in fields(kind))) for name, kind in _KINDS.items()]
        asset = Asset(str(stored["name"]), str(stored["digest"]), *arrays, stored["part"], stored["face"])
        _check(asset, digest)
        return asset

    return storage.read_arrays(path, _MOST, checked)


def _check(asset: Asset, digest: str) -> None:
    """Refuse what is not an asset by a ValueError."""
    for kind, rows in ((Clusters, asset.clusters), (SurfaceSamples, asset.samples), (AssetKites, asset.leaves)):
        model = kind.empty()
        for f in fields(kind):
            column, wanted = getattr(rows, f.name), getattr(model, f.name)
            if column.dtype != wanted.dtype or column.shape[1:] != wanted.shape[1:] or len(column) != len(rows):
                raise ValueError(f.name)
            if column.dtype.kind == "f" and not np.isfinite(column).all():
                raise ValueError(f.name)
    clusters, count = asset.clusters, len(asset.clusters)
    runs = [(clusters.child, clusters.children, count), (clusters.first_face, clusters.faces, asset.faces)]
    runs += [(clusters.leaf_sample, clusters.leaf_samples, len(asset.samples))]
    runs += [(clusters.wood_sample, clusters.wood_samples, len(asset.samples))]
    runs += [(clusters.first_leaf, clusters.leaves, len(asset.leaves))]
    numbers = [*(column for first, number, _ in runs for column in (first, number)), asset.part, asset.face]
    sound = (
        count > 0
        and asset.digest == digest
        and clusters.weights.shape[1] == len(COUNTS)
        and asset.part.dtype == asset.face.dtype == np.int32
        and asset.part.shape == asset.face.shape == (asset.faces,)
        and all((number >= 0).all() for number in numbers)
        and all((first <= most - number.astype(np.int64)).all() for first, number, most in runs)  # sums may overflow
        and (clusters.parent < np.arange(count)).all()
        and (clusters.child[clusters.children > 0] > np.flatnonzero(clusters.children > 0)).all()
    )
    if not sound:
        raise ValueError("it points beyond itself")
