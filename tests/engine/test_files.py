# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Names, paths and files of anybody: what is used of them, and that nothing else is touched."""

from __future__ import annotations

import json
import os
import random
import string
import unicodedata
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.attack import material
from tetflora_addon import files
from tetflora_addon.errors import MESSAGE, NAME, VALUE, TetFloraError, quoted, readable

needs_links = pytest.mark.skipif(os.name == "nt", reason="links need rights on Windows")


@pytest.mark.parametrize("name", ["oak", "Oak_2", "-", "a" * 64, "2", "con1", "com", "lpt_1", "beech-old"])
def test_identifiers_that_every_system_takes(name: str) -> None:
    assert files.is_identifier(name)


@pytest.mark.parametrize("name", material.IDENTIFIERS)
def test_identifiers_that_lead_elsewhere_or_that_some_system_refuses(name: str) -> None:
    assert not files.is_identifier(name)


@given(st.text(max_size=70))
def test_an_identifier_is_a_name_right_in_its_folder(text: str) -> None:
    if files.is_identifier(text):
        assert set(text) <= set(string.ascii_letters + string.digits + "_-")
        assert 0 < len(text) <= 64
        assert files.path_in(Path("folder"), text + ".json") == Path("folder") / f"{text}.json"


@given(st.text(st.characters(), max_size=20) | st.sampled_from(material.IDENTIFIERS))
def test_a_path_lies_right_in_its_folder_or_is_refused(tmp_path_factory: pytest.TempPathFactory, name: str) -> None:
    folder = tmp_path_factory.getbasetemp()
    try:
        path = files.path_in(folder, name)
    except OSError as error:
        assert readable(error.strerror) == error.strerror
        return
    assert os.path.normpath(path) == str(path)
    assert path.parent == folder


@needs_links
def test_what_a_link_leads_to_is_neither_read_nor_written(tmp_path: Path) -> None:
    target, link = tmp_path / "target", tmp_path / "link.json"
    target.write_bytes(b"mine")
    link.symlink_to(target)
    assert not files.is_regular(link)
    with pytest.raises(OSError, match="it is a link"):
        files.read_whole(link, 100)
    files.write_whole(link, "new")
    assert target.read_bytes() == b"mine"
    assert files.read_whole(link, 100) == b"new"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["link.json", "target"]


@needs_links
def test_folders_above_may_be_links(tmp_path: Path) -> None:
    (tmp_path / "real").mkdir()
    (tmp_path / "other").symlink_to(tmp_path / "real", target_is_directory=True)
    files.write_whole(files.path_in(tmp_path / "other", "a.json"), b"here")
    assert files.read_whole(tmp_path / "other" / "a.json", 10) == (tmp_path / "real" / "a.json").read_bytes() == b"here"


@needs_links
@pytest.mark.parametrize("without", [False, True], ids=["O_NOFOLLOW", "without it"])
def test_a_file_that_is_replaced_by_a_link_while_it_is_opened(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, without: bool
) -> None:
    path, target, real = tmp_path / "a.json", tmp_path / "target", os.open
    path.write_bytes(b"mine")
    target.write_bytes(b"secret")

    def open_late(name: Path, flags: int) -> int:
        path.unlink()
        path.symlink_to(target)
        return real(name, flags)

    if without:
        monkeypatch.setattr(files, "_READING", files._READING & ~files._NO_LINKS)
        monkeypatch.setattr(files, "_NO_LINKS", 0)
    monkeypatch.setattr(os, "open", open_late)
    with pytest.raises(OSError, match=r"meanwhile|symbolic link"):
        files.read_whole(path, 100)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="Windows has no pipes with names")
def test_pipes_devices_and_folders_are_no_files_and_hold_nobody_up(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "folder").mkdir()
    for path, why in ((tmp_path / "pipe", "regular"), (tmp_path / "folder", "folder"), (Path("/dev/zero"), "regular")):
        with pytest.raises(OSError, match=why):
            files.read_whole(path, 100)
        assert not files.is_regular(path)


def test_a_file_has_a_limit_of_size_whatever_it_says(tmp_path: Path) -> None:
    path = tmp_path / "a"
    path.write_bytes(bytes(100))
    assert len(files.read_whole(path, 100)) == 100
    with pytest.raises(OSError, match="larger than 99 bytes"):
        files.read_whole(path, 99)
    with path.open("wb") as file:
        file.truncate(1 << 40)  # a terabyte of nothing
    with pytest.raises(OSError, match="larger than 1,000 bytes"):
        files.read_whole(path, 1000)
    endless = Path("/proc/self/maps")  # says to have no bytes
    if endless.exists():
        with pytest.raises(OSError, match="larger than 10 bytes"):
            files.read_whole(endless, 10)


