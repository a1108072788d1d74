# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Attacks in Blender: layers of files, species that a .blend brings, scenes of any numbers, commands, and jobs."""

from __future__ import annotations

import copy
import json
import math
import os
import random
import re
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import bpy

from devtools import session
from farm import write_job
from tests.attack import material
from tests.attack.watch import SECRET, Case, Jail
from tests.blender.scenes import add_camera, add_mesh, add_plant, depsgraph, select
from tests.engine import support
from tetflora_addon.blender import preferences
from tetflora_addon.blender.cli import command
from tetflora_addon.blender.job import refine
from tetflora_addon.blender.placing import population_data
from tetflora_addon.blender.species import catalog, edits
from tetflora_addon.errors import TetFloraError

_NUMBERS = (0.0, 1.0, -1.0, 1e-30, 1e-6, 0.5, 3.0, 1e3, 1e6, 1e20, 1e38, math.nan, math.inf, -math.inf)
_FRAMES = ("1", "1-3", "3-1", "-5", "1-9:2", "", ",", "1,,2", "9" * 5000, "1-1048574", "0-1048574," * 3 + "1", "٣", "a")


def _said(operator: Callable[..., Any], **options: Any) -> None:
    """Press a button; a report is fine, a traceback is not."""
    try:
        if operator.poll():
            operator(**options)
    except RuntimeError as error:
        if "Traceback" in str(error):
            raise AssertionError(str(error)[-600:]) from None


def _fit(text: str) -> str:
    """A text as a property of Blender can hold it."""
    return text.encode(errors="replace").decode().replace("\0", "?")


def populations(rng: random.Random, _jail: Jail) -> None:
    """A layer of a file with other values: it is refused, or can be added."""
    group = bpy.context.scene.tetflora
    group.layers.clear()
    population = group.layers.add()
    population.name = "grove"
    population.mix.add().species = "bush"
    data = json.loads(json.dumps(material.mutated(rng, population_data.population_data(population))))
    try:
        population_data.check_population("layer 1", data)
    except ValueError as error:
        raise TetFloraError(str(error)) from None
    population_data.fill_population(population, data, bpy.context.scene)
    json.dumps(population_data.population_data(population))


def brought(rng: random.Random, jail: Jail) -> None:
    """A species of a .blend under any identifier, shown in the editor, with every button pressed."""
    scene = bpy.context.scene
    folder = jail.inside / "studio"
    folder.mkdir(exist_ok=True)
    preferences.preferences().species_folder = str(folder)
    edits.look_again()
    data = copy.deepcopy(rng.choice((support.SMALL, support.shipped("bush"))))
    edit = scene.tetflora.species_edits.add()
    identifier = rng.choice(["bush", "mine", _fit(material.identifier(rng, jail.outside))])
    text = material.json_text(rng) if rng.random() < 0.2 else json.dumps(material.mutated(rng, data))
    edit.identifier = identifier
    edit.text = _fit(text.decode(errors="replace") if isinstance(text, bytes) else text)
    editor = scene.tetflora.species_editor
    try:
        editor.species = identifier
        for prop in editor.bl_rna.properties:
            getattr(editor, prop.identifier)
        catalog.items_for(identifier)
        edits.problem_of(scene, identifier)
        buttons = bpy.ops.tetflora
        for button in rng.sample(["save_species", "delete_file", "revert_species", "duplicate_species"], 3):
            _said(getattr(buttons, button))
        _said(buttons.edit_orders, action=rng.choice(['ADD', 'REMOVE', 'SPUR']))
        _said(buttons.export_species, filepath=str(jail.inside / f"{rng.randrange(9)}.json"))
        with suppress(TetFloraError):
            catalog.OWN_FILES.delete(identifier)
        edits.species_for(scene, identifier)
    finally:
        scene.tetflora.species_edits.clear()
        for path in folder.iterdir():
            path.unlink()
        preferences.preferences().species_folder = ""
        edits.look_again()


