# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Forests as USD: a PointInstancer for each object with plants, whose prototypes have levels as a variant set.

Primvars tell of each plant what it is: ``species``, an index into the names in the instancer's custom data, ``seed``,
``age`` and ``height``. What a field needs beyond that, to be the same again bit by bit, is in primvars named
``tetflora:``. Everything that USD has a place for is there, so that no reader needs to know of TetFlora. Forests of any
other USD are read as places of plants.

Sources: UsdGeomPointInstancer and UsdPreviewSurface as openusd.org documents them.
"""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import SimpleNamespace

import bpy
import numpy as np
from mathutils import Matrix
from numpy.typing import NDArray

from ...arrays import Integers
from ...buffers import concatenate_buffers
from ...errors import SceneError, TetFloraError, listed
from ...export.forest import BakedSurface, Forest, ForestPart, PointAttributes, Variant, identifiers
from ...export.gltf import corner_normals
from ...export.levels import PlantLevel
from ...growth.hashing import child_key, key_of_seed, uniform
from ...jobs import Progress
from ...planting.rules import species_by_weight
from ..compat import usd
from ..geodata.origin import Import, Imported, Steps, importing
from ..placing.plant_objects import link_field, write_points

#: In the custom data of an instancer, and the prefix of primvars.
KEY, PREFIX = "tetflora", "tetflora:"
FORMAT = 1
#: Endings of files.
ENDINGS = (".usdc", ".usda", ".usd")
LEVELS, _MATERIALS = "LOD", "/Forest/Materials"
_TONES = 256.0  # steps of a color, which no display tells apart
_ARRAYS = {'FLOAT': "Float", 'INT': "Int", 'INT32_2D': "Vec2i", 'FLOAT_VECTOR': "Vec3f", 'QUATERNION': "Quatf"}
_NAMES = {'FLOAT': "Float", 'INT': "Int", 'INT32_2D': "Int2", 'FLOAT_VECTOR': "Float3", 'QUATERNION': "Quatf"}


def library() -> SimpleNamespace:
    """USD's modules.

    Raises
    ------
    TetFloraError
        This Blender has none.
    """
    if (modules := usd()) is None:
        raise TetFloraError("This Blender was built without USD; choose glTF or OBJ, or use another build")
    return modules


def write_usd(path: Path, forest: Forest) -> Iterator[float]:
    """Write a file; yields how much of it is done.

    Raises
    ------
    TetFloraError
        It cannot be written.
    """
    pxr = library()
    try:
        stage = pxr.Usd.Stage.CreateNew(str(path))
        pxr.UsdGeom.SetStageUpAxis(stage, pxr.UsdGeom.Tokens.z)
        pxr.UsdGeom.SetStageMetersPerUnit(stage, 1.0)
        root = pxr.UsdGeom.Xform.Define(stage, "/Forest")
        pxr.Usd.ModelAPI(root).SetKind(pxr.Kind.Tokens.assembly)
        stage.SetDefaultPrim(root.GetPrim())
        for surface in forest.surfaces:
            _write_surface(pxr, stage, surface)
        # Children of an instancer are drawn as its instances alone, and instancers may share them.
        names = identifiers([part.name for part in forest.parts])
        home = f"/Forest/{names[0]}/Prototypes"
        for name, part in zip(names, forest.parts, strict=True):
            _write_part(pxr, stage, f"/Forest/{name}", part, [f"{home}/{v.name}" for v in forest.variants])
        pxr.UsdGeom.Scope.Define(stage, home)
        for number, variant in enumerate(forest.variants):
            yield number / len(forest.variants)
            _write_variant(pxr, stage, f"{home}/{variant.name}", variant)
        if not stage.GetRootLayer().Save():
            raise OSError("check the free disk space")
    except (OSError, RuntimeError) as error:
        raise TetFloraError(f"Cannot write {path.name}: {' '.join(str(error).split())}") from None


def _array(pxr: SimpleNamespace, kind: str, values: NDArray) -> object:
    """An array of USD, ``Vec3f`` for example; quaternions have w last there."""
    given = np.roll(values, -1, axis=1) if kind.startswith("Quat") else values
    return getattr(pxr.Vt, f"{kind}Array").FromNumpy(np.ascontiguousarray(given))


def _write_part(pxr: SimpleNamespace, stage: object, path: str, part: ForestPart, prototypes: list[str]) -> None:
    instancer = pxr.UsdGeom.PointInstancer.Define(stage, path)
    instancer.AddTranslateOp().Set(pxr.Gf.Vec3d(*part.origin.tolist()))
    # Those that the part has none of would only cost time.
    used, index = np.unique(part.variant, return_inverse=True)
    for number in used.tolist():
        instancer.GetPrototypesRel().AddTarget(prototypes[number])
    instancer.CreateProtoIndicesAttr(_array(pxr, "Int", index.reshape(-1).astype(np.int32)))
    instancer.CreatePositionsAttr(_array(pxr, "Vec3f", part.position))
    instancer.CreateOrientationsAttr(_array(pxr, "Quath", part.rotation.astype(np.float16)))
    instancer.CreateScalesAttr(_array(pxr, "Vec3f", np.repeat(part.scale[:, None], 3, axis=1)))
    primvars = pxr.UsdGeom.PrimvarsAPI(instancer)
    columns = {"species": ('INT', part.species), "seed": stored_seeds(part.seed)}
    columns |= {"age": ('FLOAT', part.age), "height": ('FLOAT', part.height)}
    for name, (kind, values) in columns.items():
        _add(pxr, primvars, name, kind, values)
    known = {"position": ('FLOAT_VECTOR', part.position), **{name: columns[name] for name in ("seed", "species")}}
    stored: dict[str, str] = {}
    for name, (kind, values) in part.points.items():
        known_kind, one = known.get(name, ("", values))
        same = (known_kind, one.shape) == (kind, values.shape) and one.tobytes() == values.astype(one.dtype).tobytes()
        stored[name] = kind if same else f"{kind} {PREFIX}{name}"
        if not same:
            _add(pxr, primvars, PREFIX + name, kind, values)
    species, forms = (pxr.Vt.StringArray([kind[i] for kind in part.kinds]) for i in (0, 1))
    told = {"format": FORMAT, "name": part.name, "species": species, "forms": forms, "attributes": stored}
    told["matrix"] = pxr.Gf.Matrix4d(np.asarray(part.matrix, np.float64).T.tolist())
    lists = {key: pxr.Vt.DoubleArray(value) for key, value in part.settings.items() if isinstance(value, list)}
    instancer.GetPrim().SetCustomDataByKey(KEY, {**told, "object": part.settings | lists})


def stored_seeds(seed: Integers) -> tuple[str, NDArray[np.int32]]:
    """Type of an attribute and values of seeds (n,): of more than 32 bits as two numbers each, (n, 2)."""
    small = seed.astype(np.int32)
    if np.array_equal(seed, small):
        return 'INT', small
    return 'INT32_2D', np.ascontiguousarray(seed, np.int64).view(np.int32).reshape(-1, 2)


def _add(pxr: SimpleNamespace, primvars: object, name: str, kind: str, values: NDArray) -> None:
    of = getattr(pxr.Sdf.ValueTypeNames, f"{_NAMES[kind]}Array")
    primvars.CreatePrimvar(name, of, pxr.UsdGeom.Tokens.vertex).Set(_array(pxr, _ARRAYS[kind], values))


def _write_variant(pxr: SimpleNamespace, stage: object, path: str, variant: Variant) -> None:
    top = pxr.UsdGeom.Xform.Define(stage, path)
    pxr.Usd.ModelAPI(top).SetKind(pxr.Kind.Tokens.component)
    prim, levels = top.GetPrim(), top.GetPrim().GetVariantSets().AddVariantSet(LEVELS)
    for number, level in enumerate(variant.levels):
        levels.AddVariant(f"{LEVELS}{number}")
        levels.SetVariantSelection(f"{LEVELS}{number}")
        with levels.GetVariantEditContext():
            _write_level(pxr, stage, f"{path}/{variant.name}_{LEVELS}{number}", level, variant)
    levels.SetVariantSelection(f"{LEVELS}0")
    ends = [level.distance for level in variant.levels[1:]]
    sizes = [level.screen_size(variant.height) for level in variant.levels]
    told = {"distances": pxr.Vt.DoubleArray([0.0, *ends]), "screenSizes": pxr.Vt.DoubleArray(sizes)}
    prim.SetCustomDataByKey(KEY, {**told, "height": variant.height})


def _write_level(pxr: SimpleNamespace, stage: object, path: str, level: PlantLevel, variant: Variant) -> None:
    """One mesh, of which kinds of parts are subsets: Unreal knows levels that are one each."""
    meshes = [mesh for _, mesh in level.parts]
    mesh = concatenate_buffers(meshes)
    prim = pxr.UsdGeom.Mesh.Define(stage, path)
    prim.CreateSubdivisionSchemeAttr(pxr.UsdGeom.Tokens.none)
    prim.CreatePointsAttr(_array(pxr, "Vec3f", mesh.positions))
    prim.CreateFaceVertexCountsAttr(_array(pxr, "Int", np.diff(mesh.face_offsets).astype(np.int32)))
    prim.CreateFaceVertexIndicesAttr(_array(pxr, "Int", mesh.corner_verts))
    prim.CreateDoubleSidedAttr(True)
    prim.CreateExtentAttr(_array(pxr, "Vec3f", np.stack([mesh.positions.min(axis=0), mesh.positions.max(axis=0)])))
    prim.CreateNormalsAttr(_array(pxr, "Vec3f", np.concatenate([corner_normals(one) for one in meshes])))
    prim.SetNormalsInterpolation(pxr.UsdGeom.Tokens.faceVarying)
    primvars, types, tokens = pxr.UsdGeom.PrimvarsAPI(prim), pxr.Sdf.ValueTypeNames, pxr.UsdGeom.Tokens
    uv, color = (mesh.attributes[name][1] for name in ("UVMap", "tf_color"))
    _add_indexed(pxr, primvars.CreatePrimvar("st", types.TexCoord2fArray, tokens.faceVarying), "Vec2f", uv)
    color = np.rint(color * _TONES) / np.float32(_TONES)
    _add_indexed(pxr, primvars.CreatePrimvar("displayColor", types.Color3fArray, tokens.uniform), "Vec3f", color)
    binding, first = pxr.UsdShade.MaterialBindingAPI.Apply(prim.GetPrim()), 0
    for kind, one in level.parts:
        faces = np.arange(first, first + one.polygons, dtype=np.int32)
        subset = binding.CreateMaterialBindSubset(kind, _array(pxr, "Int", faces)).GetPrim()
        material = pxr.UsdShade.Material.Get(stage, f"{_MATERIALS}/{variant.surfaces[kind].name}")
        pxr.UsdShade.MaterialBindingAPI.Apply(subset).Bind(material)
        first += one.polygons


def _add_indexed(pxr: SimpleNamespace, primvar: object, kind: str, values: NDArray) -> None:
    """Give a primvar its different values, and an index to them: leaves are copies of each other."""
    same = np.ascontiguousarray(values, np.float32).view([("", np.float32)] * values.shape[1])[:, 0]
    different, index = np.unique(same, return_inverse=True)
    primvar.Set(_array(pxr, kind, different.view(np.float32).reshape(-1, values.shape[1])))
    primvar.SetIndices(_array(pxr, "Int", index.reshape(-1).astype(np.int32)))


def _write_surface(pxr: SimpleNamespace, stage: object, surface: BakedSurface) -> None:
    types, path = pxr.Sdf.ValueTypeNames, f"{_MATERIALS}/{surface.name}"
    pxr.UsdGeom.Scope.Define(stage, _MATERIALS)
    material = pxr.UsdShade.Material.Define(stage, path)
    shader = pxr.UsdShade.Shader.Define(stage, f"{path}/Surface")
    shader.CreateIdAttr("UsdPreviewSurface")
    shader.CreateInput("roughness", types.Float).Set(surface.roughness)
    shader.CreateInput("ior", types.Float).Set(surface.index)
    shader.CreateInput("diffuseColor", types.Color3f).Set(pxr.Gf.Vec3f(*surface.color))
    if surface.cut:
        shader.CreateInput("opacityThreshold", types.Float).Set(surface.cut)
    material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
    if not surface.textures:
        return
    place = pxr.UsdShade.Shader.Define(stage, f"{path}/Place")
    place.CreateIdAttr("UsdPrimvarReader_float2")
    place.CreateInput("varname", types.String).Set("st")
    for name, file in surface.textures.items():
        if name != "card":
            _add_texture(pxr, stage, f"{path}/{name}", name, file, (shader, place))


def _add_texture(pxr: SimpleNamespace, stage: object, path: str, name: str, file: str, ends: Sequence[object]) -> None:
    """A texture between the shaders that use it and that tell its place."""
    types, (shader, place) = pxr.Sdf.ValueTypeNames, ends
    image = pxr.UsdShade.Shader.Define(stage, path)
    image.CreateIdAttr("UsdUVTexture")
    image.CreateInput("file", types.Asset).Set(f"./{file}")
    image.CreateInput("wrapS", types.Token).Set("repeat")
    image.CreateInput("wrapT", types.Token).Set("repeat")
    image.CreateInput("sourceColorSpace", types.Token).Set("sRGB" if name == "color" else "raw")
    image.CreateInput("st", types.Float2).ConnectToSource(place.ConnectableAPI(), "result")
    colored = {"color": ("diffuseColor", types.Color3f), "normal": ("normal", types.Normal3f)}
    key, of = colored.get(name, (name, types.Float))
    output = "rgb" if name in colored else "r"
    if name == "normal":
        image.CreateInput("scale", types.Float4).Set(pxr.Gf.Vec4f(2.0, 2.0, 2.0, 1.0))
        image.CreateInput("bias", types.Float4).Set(pxr.Gf.Vec4f(-1.0, -1.0, -1.0, 0.0))
    image.CreateOutput(output, types.Float if len(output) == 1 else types.Float3)
    shader.CreateInput(key, of).ConnectToSource(image.ConnectableAPI(), output)


def _read_parts(path: Path) -> Iterator[tuple[str, dict, PointAttributes]]:
    """Plants of a file: for each instancer or cloud of points its name, custom data, and attributes of its points.

    Points that TetFlora has not written have the data ``{}``, and attributes in the world: places, and where they are
    told scales, and numbers that are named as those of fields.
    """
    pxr = library()
    try:
        stage = pxr.Usd.Stage.Open(str(path))
    except RuntimeError as error:
        raise TetFloraError(f"{path.name}: cannot be read: {' '.join(str(error).split())[:200]}") from None
    number = 0
    for prim in stage.Traverse():
        if prim.IsA(pxr.UsdGeom.PointInstancer) or prim.IsA(pxr.UsdGeom.Points):
            data = dict(prim.GetCustomDataByKey(KEY) or {})
            points = _own_points(pxr, prim, data) if data else _other_points(pxr, prim)
            if len(points["position"][1]):
                number += 1
                yield str(data.get("name", prim.GetName())), data, points
    if not number:
        raise TetFloraError(f"{path.name}: holds no point instancer and no points; export these from the other program")


def _own_points(pxr: SimpleNamespace, prim: object, data: dict) -> PointAttributes:
    primvars, attributes = pxr.UsdGeom.PrimvarsAPI(prim), {}
    for name, told in dict(data["attributes"]).items():
        kind, _, other = str(told).partition(" ")
        place = name == "position" and not other
        values = np.array((prim.GetAttribute("positions") if place else primvars.GetPrimvar(other or name)).Get())
        attributes[name] = kind, np.ascontiguousarray(np.roll(values, 1, axis=1)) if kind == 'QUATERNION' else values
    return attributes


def _other_points(pxr: SimpleNamespace, prim: object) -> PointAttributes:
    """What a foreign file tells of its points, in the world, at the first moment that it has."""
    is_instancer, time = prim.IsA(pxr.UsdGeom.PointInstancer), pxr.Usd.TimeCode.EarliestTime()
    places = np.array(prim.GetAttribute("positions" if is_instancer else "points").Get(time) or []).reshape(-1, 3)
    number = len(places)
    up = pxr.UsdGeom.GetStageUpAxis(prim.GetStage())
    world = np.array(pxr.UsdGeom.XformCache(time).GetLocalToWorldTransform(prim)).T
    world = world * np.array([pxr.UsdGeom.GetStageMetersPerUnit(prim.GetStage())] * 3 + [1.0])[:, None]
    if up == pxr.UsdGeom.Tokens.y:
        world = np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1.0]]) @ world
    attributes = {"position": ('FLOAT_VECTOR', (places @ world[:3, :3].T + world[:3, 3]).astype(np.float32))}
    primvars = pxr.UsdGeom.PrimvarsAPI(prim)
    for name, kind in (("seed", 'INT'), ("species", 'INT'), ("age", 'FLOAT'), ("scale", 'FLOAT')):
        values = primvars.GetPrimvar(name).Get(time) if primvars.HasPrimvar(name) else None
        values = None if values is None else np.asarray(values)
        if values is not None and values.shape == (number,) and values.dtype.kind in "iuf":
            attributes[name] = kind, values.astype(np.int32 if kind == 'INT' else np.float32)
    scales = np.array(prim.GetAttribute("scales").Get(time) or []) if is_instancer else np.zeros(0)
    if "scale" not in attributes and scales.shape == (number, 3):
        attributes["scale"] = 'FLOAT', scales.mean(axis=1).astype(np.float32)
    return attributes


_SPECIES, _SEED = 1, 2
_TRANSFORM = {"rotation_mode", "location", "rotation_euler", "rotation_quaternion", "rotation_axis_angle", "scale"}


@importing
def forest_steps(order: Import, mix: Mapping[str, float]) -> Steps:
    """Make a field for each object whose plants a file holds; see `importing`.

    Parameters
    ----------
    mix : mapping
        Weights of species by identifier, for points that do not tell theirs.

    Raises
    ------
    SceneError
        The file holds no points, or is of a newer TetFlora.
    """
    yield Progress(0.0, f"Reading {order.path.name}")
    fields: list[bpy.types.Object] = []
    missing, number = [], 0
    try:
        for name, data, points in _read_parts(order.path):
            if data and int(data.get("format", 0)) > FORMAT:
                raise SceneError(f"{order.what}was written by a newer TetFlora; update the extension")
            if data:  # species that it counts through, each with the name of the object of its form
                kinds = list(zip(map(str, data["species"]), map(str, data["forms"]), strict=True))
            else:
                points, kinds = _completed(points, mix)
            fields.append(_field(name, data, points, kinds))
            missing += [form for _, form in kinds if form and bpy.data.objects.get(form) is None]
            number += len(points["position"][1])
            yield Progress(0.5, f"{number:,} plants")
        for field in fields:
            link_field(order.scene, field)
    except BaseException:  # an error, or Esc
        meshes = [field.data for field in fields]
        bpy.data.batch_remove(fields)
        bpy.data.batch_remove(meshes)
        raise
    told = [f"{number:,} plants imported", f"{len(fields):,} field{'s' * (len(fields) > 1)}"]
    if missing:
        told.append(f"without their forms, which this file has no objects for: {listed(sorted(set(missing)))}")
    return Imported(fields[0], told, bool(missing))


def _completed(points: PointAttributes, mix: Mapping[str, float]) -> tuple[PointAttributes, list[tuple[str, str]]]:
    """Points of another program with seeds and species, by chance where they tell none."""
    number, names = len(points["position"][1]), list(mix)
    keys = child_key(key_of_seed(0), np.arange(number))
    attributes = dict(points)
    if "seed" not in attributes:
        attributes["seed"] = 'INT', (uniform(keys, _SEED) * 2**31).astype(np.int32)
    known = attributes.get("species")
    if known is None or not ((known[1] >= 0) & (known[1] < len(names))).all():
        attributes["species"] = 'INT', species_by_weight(tuple(mix.values()), uniform(keys, _SPECIES)).astype(np.int32)
    return attributes, [(name, "") for name in names]


def _field(name: str, data: Mapping, points: PointAttributes, kinds: list[tuple[str, str]]) -> bpy.types.Object:
    """A field that is in no collection yet."""
    mesh = bpy.data.meshes.new(name)
    write_points(mesh, points)
    obj = bpy.data.objects.new(name, mesh)
    group = obj.tetflora
    if data:
        obj.matrix_world = Matrix(np.array(data["matrix"]).T.tolist())
        for key, value in dict(data.get("object", {})).items():
            if key in {"age", "seed"}:
                setattr(group, key, value)
            elif key in _TRANSFORM:
                setattr(obj, key, value if isinstance(value, str) else list(value))
    group.is_field = True
    for species, form in kinds:
        entry = group.field_species.add()
        entry.species, entry.skeleton = species, bpy.data.objects.get(form) if form else None
    return obj