@pytest.mark.parametrize("name", ["a\0b", "\ud800", "a\0b.json"])
def test_names_that_no_system_takes_are_errors_of_the_system(tmp_path: Path, name: str) -> None:
    for do in (lambda p: files.read_whole(p, 10), lambda p: files.write_whole(p, ""), lambda p: files.path_in(p, "a")):
        with pytest.raises(OSError, match="no file can have such a name"):
            do(tmp_path / name)
    assert not files.is_regular(tmp_path / name)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (b"\xff", "not UTF-8 text"),
        ('"\\ud800"', "half of a surrogate pair"),
        ('{"a\\udfff": 1}', "half of a surrogate pair"),
        ("\ud800", "half of a surrogate pair"),
        ("[" * 200_000, "within each other"),
        ('{"a": 1, "b": {"c": 1, "c": 2}}', "^c: duplicate key"),
        ('{"\\u0000\\u001b[2J": 1, "\\u0000\\u001b[2J": 2}', r"^ \[2J: duplicate key"),
        ("[1,]", "is not valid JSON"),
    ],
)
def test_what_is_no_json_is_said(text: bytes | str, says: str) -> None:
    with pytest.raises(ValueError, match=says) as caught:
        files.parse_json(text)
    assert readable(str(caught.value)) == str(caught.value)


def test_keys_that_come_twice_are_found_at_once() -> None:
    keys = [f'"{n}": 0' for n in range(200_000)]
    with pytest.raises(ValueError, match=r"^199999: duplicate"):
        files.parse_json("{" + ",".join([*keys, keys[-1]]) + "}")


def test_json_has_numbers_that_floats_can_hold() -> None:
    read = files.parse_json("[1, -7, 1" + "0" * 400 + ", -1" + "0" * 5000 + ", 1e999, NaN]")
    assert read[:5] == [1, -7, float("inf"), float("-inf"), float("inf")]
    assert all(float(n) == n for n in read[:5])
    assert files.parse_json('"\\ud83c\\udf33"') == "\N{DECIDUOUS TREE}"


@given(st.text(st.characters()))
def test_a_readable_text_is_one_line_that_everything_can_show(text: str) -> None:
    told = str(TetFloraError(text))
    told.encode()
    assert len(told) <= MESSAGE
    assert not any(unicodedata.category(c) in {"Cc", "Cs"} for c in told)
    assert len(readable(text, NAME)) <= NAME


def test_what_people_write_stays() -> None:
    for text in ("Łąka", "Größe, 2 m", "樱花", "نخلة", "\N{DECIDUOUS TREE}", "a\N{NO-BREAK SPACE}b"):
        assert readable(text) == text


@given(
    st.recursive(
        st.none() | st.floats() | st.integers() | st.text(st.characters()), lambda s: st.lists(s) | st.tuples(s)
    )
)
def test_values_in_messages_are_short(value: object) -> None:
    assert len(quoted(value)) <= VALUE
    quoted(value).encode()


def test_values_too_large_for_a_message() -> None:
    deep: list = []
    for _ in range(200_000):
        deep = [deep]
    assert "too large" in quoted(deep)
    assert "too large" in quoted(10**5000)
    while deep:  # or Python itself falls over it
        deep = deep.pop()


def test_attack_on_names_and_paths(tmp_path: Path) -> None:
    """A thousand names from a seed: each is refused, or names a file right in the folder; nothing else changes."""
    rng = random.Random(18)
    folder, outside = tmp_path / "a" / "species", tmp_path / "secret.json"
    folder.mkdir(parents=True)
    outside.write_text("mine", encoding="utf-8")
    written = 0
    for _ in range(1000):
        name = material.identifier(rng, tmp_path)
        try:
            path = files.path_in(folder, name + ".json")
            files.write_whole(path, "x")
        except OSError:
            continue
        written += 1
        assert path.parent == folder
        assert files.read_whole(path, 10) == b"x"
        path.unlink()
    assert 50 < written < 950
    assert outside.read_text(encoding="utf-8") == "mine"
    assert [str(p.relative_to(tmp_path)) for p in sorted(tmp_path.rglob("*"))] == ["a", "a/species", "secret.json"]


def test_attack_on_json(tmp_path: Path) -> None:
    """Two thousand texts from a fixed seed: each is decoded to what can be written again, or refused by a text."""
    rng = random.Random(19)
    decoded = 0
    for _ in range(2000):
        text = material.json_text(rng)
        try:
            data = files.parse_json(text)
        except ValueError as error:
            assert readable(str(error)) == str(error)
            continue
        decoded += 1
        json.dumps(data, ensure_ascii=False).encode()
    assert 100 < decoded < 1900