def _scene(rng: random.Random) -> bpy.types.Scene:
    """A few plants and meshes before a camera, most of them as they should be."""
    session.clean_file()
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = rng.choice([(32, 32), (64, 4), (4, 64), (200, 100)])
    scene.render.resolution_percentage = 100
    camera = add_camera(location=(0.0, -12.0, 2.0))
    data = camera.data
    data.type = rng.choice(['PERSP', 'PERSP', 'ORTHO', 'PANO'])
    for _ in range(rng.choice([0, 0, 1, 2])):
        name = rng.choice(["lens", "ortho_scale", "clip_start", "clip_end", "shift_x", "sensor_width", "angle"])
        with suppress(OverflowError, ValueError):
            setattr(data, name, rng.choice(_NUMBERS))
    if rng.random() < 0.1:
        camera.scale = [rng.choice(_NUMBERS) for _ in range(3)]
    if rng.random() < 0.05:
        scene.camera = rng.choice([None, add_mesh("no camera")])
    for n in range(rng.choice([0, 1, 2, 4])):
        plant = add_plant(f"plant {n}", species=rng.choice(["bush", "grass", "fern"]), seed=rng.randrange(9))
        plant.location = [rng.uniform(-4, 4) for _ in range(3)]
        _spoilt(rng, plant)
    for n in range(rng.choice([0, 1, 2])):
        mesh = _mesh(rng, f"mesh {n}")
        mesh.tetflora.is_explicit = rng.random() < 0.7
        mesh.tetflora.is_occluder = rng.random() < 0.3
        _spoilt(rng, mesh)
    if rng.random() < 0.3:
        field = _mesh(rng, "field")
        field.tetflora.is_field = True
        if rng.random() < 0.7:
            field.tetflora.field_species.add().species = rng.choice(["bush", "", "quercus"])
    group = scene.tetflora
    for _ in range(rng.choice([0, 1, 3])):
        known = [p for p in group.bl_rna.properties if p.type in {'INT', 'FLOAT', 'BOOLEAN', 'ENUM'}]
        # Menus that a function fills, such as that of biomes, list nothing here.
        prop = rng.choice([p for p in known if p.type != 'ENUM' or len(p.enum_items)])
        with suppress(TypeError, ValueError, OverflowError, AttributeError):
            if prop.type == 'ENUM':
                setattr(group, prop.identifier, rng.choice(list(prop.enum_items)).identifier)
            else:
                setattr(group, prop.identifier, rng.choice([prop.hard_min, prop.hard_max, rng.choice(_NUMBERS), 1]))
    group.max_tetrahedra = min(group.max_tetrahedra, 20_000)
    return scene


def _spoilt(rng: random.Random, obj: bpy.types.Object) -> None:
    if rng.random() < 0.15:
        obj.location[rng.randrange(3)] = rng.choice(_NUMBERS)
    if rng.random() < 0.15:
        obj.scale[rng.randrange(3)] = rng.choice(_NUMBERS)
    if rng.random() < 0.05:
        obj.tetflora.species = _fit(rng.choice(material.IDENTIFIERS))


def _mesh(rng: random.Random, name: str) -> bpy.types.Object:
    """A mesh of a few faces, or none, or of numbers that are none."""
    mesh = bpy.data.meshes.new(name)
    number = rng.choice([0, 3, 4, 60])
    places = [[rng.uniform(-2, 2) for _ in range(3)] for _ in range(number)]
    faces = [rng.sample(range(number), min(number, rng.choice([3, 4, 20]))) for _ in range(rng.choice([1, 20]))]
    mesh.from_pydata(places, [], [f for f in faces if f])
    if number and rng.random() < 0.15:
        mesh.vertices[0].co[0] = rng.choice(_NUMBERS)
    obj = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(obj)
    return obj


def scenes(rng: random.Random, _jail: Jail) -> None:
    """A scene of any numbers: refined, refined again, and cleared."""
    scene = _scene(rng)
    objects = [o for o in scene.objects if o.type in {'EMPTY', 'MESH'}]
    select(*rng.sample(objects, min(len(objects), 2)))
    buttons = bpy.ops.tetflora
    made = False
    with suppress(TetFloraError):
        refine.refine(scene, depsgraph())
        made = True
    for button in rng.sample(["refine", "clear", "keep_results", "mark", "convert_plants", "reseed", "refine"], 3):
        _said(getattr(buttons, button))
    if not made:
        raise TetFloraError("refused")


