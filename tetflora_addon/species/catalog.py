# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Species files: every key with its type and range, every mistake named; and the catalog: shipped ones and users'.

`docs/species.md` is written from the fields of `Order` and of the leaves.
"""

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

from .. import formats
from ..errors import NAME, SpeciesError, quoted, readable
from ..files import IDENTIFIER_RULE, beside, is_identifier, is_regular, parse_json, read_whole
from ..leaves.schema import read_forms
from ..parameters import FileReader, Rgb, keys_of
from .members import expected_polygons
from .skeletons import MAX_ORDERS
from .species import DAYS, LEAF_KINDS, MAX_AUTUMN, Ages, Bud, Dead, Ecology, LeafYear, Order, Species, Year

MAX_FILE_BYTES = 4_000_000
MAX_POLYGONS = 20_000_000
LENGTH_HIGH = 20.0
"""Highest length of a branch after order 0, of its parent's length."""
ORDER_KEYS = keys_of(Order)
SPECIES_KEYS = (
    "format", "name", "description", "orders", "bark", "quality", "habit", "stand_leaves", "exact", "leaf",
    "leaf_transmission", "blossom", "blossom_transmission", "spur", "bud", "dead", "year", "age",
    "ecology",
)  # fmt: skip
_DEFAULTS = beside(__file__, "defaults.json")
#: The short shoot of a species that asks for some and describes none.
DEFAULT_SPUR: dict[str, Any] = _DEFAULTS["spur"]


def _read_order(reader: FileReader, data: Any, where: str, first: bool, last: bool) -> Order:
    order = reader.read(Order, data, where)
    if not first:
        reader.range(list(order.length), f"{where}.length", ORDER_KEYS["length"].low, LENGTH_HIGH)
    if last and order.branches.high > 0:
        raise reader.fail(
            f"{where}.branches", "must be [0, 0], because no order follows; add an order to describe these branches"
        )
    if order.leaf_envelope != "none" and order.forks.high > 0:
        raise reader.fail(f"{where}.leaf_envelope", 'must be "none", because the branch forks; or set forks to [0, 0]')
    return order


def _read_dead(reader: FileReader, data: Any, name: str) -> Dead:
    """The key ``dead`` of a species; one that only says how many has them broken off or bare, with bare twigs."""

    def read_orders(value: Any, name: str) -> tuple[Order, ...]:
        if not isinstance(value, list) or not 1 <= len(value) <= 2:
            raise reader.fail(name, "must be a list of 1 or 2 orders: dead branches, and twigs on them")
        last = len(value) - 1
        return tuple(_read_order(reader, one, f"{name}[{i}]", False, i == last) for i, one in enumerate(value))

    whole = {"orders": _DEFAULTS["dead"], **data} if isinstance(data, dict) else data
    dead = reader.read(Dead, whole, name, {"orders": read_orders})
    for i, order in enumerate(dead.orders):
        for key in ("leaves", "spurs", "forks", "flare", "pipe"):
            value = getattr(order, key)
            if (value if isinstance(value, float) else value.high) > 0:
                raise reader.fail(f"{name}.orders[{i}].{key}", "must be 0: dead branches are bare and do not grow")
    return dead


def _read_leaf_year(reader: FileReader, data: Any, name: str) -> LeafYear:
    def colors(value: Any, name: str) -> tuple[Rgb, ...]:
        if not isinstance(value, list) or len(value) > MAX_AUTUMN:
            raise reader.fail(name, f"must be a list of up to {MAX_AUTUMN} colors [r, g, b]")
        return tuple(reader.rgb(one, f"{name}[{i}]") for i, one in enumerate(value))

    year = reader.read(LeafYear, data, name, {"autumn": colors})
    reader.number(year.turn, f"{name}.turn", year.appear, year.appear + DAYS)
    reader.number(year.fall, f"{name}.fall", year.turn, year.appear + DAYS)
    return year


