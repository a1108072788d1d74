# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A forest as USD: plants come back as they were, and USD's own rules find nothing wrong."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import pytest

from devtools import session
from tests.blender.scenes import add_mesh, add_plant, datablocks, depsgraph, select
from tests.limits import full_disk
from tetflora_addon.blender import compat
from tetflora_addon.blender.attributes import image_pixels, linear_rgb, members, values_of
from tetflora_addon.blender.export import forest, surfaces
from tetflora_addon.blender.export.forest import ExportOrder, export_steps
from tetflora_addon.blender.export.usd import forest_steps
from tetflora_addon.blender.geodata.origin import Import
from tetflora_addon.blender.materials.nodes import Graph, surface_material
from tetflora_addon.blender.scene.fields import write_field
from tetflora_addon.blender.scene.plants import read_plants
from tetflora_addon.blender.worker import run_to_end
from tetflora_addon.errors import TetFloraError

pytestmark = pytest.mark.usefixtures("clean_file", "coarsely_looked_at", "levels_made_once")


@pytest.fixture(scope="module")
def made_levels() -> dict:
    return {}


@pytest.fixture
def levels_made_once(monkeypatch, made_levels):
    """Levels of equal plants and sides of their leaves are the same in all files: most of an export is to find them."""

    def once(module, name, key):
        real = getattr(module, name)

        def found(*given):
            at = name, key(*given)
            if at not in made_levels:
                made_levels[at] = given, real(*given)
            return made_levels[at][1]

        monkeypatch.setattr(module, name, found)

    def of_plant(flora, seed, number=0, like=()):
        columns = flora.rows, seed.seed, seed.frame, np.zeros(0) if seed.crown is None else seed.crown
        return str(flora.species), *(c.tobytes() for c in columns), number, id(like) if like else 0

    once(forest, "levels_of", of_plant)
    once(surfaces, "sides_of", lambda levels: tuple(map(id, levels)))


def scene():
    return bpy.context.scene


def export(path: Path, **settings):
    order = ExportOrder(path, **{"variants": 2, "polygons": 3000, "bake": False} | settings)
    return run_to_end(export_steps(scene(), depsgraph(), order))


def imported(path: Path):
    session.clean_file()
    return run_to_end(forest_steps(Import(scene(), depsgraph(), path), {"bush": 1.0}))


def plants():
    return read_plants(scene(), depsgraph())[0]


def sorted_bytes(seeds) -> list[bytes]:
    """Each plant as bytes, in an order that does not depend on that of objects."""
    species = np.array([seeds.identifiers[s] for s in seeds.species.tolist()], dtype="S64")
    columns = [species, *(getattr(seeds, name) for name in ("seed", "position", "frame", "scale"))]
    columns += [seeds.crown] if seeds.crown is not None else []
    return sorted(b"".join(np.ascontiguousarray(c[i]).tobytes() for c in columns) for i in range(len(seeds)))


def field(number: int = 30, name: str = "Wiesengrund \u68ee", **settings):
    """A field of two species, whose plants lean in all directions."""
    rng = np.random.default_rng(3)
    rotation = rng.normal(size=(number, 4)) * (0.1, 0.1, 0.1, 0.5) + (1.0, 0.0, 0.0, 0.0)
    species, seed = rng.integers(0, 2, number).astype(np.int32), rng.integers(0, 2**31, number).astype(np.int32)
    scale = rng.uniform(0.5, 1.5, number)
    made = write_field(name, rng.uniform(-9, 9, (number, 3)), rotation, scale, species, seed, ("grass", "bush"))
    scene().collection.objects.link(made)
    for key, value in settings.items():
        setattr(made.tetflora, key, value)
    return made


@pytest.fixture
def pxr():
    found = compat.usd()
    if found is None:
        pytest.skip("this Blender has no USD")
    return found


def test_a_field_comes_back_bit_by_bit(blender, tmp_path, pxr):
    made = field(age=7.0, seed=5)
    made.rotation_euler, made.scale, made.location = (0.1, 0.2, 0.3), (1.5, 1.5, 1.5), (1000.25, -3.3, 2.0)
    before = sorted_bytes(plants())
    export(tmp_path / "wald \u68ee.usdc")
    told = imported(tmp_path / "wald \u68ee.usdc")
    assert sorted_bytes(plants()) == before
    assert told.told[0] == "30 plants imported"
    assert told.object.tetflora.age == 7.0