def jobs(rng: random.Random, _jail: Jail) -> None:
    """A job in whose middle its data goes away, or that is closed: results are there, or nothing is."""
    scene = _scene(rng)
    before = {o.name for o in bpy.data.objects}
    steps = refine.refine_steps(scene, depsgraph())
    try:
        for _ in range(rng.randrange(12)):
            next(steps)
        way = rng.randrange(4)
        if way == 0:
            steps.close()
            assert {o.name for o in bpy.data.objects} == before
        elif way == 1:
            _said(bpy.ops.tetflora.clear)
        elif way == 2:
            for obj in [o for o in bpy.data.objects if o.tetflora.is_plant]:
                bpy.data.objects.remove(obj)
        for _ in steps:
            pass
    except StopIteration:
        pass
    finally:
        steps.close()


def commands(rng: random.Random, jail: Jail) -> None:
    """``--command tetflora`` with any arguments, for a file that names files of the artist's."""
    session.clean_file()
    scene = bpy.context.scene
    scene.render.resolution_x = scene.render.resolution_y = 16
    add_camera(location=(0.0, -12.0, 2.0))
    add_plant(species=rng.choice(["bush", "grass", "quercus"]))
    folder = jail.inside / f"shot {rng.randrange(10**9)}"
    folder.mkdir()
    (folder / "leaf.png").write_bytes(b"x" * 10)
    os.mkfifo(folder / "pipe.png")
    (folder / "link.png").symlink_to(jail.outside / "secret.png")
    named = ("leaf.png", "pipe.png", "link.png", "../../outside/id_rsa", "../../outside/secret.png", "../../outside")
    for name in rng.sample([*named, "t.<UDIM>.png", "[a].png", "../" * 40 + "etc/passwd"], rng.randint(0, 4)):
        image = bpy.data.images.new("named", 1, 1)
        image.source = rng.choice(['FILE', 'FILE', 'SEQUENCE', 'TILED'])
        image.filepath_raw, image.use_fake_user = f"//{name}", True
    if rng.random() < 0.2:
        modifier = add_mesh("domain").modifiers.new("Fluid", 'FLUID')
        modifier.fluid_type = 'DOMAIN'
        modifier.domain_settings.cache_directory = "//../../outside"
    scene.render.filepath = rng.choice(["//frame_####", "", "//{{Param.X}}", "//a\nb", "//" + "x" * 300])
    with suppress(RuntimeError):
        bpy.ops.wm.save_as_mainfile(filepath=str(folder / "shot.blend"))
    name = re.sub("[/\0\ud800]", "", rng.choice([*material.IDENTIFIERS, "job", "job", "job"])).lstrip(".") or "job"
    job = folder / name
    arguments = rng.choice(
        [
            ["farm", str(job), *rng.choice([[], ["--copy"]]), f"--frames={rng.choice(_FRAMES)}"],
            ["farm", str(job), "--copy", *rng.choice([[], ["--max-size", "1e-7"], ["--chunk", rng.choice(_FRAMES)]])],
            ["stats", "--json"],
            ["refine", "--cutoff", rng.choice(["4", "nan", "-1", "1e999", "x"]), "--save", str(job) + ".blend"],
            ["render", f"--frame={rng.choice(['x', '9' * 5000, '1e3', '-99999999'])}"],
            ["farm"],
            [rng.choice(["", "--help", "fram", "\0"])],
        ]
    )
    code = write_job.main(arguments[1:]) if arguments[0] == "farm" else command.main(arguments)
    assert code in (0, 1, 2)
    for path in job.rglob("*") if os.path.isdir(os.fsencode(job)) and "\0" not in name else ():
        assert not path.is_symlink()
        if path.is_file() and path.stat().st_size == len(SECRET):
            assert path.read_bytes() != SECRET.encode(), f"{path} is the artist's own"
    if code:
        raise TetFloraError("refused")


#: Each kind and its share of all cases.
SHARES: dict[str, tuple[Case, float]] = {
    "populations": (populations, 0.35),
    "brought": (brought, 0.25),
    "commands": (commands, 0.15),
    "scenes": (scenes, 0.15),
    "jobs": (jobs, 0.1),
}


def kinds(number: int) -> dict[str, tuple[Case, int]]:
    """Kinds of cases, and how many of each."""
    return {name: (case, round(share * number)) for name, (case, share) in SHARES.items()}