def species_from_dict(data: Any, identifier: str, source: str) -> Species:
    """Check a decoded species file and turn it into a `Species`.

    Parameters
    ----------
    data : object
        What `json.load` gave.
    identifier : str
        Name by which plants refer to the species.
    source : str
        Named in errors, usually the file's path.

    Raises
    ------
    SpeciesError
        Names the source, the key and what is allowed.
    """
    reader = FileReader(source)
    if not isinstance(data, dict):
        raise reader.fail("species", f"must be an object {{…}}, not {quoted(data)}")
    if "format" in data:
        try:
            data = formats.newest("species", data, data["format"])
        except ValueError as error:
            raise reader.fail("format", str(error)) from None
    reader.keys(data, "", SPECIES_KEYS)
    for key in ("format", "name", "orders", "leaf"):
        if key not in data:
            raise reader.fail(key, "missing; add this key")
    orders = data["orders"]
    if not isinstance(orders, list) or not 1 <= len(orders) <= MAX_ORDERS:
        content = len(orders) if isinstance(orders, list) else quoted(orders)
        raise reader.fail("orders", f"must be a list of 1 to {MAX_ORDERS} orders, has {content}")
    read = tuple(_read_order(reader, o, f"orders[{i}]", i == 0, i == len(orders) - 1) for i, o in enumerate(orders))
    spur = None
    if "spur" in data or any(order.spurs.high > 0 for order in read):
        spur = _read_order(reader, data.get("spur", DEFAULT_SPUR), "spur", True, True)
        for key in ("spurs", "forks"):
            if getattr(spur, key).high > 0:
                raise reader.fail(f"spur.{key}", "must be [0, 0], because a short shoot has only leaves")
    parts: dict[str, Callable[[Any, str], Any]] = {
        "bud": partial(reader.read, Bud),
        "dead": partial(_read_dead, reader),
        "year": partial(reader.read, Year, readers=dict.fromkeys(LEAF_KINDS, partial(_read_leaf_year, reader))),
        "age": partial(reader.read, Ages),
        "ecology": partial(reader.read, Ecology),
    }
    others = {name: part(data[name], name) for name, part in parts.items() if data.get(name) is not None}
    values = reader.values(Species, data, "")
    others |= {name: read_forms(reader, data[name], name) for name in LEAF_KINDS if name in data}
    species = Species(identifier=identifier, orders=read, spur=spur, ages=others.pop("age", None), **values, **others)
    polygons = expected_polygons(species) * species.quality
    if polygons > MAX_POLYGONS:
        raise reader.fail(
            "orders" if species.quality <= 1 else "quality",
            f"one plant would have {polygons:.3g} polygons, the limit is {MAX_POLYGONS:.0g}; use fewer branches",
        )
    return species


def species_from_json(content: bytes | str, identifier: str, source: str) -> Species:
    """Check the text of a species file, as `species_from_dict` checks what it decodes to.

    Raises
    ------
    SpeciesError
        It is not JSON, or breaks a rule of the format.
    """
    try:
        data = parse_json(content)
    except ValueError as error:
        raise SpeciesError(f"{source}: {error}") from None
    return species_from_dict(data, identifier, source)


def read_species(path: Path) -> Species:
    """Read and check one species file.

    Raises
    ------
    SpeciesError
        The file cannot be read, is not JSON, or breaks a rule of the format.
    """
    return species_from_json(species_file(path), path.stem, path.name)


def species_file(path: Path) -> bytes:
    """The content of a species file.

    Raises
    ------
    SpeciesError
        It cannot be read.
    """
    try:
        return read_whole(path, MAX_FILE_BYTES)
    except OSError as error:
        raise SpeciesError(f"{path.name}: cannot be read: {error.strerror}") from None


#: What lists begin with, and new plants are where nothing is chosen: a tree of which anybody expects a forest.
FIRST = "beech"


_SHIPPED = Path(__file__).resolve().parent.parent  # shipped files lie in folders of this one


@dataclass(frozen=True)
class FileInfo:
    """What a menu shows of a species or a biome, without reading it in full."""

    identifier: str
    name: str
    description: str
    path: Path

    @property
    def is_own(self) -> bool:
        """Whether the file is the user's."""
        return self.path.parent.parent != _SHIPPED


def builtin_folder() -> Path:
    """Folder of the species files that are shipped."""
    return _SHIPPED / "catalog"


def info_of(identifier: str, data: Mapping[str, object], path: Path) -> FileInfo:
    """What a menu shows of a decoded file, sound or not."""
    name, description = readable(str(data.get("name", "")), NAME).strip(), readable(str(data.get("description", "")))
    return FileInfo(identifier, name or identifier, description, path)