def test_recorded_sizes_come_back_bit_by_bit(blender, tmp_path, pxr):
    made = field()
    heights = made.data.attributes.new("tf_height", 'FLOAT', 'POINT')
    heights.data.foreach_set("value", np.linspace(1.0, 4.0, len(heights.data), dtype=np.float32))
    before = sorted_bytes(plants())
    export(tmp_path / "sizes.usda")
    imported(tmp_path / "sizes.usda")
    assert sorted_bytes(plants()) == before


def test_single_plants_and_instances_keep_their_seeds(blender, tmp_path, pxr):
    source = bpy.data.collections.new("source")
    add_plant("one", "bush", 11, (1.0, 2.0, 3.0), source)
    for x in (0.0, 6.0):
        empty = bpy.data.objects.new("copy", None)
        empty.instance_type, empty.instance_collection, empty.location.x = 'COLLECTION', source, x
        scene().collection.objects.link(empty)
    add_plant("two", "grass", 12, (9.0, 0.0, 0.0), scale=(2.0, 2.0, 2.0))
    before = plants()
    export(tmp_path / "single.usdc")
    imported(tmp_path / "single.usdc")
    after = plants()
    assert sorted(after.seed.tolist()) == sorted(before.seed.tolist())
    assert max(abs(seed) for seed in after.seed.tolist()) > 2**32  # those of instances have 64 bits
    a, b = np.argsort(before.seed), np.argsort(after.seed)
    for name in ("position", "frame", "scale"):
        np.testing.assert_allclose(getattr(after, name)[b], getattr(before, name)[a], atol=1e-6)


def test_usd_finds_no_fault_and_counts_the_plants(blender, tmp_path, pxr):
    field()
    out = export(tmp_path / "checked.usdc")
    checker = pxr.UsdUtils.ComplianceChecker()
    checker.CheckCompliance(str(tmp_path / "checked.usdc"))
    assert (checker.GetErrors(), checker.GetFailedChecks(), checker.GetWarnings()) == ([], [], [])
    stage = pxr.Usd.Stage.Open(str(tmp_path / "checked.usdc"))
    instancers = [pxr.UsdGeom.PointInstancer(p) for p in stage.Traverse() if p.IsA(pxr.UsdGeom.PointInstancer)]
    assert sum(one.GetInstanceCount() for one in instancers) == out.plants == 30
    (one,) = instancers
    assert one.ComputeInstanceTransformsAtTime(0.0, 0.0) is not None
    heights = np.array(pxr.UsdGeom.PrimvarsAPI(one).GetPrimvar("height").Get())
    assert ((heights > 0.1) & (heights < 5.0)).all()
    targets = one.GetPrototypesRel().GetTargets()
    assert len(targets) == out.variants
    for target in targets:
        prim = stage.GetPrimAtPath(target)
        levels = prim.GetVariantSet("LOD")
        polygons = []
        for name in levels.GetVariantNames():
            levels.SetVariantSelection(name)
            (mesh,) = prim.GetChildren()  # Unreal reads levels that are one mesh each
            assert mesh.GetName() == f"{prim.GetName()}_{name}"
            polygons.append(len(pxr.UsdGeom.Mesh(mesh).GetFaceVertexCountsAttr().Get()))
            subsets = [pxr.UsdGeom.Subset(p).GetIndicesAttr().Get() for p in mesh.GetChildren()]
            np.testing.assert_array_equal(np.concatenate(subsets), np.arange(polygons[-1]))
        assert polygons == sorted(polygons, reverse=True)
        assert 0 < polygons[-1] < polygons[0] <= 3000


@pytest.mark.parametrize("moving", [False, True])
def test_points_of_another_program_become_plants(blender, tmp_path, pxr, moving):
    stage = pxr.Usd.Stage.CreateNew(str(tmp_path / "cloud.usda"))
    pxr.UsdGeom.SetStageUpAxis(stage, pxr.UsdGeom.Tokens.y)
    pxr.UsdGeom.SetStageMetersPerUnit(stage, 0.01)
    cloud = pxr.UsdGeom.Points.Define(stage, "/cloud")
    points = [(100.0, 200.0, -300.0), (0.0, 0.0, 0.0)]
    for time in (7.0, 8.0) if moving else (pxr.Usd.TimeCode.Default(),):  # of several moments the first counts
        cloud.CreatePointsAttr().Set(points, time)
        points = [(1.0, 1.0, 1.0)]
    stage.GetRootLayer().Save()
    imported(tmp_path / "cloud.usda")
    found = plants()
    assert found.identifiers == ("bush",)
    np.testing.assert_allclose(found.position[np.argsort(found.position[:, 0])], [[0, 0, 0], [1, 3, 2]], atol=1e-6)


