# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The user's species folder, whatever lies there: an odd file is skipped and named, and empties no menu."""

from __future__ import annotations

import json
import os
import random
import sys
from pathlib import Path

import pytest

from tests.attack import material
from tests.engine import support
from tetflora_addon.errors import MESSAGE, NAME, SpeciesError, readable
from tetflora_addon.species import catalog
from tetflora_addon.species.catalog import (
    MAX_FILE_BYTES,
    checked_identifier,
    list_species,
    load_species,
    odd_files,
    read_species,
    species_from_dict,
    species_from_json,
)

SHIPPED = set(support.SPECIES)


def put(folder: Path, file_name: str, **changes: object) -> None:
    """A sound species file by a name, which may be no text."""
    path = os.path.join(os.fsencode(folder), os.fsencode(file_name))
    with open(path, "wb") as file:
        file.write(json.dumps(support.small(**changes)).encode())


@pytest.mark.skipif(sys.platform != "linux", reason="other systems refuse such names themselves")
@pytest.mark.parametrize(
    "name",
    ["my oak", "é", "a\nb", "a\x1b[2Jb", "\udcff", "...", "CON", "a" * 65, "a:b", "oak.v2", " ", "\u202e"],
    ids=ascii,
)
def test_a_file_of_an_odd_name_is_skipped_and_named(tmp_path: Path, name: str) -> None:
    put(tmp_path, name + ".json")
    put(tmp_path, "mine.json")
    assert set(list_species([tmp_path])) == SHIPPED | {"mine"}
    (told,) = odd_files([tmp_path])
    told.encode()
    assert told.startswith(f'"{readable(name)}.json"')
    assert "rename the file" in told
    assert "\n" not in told
    with pytest.raises(SpeciesError):
        checked_identifier(name)


@pytest.mark.skipif(os.name == "nt", reason="links need rights on Windows")
def test_links_folders_and_pipes_are_skipped_and_named(tmp_path: Path) -> None:
    folder = tmp_path / "species"
    folder.mkdir()
    put(tmp_path, "elsewhere.json", name="Elsewhere")
    (folder / "bush.json").symlink_to(tmp_path / "elsewhere.json")
    (folder / "dangling.json").symlink_to(tmp_path / "nowhere.json")
    (folder / "folder.json").mkdir()
    os.mkfifo(folder / "pipe.json")
    put(folder, "mine.json")
    assert set(list_species([folder])) == SHIPPED | {"mine"}
    assert list_species([folder])["bush"].name == "Bush"
    assert [text.split(":")[0] for text in odd_files([folder])] == [
        f'"{name}.json"' for name in ("bush", "dangling", "folder", "pipe")
    ]
    with pytest.raises(SpeciesError, match=r"pipe\.json: cannot be read: it is not a regular file"):
        read_species(folder / "pipe.json")


def test_shipped_files_are_all_listed() -> None:
    assert odd_files([catalog.builtin_folder()]) == []
    assert set(list_species()) == SHIPPED


def test_folders_are_gone_through_once_until_a_file_in_them_changes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where nothing is drawn, species are listed for each of a scene's plants."""
    put(tmp_path, "mine.json")
    list_species([tmp_path])
    looked = []
    real = catalog.is_regular
    monkeypatch.setattr(catalog, "is_regular", lambda path: looked.append(path.stem) or real(path))
    assert "mine" in list_species([tmp_path])
    assert looked == []
    put(tmp_path, "other.json")
    assert {"mine", "other"} <= set(list_species([tmp_path]))
    put(tmp_path, "mine.json", name="Another Name")
    assert list_species([tmp_path])["mine"].name == "Another Name"
    (tmp_path / "mine.json").unlink()
    assert set(list_species([tmp_path])) == SHIPPED | {"other"}
    assert set(looked) == {"mine", "other"}  # not those of the shipped folder


def test_a_file_that_goes_away_while_folders_are_looked_at(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    put(tmp_path, "mine.json")
    real = catalog.is_regular
    monkeypatch.setattr(catalog, "is_regular", lambda path: real(path) and (path.stem != "mine" or not path.unlink()))
    assert "cannot be read" in list_species([tmp_path])["mine"].description
    with pytest.raises(SpeciesError, match=r"mine\.json: cannot be read"):
        load_species("mine", known={"mine": catalog.FileInfo("mine", "", "", tmp_path / "mine.json")})


def test_names_in_menus_are_short_and_can_be_shown(tmp_path: Path) -> None:
    put(tmp_path, "mine.json", name="a\x00b\x1b[2J\n\u202e" + "x" * 900, description="y\r\n" * 300)
    put(tmp_path, "half.json", name="\ud800")
    put(tmp_path, "blank.json", name="\x00\x01")
    (tmp_path / "list.json").write_text("[1]", encoding="utf-8")
    found = list_species([tmp_path])
    assert found["mine"].name.startswith("a b [2J xxx")
    assert len(found["mine"].name) == NAME
    assert found["half"].name == "half"
    assert found["blank"].name == "blank"
    assert found["list"].name == "list"
    for info in found.values():
        assert readable(info.name) == info.name
        assert readable(info.description) == info.description
    assert load_species("mine", [tmp_path]).name.startswith("a b [2J xxx")
    with pytest.raises(SpeciesError, match="half of a surrogate pair"):
        load_species("half", [tmp_path])
    with pytest.raises(SpeciesError, match="name: must be a string"):
        load_species("blank", [tmp_path])


@pytest.mark.parametrize("key", ["a" * 100_000, "\x1b]0;owned\x07", "lenght\u202e\n"])
def test_keys_are_told_short_and_clean(key: str) -> None:
    for data in (support.small() | {key: 1}, support.small(order0={key: 1})):
        with pytest.raises(SpeciesError, match="unknown key") as caught:
            species_from_dict(data, "oak", "oak.json")
        assert readable(str(caught.value)) == str(caught.value)
        assert len(str(caught.value)) < MESSAGE


@pytest.mark.parametrize("number", ["1" + "0" * 400, "-1" + "0" * 400, "1" + "0" * 5000, "1e999"])
def test_numbers_beyond_floats_are_refused_by_name(number: str) -> None:
    text = json.dumps(support.small(order0={"taper": 77})).replace('"taper": 77', f'"taper": {number}')
    with pytest.raises(SpeciesError, match=r"orders\[0\]\.taper.*0 to 1, not -?inf"):
        species_from_json(text, "oak", "oak.json")


def test_a_file_that_is_too_large_is_listed_and_refused(tmp_path: Path) -> None:
    (tmp_path / "large.json").write_bytes(b" " * (MAX_FILE_BYTES + 1))
    assert "cannot be read" in list_species([tmp_path])["large"].description
    with pytest.raises(SpeciesError, match="larger than"):
        load_species("large", [tmp_path])


def test_attack_on_species_files() -> None:
    """A thousand files from a fixed seed: each is a species, or refused by a message that names the file."""
    rng = random.Random(21)
    read = 0
    kinds = [support.SMALL, support.shipped("conifer"), support.RICH]
    for _ in range(1000):
        data = material.mutated(rng, rng.choice(kinds))
        try:
            species_from_json(json.dumps(data), "oak", "oak.json")
        except SpeciesError as error:
            assert str(error).startswith("oak.json: ")
            assert readable(str(error)) == str(error)
            continue
        read += 1
    assert 10 < read < 990