def _info(path: Path, remedy: str) -> FileInfo:
    try:
        return info_of(path.stem, parse_json(species_file(path)), path)
    except (SpeciesError, ValueError, AttributeError):
        return info_of(path.stem, {"description": f"This file cannot be read; {remedy} to see why"}, path)


@lru_cache(maxsize=256)
def _species(path: Path, _stamp: tuple[int, int]) -> Species:
    return read_species(path)


def stamp(path: Path) -> tuple[int, int]:
    """When a file was written and its size: a change of it shows here."""
    try:
        status = os.lstat(path)
    except OSError:  # somebody has just deleted it
        return 0, 0
    return status.st_mtime_ns, status.st_size


def checked_identifier(text: str) -> str:
    """An identifier of a species, which may have come from any file.

    Raises
    ------
    SpeciesError
        It could name no file of a species.
    """
    if not is_identifier(text):
        raise SpeciesError(f"{quoted(text)} cannot name a species. Use only {IDENTIFIER_RULE}")
    return text


def _files(folder: Path) -> Iterator[tuple[Path, str]]:
    """Species files of a folder by name, and why each is no species; an empty text for those that may be one."""
    try:
        paths = sorted(folder.glob("*.json"))
    except (OSError, ValueError):
        paths = []
    for path in paths:
        if not is_identifier(path.stem):
            yield path, f"skipped; rename the file. Use only {IDENTIFIER_RULE}"
        else:
            yield path, "" if is_regular(path) else "skipped; it is a link or a folder. Put the file itself there"


def odd_files(folders: Sequence[Path]) -> list[str]:
    """Files of the user's own folders that `list_species` skips, each with the reason and what to do."""
    return [readable(f'"{path.name}": {reason}') for folder in folders for path, reason in _files(folder) if reason]


def in_order(infos: Mapping[str, FileInfo]) -> dict[str, FileInfo]:
    """Species in the order in which they are offered: `FIRST`, then the others by name."""
    return dict(sorted(infos.items(), key=lambda item: (item[0] != FIRST, item[1].name.lower())))


def list_species(folders: Sequence[Path] = ()) -> dict[str, FileInfo]:
    """All species by identifier, as `in_order` sorts them.

    Parameters
    ----------
    folders : sequence of Path
        Folders of the user's own; a file there replaces a shipped one of the same name, and one of a later folder.
        Missing folders are passed over, and so are files that `odd_files` names.
    """
    return in_order(files_in((builtin_folder(), *reversed(folders)), "choose the species"))


def files_in(folders: Iterable[Path], remedy: str) -> dict[str, FileInfo]:
    """Files of folders by identifier, those of later ones instead of others; ``remedy`` tells why one is broken."""
    infos: dict[str, FileInfo] = {}
    for folder in folders:
        infos |= _listed(folder, _entries(folder), remedy)
    return infos


def _entries(folder: Path) -> tuple[tuple[str, int, int, int], ...]:
    """What a folder holds: names, times, sizes and kinds of its files. A change of any shows here."""
    try:
        with os.scandir(folder) as entries:
            stats = [(entry.name, entry.stat(follow_symlinks=False)) for entry in entries]
    except (OSError, ValueError):
        return ()
    return tuple(sorted((name, stat.st_mtime_ns, stat.st_size, stat.st_mode) for name, stat in stats))


@lru_cache(maxsize=64)
def _listed(folder: Path, _entries: tuple[tuple[str, int, int, int], ...], remedy: str) -> dict[str, FileInfo]:
    return {path.stem: _info(path, remedy) for path, reason in _files(folder) if not reason}


def load_species(identifier: str, folders: Sequence[Path] = (), known: Mapping[str, FileInfo] | None = None) -> Species:
    """Read a species; unchanged files are read once.

    Parameters
    ----------
    folders : sequence of Path
        As of `list_species`.
    known : mapping, optional
        What `list_species` returned a moment ago.

    Raises
    ------
    SpeciesError
        Unknown identifier (the message lists the known ones), or a broken file.
    """
    known = list_species(folders) if known is None else known
    if identifier not in known:
        raise SpeciesError(f'Unknown species "{readable(identifier, NAME)}"; available: {", ".join(known) or "none"}')
    path = known[identifier].path
    return _species(path, stamp(path))