def test_a_file_that_is_none_is_named(blender, tmp_path, pxr):
    (tmp_path / "none.usda").write_text("no USD")
    before = datablocks()
    with pytest.raises(TetFloraError, match=r"none\.usda: cannot be read"):
        imported(tmp_path / "none.usda")
    assert datablocks() == before


def test_a_plant_without_a_species_is_named(blender, tmp_path):
    add_plant("lonely", "no_such_species")
    with pytest.raises(TetFloraError, match='"lonely": unknown species'):
        export(tmp_path / "f.glb")
    assert list(tmp_path.iterdir()) == []


def test_a_blender_without_usd_says_so_before_anything_is_made(blender, tmp_path, monkeypatch):
    field()
    monkeypatch.setattr("tetflora_addon.blender.export.usd.usd", lambda: None)
    with pytest.raises(TetFloraError, match="built without USD; choose glTF or OBJ"):
        next(export_steps(scene(), depsgraph(), ExportOrder(tmp_path / "f.usdc")))


@pytest.mark.parametrize("suffix", ["usdc", "usda", "glb", "obj"])
def test_a_full_disk_leaves_no_half_file(blender, tmp_path, suffix, pxr):
    field()
    path = tmp_path / f"f.{suffix}"
    path.write_text("an earlier one")
    with full_disk(20_000), pytest.raises(TetFloraError, match="Cannot write"):
        export(path)
    assert [p.name for p in tmp_path.iterdir()] == [path.name]
    assert path.read_text() == "an earlier one"


def test_variants_beyond_max_memory_are_refused(blender, tmp_path, monkeypatch):
    """All plants may be different, up to what fits; levels with too many polygons do not count."""
    field()
    monkeypatch.setattr("tetflora_addon.blender.export.forest.memory_left", lambda _scene: 2e6)
    with pytest.raises(TetFloraError, match=r"Variants of \w+ would make more than .* lower Variants or Max Polygons"):
        export(tmp_path / "f.obj", variants=30)
    assert list(tmp_path.iterdir()) == []
    assert export(tmp_path / "f.obj", variants=2, polygons=300).variants == 4


@pytest.mark.parametrize(
    ("ending", "until", "bake"),
    [
        *((".usdc", until, bake) for until, bake in (("variants", False), ("texture", True), ("plants of", False))),
        *((ending, until, True) for ending in (".usdc", ".glb", ".obj") for until in ("writing", "")),
        (".glb", "", False),
    ],
)
def test_closing_the_steps_leaves_no_half_file_and_nothing_in_the_scene(blender, tmp_path, ending, until, bake):
    """Nor does an export that ends. What it does before it writes is the same for all formats."""
    if ending == ".usdc" and compat.usd() is None:
        pytest.skip("this Blender has no USD")
    field()
    before = datablocks(), [s.name for s in bpy.data.scenes], scene().render.use_lock_interface
    steps = export_steps(scene(), depsgraph(), ExportOrder(tmp_path / f"f{ending}", 1, polygons=3000, bake=bake))
    for step in steps:
        if until and until in step.message:
            break
    steps.close()
    assert list(tmp_path.iterdir()) == [] or not until
    assert (datablocks(), [s.name for s in bpy.data.scenes], scene().render.use_lock_interface) == before


def test_a_folder_that_is_not_there_is_named(blender, tmp_path):
    field()
    with pytest.raises(TetFloraError, match=r"gone does not exist; create it"):
        export(tmp_path / "gone" / "f.usdc")


def unevenly_rough(graph: Graph, _material: bpy.types.Material) -> None:
    checker = graph.outputs("ShaderNodeTexChecker", {"Scale": 8.0})["Fac"]
    shader = graph.node("ShaderNodeBsdfPrincipled", {"Roughness": checker})
    graph.node("ShaderNodeOutputMaterial", {"Surface": shader})


