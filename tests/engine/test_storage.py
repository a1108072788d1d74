# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Results come from the folder as they were found out; whatever happens to it, nothing raises and nothing is wrong."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.engine import support
from tests.limits import full_disk
from tetflora_addon import storage
from tetflora_addon.compiled.flora import compile_species
from tetflora_addon.errors import TetFloraError
from tetflora_addon.proxies import facet_weights
from tetflora_addon.species.catalog import load_species, species_from_dict

ROOT = Path(__file__).resolve().parents[2]
TRUTH = np.linspace(0.0, 1.0, 24).reshape(2, 3, 4)


@pytest.fixture
def folder(tmp_path: Path) -> Iterator[Path]:
    """A folder that is used and not there yet."""
    storage.set_folder(tmp_path / "cache")
    yield tmp_path / "cache"
    storage.set_folder(None)


def asked(content: str, values: np.ndarray = TRUTH) -> bool:
    """Whether a result had to be found out; it is the right one to the last bit."""
    found = []
    result = storage.cached("test", content, values.shape, lambda: found.append(1) or values)
    assert result.dtype == np.float64
    assert result.tobytes() == values.tobytes()
    return bool(found)


def files(folder: Path) -> list[Path]:
    return sorted(p for p in folder.iterdir() if p.suffix == ".npz")


def test_what_was_found_out_is_not_found_out_again(folder: Path, capsys: pytest.CaptureFixture) -> None:
    assert [asked("ab"), asked("cd"), asked("ab"), asked("cd")] == [True, True, False, False]
    assert len(files(folder)) == len(list(folder.iterdir())) == 2
    assert storage.clear() == 2
    assert asked("ab")
    assert capsys.readouterr().err == storage.last_problem() == ""


def test_without_a_folder_nothing_is_kept(tmp_path: Path) -> None:
    assert storage.current_folder() is None
    assert asked("ab")
    assert asked("ab")
    assert storage.clear() == 0


def spoil(path: Path, how: str, at: float) -> None:
    whole = bytearray(path.read_bytes())
    place = int(at * (len(whole) - 1))
    if how == "cut":
        path.write_bytes(whole[:place])
    elif how == "flipped":
        whole[place] ^= 0xFF
        path.write_bytes(whole)
    elif how == "shape":
        np.savez(path, values=np.zeros((2, 3)), name=np.array(path.name))
    elif how == "type":
        np.savez(path, values=TRUTH.astype(np.float32), name=np.array(path.name))
    elif how == "not finite":
        np.savez(path, values=TRUTH * np.nan, name=np.array(path.name))
    elif how == "of another":
        np.savez(path, values=TRUTH + 1.0, name=np.array("tetflora-test-1-ef.npz"))
    elif how == "objects":
        np.savez(path, values=np.array([{}], object), name=np.array(path.name))
    elif how == "one array":
        with path.open("wb") as file:
            np.save(file, TRUTH)
    else:
        path.write_bytes(how.encode() * 40)


@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow])
@given(
    st.sampled_from(
        ["cut", "flipped", "shape", "type", "not finite", "of another", "objects", "one array", "PK\x03\x04", "junk"]
    ),
    st.floats(0.0, 1.0),
)
def test_damaged_and_foreign_files_count_as_absent(folder: Path, how: str, at: float) -> None:
    asked("ab")
    (path,) = files(folder)
    spoil(path, how, at)
    again = asked("ab")
    assert again or how == "flipped"  # a byte that does not matter
    assert not asked("ab")


def test_what_is_wrong_is_said_once(folder: Path, capsys: pytest.CaptureFixture) -> None:
    for content in ("ab", "cd"):
        asked(content)
    for path in files(folder):
        spoil(path, "junk", 0.0)
    assert asked("ab")
    assert asked("cd")
    said = capsys.readouterr().err
    assert said.count("warning") == 1
    assert str(files(folder)[0]) in said
    assert storage.last_problem() in said


