# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Proxy kinds: a table with a row for each item of the setting Proxies, and what plants need of the render engine.

A new form is a new row. Transparent bounces of Cycles matter for shells: a ray passes two faces of each, and is black
where it runs out of bounces. EEVEE has no bounces, but without ray tracing nothing keeps the sky out of crowns.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial

import bpy

from ...emission.emitters import AUTOMATIC, MICROSPHERES, MICROSURFACES, SHELLS, ProxyEmitter
from ..compat import EEVEE_ENGINES
from ..materials.materials import baked_material, proxy_material, sphere_material
from ..materials.microsphere import baked_shell_material, shell_material

#: The form of new scenes, and of scenes whose own form is not registered.
DEFAULT = 'AUTOMATIC'
#: Fraction of a form's bounces below which the artist is warned.
FEW = 0.5
#: Settings of Cycles: the number at which rays end, and the one beyond which weak light goes on by chance, as noise.
_SETTINGS = ("transparent_max_bounces", "min_transparent_bounces")
#: Settings of EEVEE, on while plants are rendered: the sky counts by how much of it the depth buffer leaves open.
_OCCLUSION = ("use_raytracing", "use_fast_gi")

_Material = Callable[[], bpy.types.Material]
_SHELL = {"p": "shell_diffuse", "s": "shell_gloss"}
_SHELL |= {name: f"shell_{name.lower()}" for name in ("spear", "Roundness", "Variation")}
_ASSET_FACETS, _ASSET_SPHERES = partial(proxy_material, asset=True), partial(sphere_material, asset=True)


@dataclass(frozen=True)
class ProxyKind:
    """One form of proxies."""

    #: identifier, label, description, icon: Of the item in the setting Proxies
    identifier: str
    number: int  # value of the item in saved files: never change or reuse it
    label: str
    description: str
    icon: str
    emission: ProxyEmitter  # how buffers are made: in a thread, so without bpy
    material: _Material = proxy_material  # returns the material of meshes, made if needed
    #: point_material, baked_material: The same for point clouds, and for either where light is baked
    point_material: _Material = sphere_material
    baked_material: _Material = baked_material
    #: asset_material, asset_point_material: The first two for what stands for assets
    asset_material: _Material = _ASSET_FACETS
    asset_point_material: _Material = _ASSET_SPHERES
    #: Properties of ``scene.tetflora``, shown in the panel Proxy Shading, by the sockets of `material` that they set
    sockets: Mapping[str, str] = field(default_factory=dict)
    bounces: int = 0  # transparent bounces that Cycles needs for a ray through many proxies; 0 for opaque ones


_FORMS = {
    form.identifier: form
    for form in (
        ProxyKind(
            'MICROSURFACES',
            0,
            "Microsurfaces",
            "Small facets with the area, directions and colors of the leaves that they replace",
            'MESH_GRID',
            MICROSURFACES,
        ),
        ProxyKind(
            'SHELLS',
            1,
            "Shells",
            "A translucent volume for each tetrahedron, as in the paper. Slower to render; suits haze",
            'MESH_CONE',
            SHELLS,
            material=shell_material,
            baked_material=baked_shell_material,
            sockets=_SHELL,
            bounces=256,
        ),
        ProxyKind(
            'MICROSPHERES',
            2,
            "Microspheres",
            "A point cloud of opaque spheres of about one pixel, one for each facet. Uses the least memory",
            'POINTCLOUD_DATA',
            MICROSPHERES,
        ),
        ProxyKind(
            'AUTOMATIC',
            3,
            "Automatic",
            "Microsurfaces where the camera sees them, which match the plants best; microspheres elsewhere",
            'SHADERFX',
            AUTOMATIC,
        ),
    )
}


def forms() -> tuple[ProxyKind, ...]:
    """All registered forms, in the order of the enumeration."""
    return tuple(_FORMS.values())


def proxy_kind_of(scene: bpy.types.Scene) -> ProxyKind:
    """The form of a scene; the default one if its own is not registered."""
    return _FORMS.get(scene.tetflora.proxy_kind, _FORMS[DEFAULT])


def proxy_kind_property() -> object:
    """The setting Proxies, with an item for each form."""
    return bpy.props.EnumProperty(
        name="Proxies",
        description="What replaces plants that are too small or too hidden for their own polygons",
        items=[(form.identifier, form.label, form.description, form.icon, form.number) for form in forms()],
        default=DEFAULT,
    )


def register_proxy_kind(form: ProxyKind) -> None:
    """Add a form to the setting Proxies, for scripts and other add-ons.

    Raises
    ------
    ValueError
        Its identifier or number is taken.
    """
    taken = [other.label for other in forms() if {other.identifier, other.number} & {form.identifier, form.number}]
    if taken:
        raise ValueError(f"{form.label}: the proxy kind {taken[0]} has the same identifier or number; choose another")
    _FORMS[form.identifier] = form
    _redefine()


def unregister_proxy_kind(identifier: str) -> None:
    """Remove a form that `register_proxy_kind` added; scenes that use it fall back to the default form."""
    del _FORMS[identifier]
    _redefine()


def _redefine() -> None:
    settings = bpy.types.PropertyGroup.bl_rna_get_subclass_py("TetFloraScene")
    if settings is not None:  # else the property is not defined yet
        settings.proxy_kind = proxy_kind_property()


def raise_settings(scene: bpy.types.Scene) -> dict[tuple[str, str], int]:
    """Raise what is too low for a scene's plants in its engine; returns what was changed, by engine and setting.

    The second of EEVEE's settings is the artist's where the first is on.
    """
    before = {}
    if scene.render.engine in EEVEE_ENGINES and not scene.eevee.use_raytracing:
        before = {("eevee", name): getattr(scene.eevee, name) for name in _OCCLUSION}
    cycles, bounces = getattr(scene, "cycles", None), proxy_kind_of(scene).bounces
    if not scene.tetflora.expand_everything and cycles is not None:
        values = {("cycles", name): getattr(cycles, name, bounces) for name in _SETTINGS}
        before |= {key: value for key, value in values.items() if value < bounces}
    for engine, name in before:
        setattr(getattr(scene, engine), name, bounces if engine == "cycles" else True)
    return before


def few_bounces(scene: bpy.types.Scene) -> str:
    """A warning if the scene's own bounces are too few for its proxies, else an empty text."""
    cycles, form = getattr(scene, "cycles", None), proxy_kind_of(scene)
    if scene.render.engine != 'CYCLES' or cycles is None or cycles.transparent_max_bounces >= FEW * form.bounces:
        return ""
    return (
        f"Cycles renders {form.label.lower()} black with {cycles.transparent_max_bounces} transparent bounces; "
        f"raise Render > Light Paths > Max Bounces > Transparent to {form.bounces}"
    )