@pytest.mark.fine
def test_blender_reads_the_plant_with_its_textures(blender, tmp_path, pxr):
    """Its own importer finds the same surface, and images whose mean is the color of the leaves."""
    add_plant("one", "bush", 3)
    entry = scene().tetflora.output.species.add()
    entry.species, entry.bark = "bush", surface_material("own bark", 1, unevenly_rough)
    run_to_end(export_steps(scene(), depsgraph(), ExportOrder(tmp_path / "f.usdc", 1, 1, bake=True)))
    assert bpy.data.scenes.keys() == [scene().name]
    assert not [image for image in bpy.data.images if image.type == 'UV_TEST' or "bake" in image.name]
    session.clean_file()
    assert bpy.ops.wm.usd_import(filepath=str(tmp_path / "f.usdc")) == {'FINISHED'}
    mesh = next(o.data for o in bpy.data.objects if o.name == "bush_1_LOD0")
    names = ("bush_leaf", "bush_bark")
    leaf = members(mesh.polygons, "material_index", dtype=np.int32) == mesh.materials.find(names[0])
    assert leaf.sum() > 1000
    # EEVEE blends what a texture could cut, in any order; and leaves without normals would be smoothed.
    assert {material.surface_render_method for material in mesh.materials} == {'DITHERED'}
    size, corners = members(mesh.polygons, "loop_total", dtype=np.int32), members(mesh.corner_normals, "vector", 3)
    flat = np.repeat(members(mesh.polygon_normals, "vector", 3), size, axis=0)
    bent = np.linalg.norm(corners - flat, axis=1) > 0.01
    assert not bent[np.repeat(leaf, size)].any()
    assert bent[np.repeat(~leaf, size)].mean() > 0.5
    mirrors = [mesh.materials[name].node_tree.nodes["Principled BSDF"].inputs["IOR"].default_value for name in names]
    assert mirrors == pytest.approx([1.445, 1.0], abs=0.02)  # leaves are glossy, less than what is smooth; bark is not
    images = {Path(image.filepath).name: image for image in bpy.data.images if image.size[0]}
    kinds = ("leaf_color", "leaf_normal", "bark_color", "bark_roughness")  # the own bark has no relief
    assert set(images) == {f"bush_{kind}.png" for kind in kinds}
    assert image_pixels(images["bush_bark_roughness.png"])[..., 0].std() > 0.1
    pixels = linear_rgb(images["bush_leaf_color.png"], image_pixels(images["bush_leaf_color.png"]))
    outline = bpy.data.images.load(str(tmp_path / "f_textures" / "bush_leaf_opacity.png"))
    shown = image_pixels(outline)[..., 0] > 0.5
    color = values_of(mesh.attributes["displayColor"])[np.repeat(leaf, size)].mean(axis=0)[:3]
    np.testing.assert_allclose(pixels[shown].mean(axis=0), color, rtol=0.15)
    assert pixels[shown].std(axis=0).max() > 0.005  # veins and shades


def test_the_operators_write_and_read(blender, tmp_path, pxr):
    field()
    before = sorted_bytes(plants())
    given = {"variants": 1, "polygons": 3000, "bake": False}
    path = tmp_path / "forest"
    assert bpy.ops.tetflora.export_forest(filepath=str(path), format=".usdc", **given) == {'FINISHED'}
    assert bpy.ops.tetflora.export_forest(filepath=str(path), format=".glb", **given) == {'FINISHED'}
    assert sorted(p.name for p in tmp_path.iterdir()) == ["forest.glb", "forest.usdc", "forest_textures"]
    with pytest.raises(RuntimeError, match=r"choose a name that ends in \.usdc"):
        bpy.ops.tetflora.export_forest(filepath=str(tmp_path / "forest.fbx"), **given)
    session.clean_file()
    assert bpy.ops.tetflora.import_inventory(filepath=str(tmp_path / "forest.usdc")) == {'FINISHED'}
    assert sorted_bytes(plants()) == before
    assert [layer.field.name for layer in scene().tetflora.layers] == ["Wiesengrund \u68ee"]


def test_trees_of_a_stand_come_back_in_the_year_that_was_shown(blender, tmp_path, pxr):
    """Of a history only one year goes into the file: as plants with their sizes, for the rest of it is no plant's."""
    ground = add_mesh("ground", size=9.0)
    select(ground)
    group = scene().tetflora.stand
    group.years, group.interval, group.density = 12, 4, 2500.0
    for name in ("birch", "spruce"):
        group.species.add().species = name
    assert bpy.ops.tetflora.grow_stand() == {'FINISHED'}
    bpy.context.active_object.tetflora.stand_year = 8.0
    before = plants()
    export(tmp_path / "stand.usdc")
    imported(tmp_path / "stand.usdc")
    after = plants()
    assert len(after) == len(before) > 10

    def ordered(seeds):
        kind = np.array([seeds.identifiers[n] for n in seeds.species])
        order = np.lexsort(seeds.position.round(4).T)
        return kind[order].tolist(), seeds.take(order)

    (kinds, one), (others, other) = ordered(before), ordered(after)
    assert kinds == others
    for name, close in (("position", 1e-4), ("scale", 1e-3), ("frame", 1e-5)):
        np.testing.assert_allclose(getattr(other, name), getattr(one, name), atol=close)
    np.testing.assert_array_equal(other.seed, one.seed)
    assert (one.crown is None) == (other.crown is None)
    if one.crown is not None:
        np.testing.assert_allclose(other.crown, one.crown, atol=2e-3)