@pytest.mark.parametrize("what", ["file", "folder of that name", "below a file"])
def test_a_place_that_cannot_be_used_stops_nobody(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture, what: str
) -> None:
    if what == "file":
        folder.write_text("mine")
    elif what == "folder of that name":
        (folder / "tetflora-test-1-ab.npz").mkdir(parents=True)
    else:
        (tmp_path / "mine").write_text("mine")
        storage.set_folder(tmp_path / "mine" / "cache")
    assert asked("ab")
    assert asked("ab")
    assert capsys.readouterr().err.count("warning") == 1


def test_a_full_disk_stops_nobody_and_leaves_what_there_was(folder: Path, capsys: pytest.CaptureFixture) -> None:
    asked("ab")
    large = np.arange(100_000.0)
    with full_disk(50_000):
        assert asked("cd", large)
        assert asked("cd", large)
        assert not asked("ab")
    assert [p.name for p in folder.iterdir()] == ["tetflora-test-1-ab.npz"]
    said = capsys.readouterr().err
    assert said.count("warning") == 1
    assert str(folder) in said
    assert asked("cd", large)
    assert not asked("cd", large)


def test_the_folder_stays_small_and_keeps_what_is_used(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked("a0")
    size = files(folder)[0].stat().st_size
    monkeypatch.setattr(storage, "MOST_BYTES", 5 * size)
    foreign = folder / "tetflora-notes.npz"
    foreign.write_bytes(b"mine" * size)
    fresh, old = (folder / f".tetflora-{name}.part" for name in ("aa", "bb"))
    for number, path in enumerate((fresh, old)):
        path.write_bytes(b"begun")
        os.utime(path, (time.time() - 7200 * number,) * 2)
    for number in range(1, 12):
        assert asked(f"a{number:x}")
        ago = time.time_ns() - (100 - number) * 10**9
        os.utime(folder / f"tetflora-test-1-a{number:x}.npz", ns=(ago, ago))
        assert not asked("a0")
    ours = [p for p in files(folder) if p != foreign]
    assert {p.name for p in ours} == {f"tetflora-test-1-a{n}.npz" for n in ("0", "8", "9", "a", "b")}
    assert foreign.read_bytes() == b"mine" * size
    assert fresh.exists()
    assert not old.exists()
    assert storage.clear() == 5
    assert {p.name for p in folder.iterdir()} == {foreign.name, fresh.name}


def test_a_folder_that_cannot_be_emptied_is_named(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked("ab")

    def refused(*_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "unlink", refused)
    with pytest.raises(TetFloraError, match=r"Cannot clear .*cache: Permission denied"):
        storage.clear()


#: Asks for forty results in an order of its own, many times; the folder has room for a few, so that processes delete
#: what the others need. Prints how many it had to find out.
_PROCESS = """
import sys
from pathlib import Path
import numpy as np
from tetflora_addon import storage
folder, seed, rounds, most = sys.argv[1], *map(int, sys.argv[2:])
storage.set_folder(Path(folder))
storage.MOST_BYTES = most
found = 0
def compute(number):
    global found
    found += 1
    return np.full((50, 40), float(number))
print("ready", flush=True)
for number in np.random.default_rng(seed).integers(0, 40, rounds):
    values = storage.cached("test", f"{number:x}", (50, 40), lambda: compute(number))
    assert (values == number).all(), number
print("found", found)
"""


def process(folder: Path, seed: int, rounds: int, most: int) -> subprocess.Popen:
    command = [sys.executable, "-c", _PROCESS, str(folder), str(seed), str(rounds), str(most)]
    return subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def test_two_processes_share_a_folder(tmp_path: Path) -> None:
    both = [process(tmp_path / "cache", seed, 500, 200_000) for seed in (1, 2)]
    for one in both:
        said, complaints = one.communicate(timeout=120)
        assert one.returncode == 0, complaints
        assert complaints == ""
        assert 40 <= int(said.split()[-1]) < 500
    assert sum(p.stat().st_size for p in files(tmp_path / "cache")) <= 200_000
    assert files(tmp_path / "cache") == sorted((tmp_path / "cache").iterdir())


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGKILL")
def test_processes_that_are_killed_leave_no_part_of_a_result(folder: Path) -> None:
    folder.mkdir()
    for seed in range(0, 12, 2):
        victim = process(folder, seed, 10**7, 200_000)
        assert victim.stdout.readline() == "ready\n"
        time.sleep(0.02 + 0.013 * seed)
        victim.send_signal(signal.SIGKILL)
        victim.communicate()
        for path in files(folder):
            with np.load(path) as stored:
                assert (stored["values"] == int(path.stem.rsplit("-", 1)[1], 16)).all()
    heir = process(folder, 99, 200, 200_000)
    said, complaints = heir.communicate(timeout=60)
    assert (heir.returncode, complaints) == (0, ""), said


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGKILL")
def test_a_process_that_is_killed_before_the_last_byte_is_in_place(folder: Path) -> None:
    code = "import os, sys, time\nos.fsync = lambda _: print('writing', flush=True) or time.sleep(60)\n"
    asked("1")
    before = {p: p.read_bytes() for p in files(folder)}
    command = [sys.executable, "-c", code + _PROCESS, str(folder), "1", "50", "1000000"]
    victim = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True)
    assert [victim.stdout.readline() for _ in range(2)] == ["ready\n", "writing\n"]
    victim.send_signal(signal.SIGKILL)
    victim.communicate()
    assert {p: p.read_bytes() for p in files(folder)} == before
    (left,) = set(folder.iterdir()) - set(before)
    os.utime(left, (time.time() - 7200,) * 2)
    assert asked("2")  # whoever writes next tidies up
    assert not left.exists()


def test_a_species_of_ones_own_is_looked_at_once_for_all_sessions(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Shares and clumping of one that is not shipped: the same numbers from the disk, beside whatever other species."""
    monkeypatch.setattr(facet_weights, "shipped", dict)
    monkeypatch.setattr(facet_weights, "_measured", {})
    one, other = load_species("flower"), load_species("grass")
    alone = compile_species([one])
    weights, clumping = facet_weights.facet_weights(alone), alone.clumping
    assert len(files(folder)) == 2
    monkeypatch.setattr(facet_weights, "_measured", {})  # another session
    monkeypatch.setattr(facet_weights, "fitting", lambda _, n, _rays: pytest.fail(f"looked at {n} again"))
    monkeypatch.setattr(facet_weights, "shipped", lambda: {facet_weights.digest(compile_species([other]), 0): TABLE})
    both = compile_species([other, one])
    rows = both.rows["species"] == 1
    np.testing.assert_array_equal(facet_weights.facet_weights(both).whole[:, rows], weights.whole)
    np.testing.assert_array_equal(facet_weights.facet_weights(both).branch_only[:, rows], weights.branch_only)
    for name in ("branch_only", "root", "density"):
        np.testing.assert_array_equal(getattr(both.clumping, name)[rows], getattr(clumping, name))
    assert len(files(folder)) == 3  # the clumping of the other


_ROWS = len(compile_species([load_species("grass")]).rows)
TABLE = np.ones((2, _ROWS, len(facet_weights.COUNTS)), np.float32)


def test_species_that_are_found_together_are_what_they_are_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(facet_weights, "shipped", dict)
    monkeypatch.setattr(facet_weights, "RAYS", 600.0)
    files = {"few": support.small(order2={"leaves": [3, 0]}), "many": support.small(order2={"leaves": [9, 2]})}
    some = [species_from_dict(data, name, f"{name}.json") for name, data in files.items()]
    found = []
    for species in ([some[0]], [some[1]], some, some[::-1]):
        monkeypatch.setattr(facet_weights, "_measured", {})
        flora = compile_species(species)
        weights = facet_weights.facet_weights(flora)
        found.append({one.identifier: weights.whole[:, flora.rows["species"] == n] for n, one in enumerate(species)})
    for name, alone in (found[0] | found[1]).items():
        np.testing.assert_array_equal(found[2][name], alone)
        np.testing.assert_array_equal(found[3][name], alone)
