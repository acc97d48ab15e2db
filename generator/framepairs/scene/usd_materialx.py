"""MaterialX surface shaders in USD networks as materials: Standard Surface, OpenPBR and glTF PBR.

Sources: MaterialX 1.39, libraries/bxdf (names and defaults of the inputs, and how they combine), and the OpenPBR
specification, version 1.1. Each is a base that is a metal or a dielectric of F0 = weight * color * ((ior - 1) / (ior + 1))^2.
Emission is taken as radiance, OpenPBR's luminance in nits, too. Opacity is coverage: highlights fade with it. What else acts
is named in Material.not_read, and changes over time are. A .mtlx file that a stage refers to is not read: USD's own wheels
have no plugin for it, and composition says so.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from pxr import UsdShade

from .description import Material, Slot
from .reflectance import f0_of_ior, specular_of_f0
from .usd_inputs import Constant, Driven, Primvar, ReadMaterial, Unread, driven_by
from .usd_networks import EARLIEST, as_text, changing, kind_of, node_of, source, value
from .usd_textures import Sampled, TextureReader, slot_at, unread_textures, uv_names_of

GRAY = 1e-3  # difference between the components of a colour that counts as grey
ONE, ZERO = (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)
OPACITY_OF_MODE = ("opaque", "mask", "blend")  # glTF's alpha_mode


@dataclass(frozen=True, kw_only=True)
class SurfaceInputs:
    """The inputs of a surface shader by their meaning, each with its default. layers: inputs that act where they are not 0,
    each with those that matter then alone. others: further ones that are not drawn, with their neutral values."""

    base_color: tuple[str, tuple[float, float, float]]
    base_weight: tuple[str, float] | None
    metallic: tuple[str, float]
    roughness: tuple[str, float]
    specular: tuple[str, float]
    specular_color: tuple[str, tuple[float, float, float]]
    ior: tuple[str, float]
    emission: tuple[str, float]
    emission_color: tuple[str, tuple[float, float, float]]
    opacity: tuple[str, float]
    normal: str
    layers: Mapping[str, tuple[str, ...]]
    others: Mapping[str, float]


STANDARD_SURFACE = SurfaceInputs(
    base_color=("base_color", (0.8, 0.8, 0.8)), base_weight=("base", 1.0), metallic=("metalness", 0.0),
    roughness=("specular_roughness", 0.2), specular=("specular", 1.0), specular_color=("specular_color", ONE),
    ior=("specular_IOR", 1.5), emission=("emission", 0.0), emission_color=("emission_color", ONE), opacity=("opacity", 1.0),
    normal="normal",
    layers={
        "transmission": ("transmission_color", "transmission_depth"), "subsurface": ("subsurface_color",),
        "sheen": ("sheen_color", "sheen_roughness"), "coat": ("coat_color", "coat_roughness", "coat_IOR"),
        "thin_film_thickness": ("thin_film_IOR",), "specular_anisotropy": ("specular_rotation",),
    },
    others={"diffuse_roughness": 0.0},
)  # fmt: skip
OPEN_PBR = SurfaceInputs(
    base_color=("base_color", (0.8, 0.8, 0.8)), base_weight=("base_weight", 1.0), metallic=("base_metalness", 0.0),
    roughness=("specular_roughness", 0.3), specular=("specular_weight", 1.0), specular_color=("specular_color", ONE),
    ior=("specular_ior", 1.5), emission=("emission_luminance", 0.0), emission_color=("emission_color", ONE),
    opacity=("geometry_opacity", 1.0), normal="geometry_normal",
    layers={
        "transmission_weight": ("transmission_color", "transmission_depth"), "subsurface_weight": ("subsurface_color",),
        "fuzz_weight": ("fuzz_color", "fuzz_roughness"), "coat_weight": ("coat_color", "coat_roughness", "coat_ior"),
        "thin_film_weight": ("thin_film_thickness", "thin_film_ior"), "specular_roughness_anisotropy": (),
    },
    others={"base_diffuse_roughness": 0.0},
)  # fmt: skip
GLTF_PBR = SurfaceInputs(
    base_color=("base_color", ONE), base_weight=None, metallic=("metallic", 1.0), roughness=("roughness", 1.0),
    specular=("specular", 1.0), specular_color=("specular_color", ONE), ior=("ior", 1.5), emission=("emissive_strength", 1.0),
    emission_color=("emissive", ZERO), opacity=("alpha", 1.0), normal="normal",
    layers={
        "transmission": ("thickness", "attenuation_color"), "iridescence": ("iridescence_ior", "iridescence_thickness"),
        "sheen_color": ("sheen_roughness",), "clearcoat": ("clearcoat_roughness",), "anisotropy_strength": (),
    },
    others={"occlusion": 1.0},
)  # fmt: skip
SURFACES = {
    "ND_standard_surface_surfaceshader": STANDARD_SURFACE,
    "ND_standard_surface_surfaceshader_100": replace(
        STANDARD_SURFACE, base_color=("base_color", ONE), base_weight=("base", 0.8)
    ),
    "ND_open_pbr_surface_surfaceshader": OPEN_PBR,
    "ND_gltf_pbr_surfaceshader": GLTF_PBR,
}


@dataclass(frozen=True)
class Network:
    """A surface shader with what drives its inputs; said: what of it is not drawn grows."""

    shader: UsdShade.Shader
    driven: Mapping[str, Driven | None]
    said: list[str]

    def sampled(self, key: str) -> Sampled | None:
        item = self.driven.get(key)
        return item if isinstance(item, Sampled) else None

    def primvar(self, key: str) -> Primvar | None:
        item = self.driven.get(key)
        return item if isinstance(item, Primvar) else None

    def numbers(self, named: tuple[str, float | tuple[float, ...]], drawn: bool = False) -> tuple[float, ...]:
        """The constant of an input; drawn: 1 where a texture or primvar is drawn that it multiplies."""
        key, default = named
        item, size = self.driven.get(key), len(default) if isinstance(default, tuple) else 1
        if isinstance(item, Constant):
            return _resized(item.value, size)
        if drawn and isinstance(item, Sampled | Primvar):
            return (1.0,) * size
        return _resized(
            tuple(np.atleast_1d(value(self.shader, key, default, sizes=(0, 1, 2, 3, 4))).astype(float).tolist()), size
        )

    def number(self, named: tuple[str, float], drawn: bool = False) -> float:
        return self.numbers(named, drawn)[0]


def _resized(numbers: tuple[float, ...], size: int) -> tuple[float, ...]:
    return (numbers * size)[:size] if len(numbers) == 1 else numbers[:size]


def read_materialx(name: str, shader: UsdShade.Shader, textures: TextureReader) -> ReadMaterial:
    """The material of a surface shader whose kind is one of SURFACES. Raises InputError naming it for images that cannot be
    read and for an index of refraction below 0."""
    inputs = SURFACES[kind_of(shader)]
    colors = (inputs.base_color[0], inputs.emission_color[0])
    names = [item.GetBaseName() for item in shader.GetInputs()]
    network = Network(shader, {key: driven_by(shader, key, textures, color=key in colors) for key in names}, [])
    alpha = _alpha(network, inputs)
    slots = _slots(network, inputs, alpha)
    constants = _constants(name, network, inputs)
    _name_unread(network, inputs, slots)
    return ReadMaterial(
        material=Material(
            name=name,
            alpha=alpha,
            not_read=(*network.said, *unread_textures(slots, [EARLIEST])),
            **constants,
            **_textures(name, textures, network, inputs, slots),
        ),
        uv_names=uv_names_of(slots),
        color=network.primvar(inputs.base_color[0]),
        opacity=network.primvar(inputs.opacity[0]) if alpha != "opaque" else None,
    )


def _alpha(network: Network, inputs: SurfaceInputs) -> str:
    if inputs is GLTF_PBR:
        return OPACITY_OF_MODE[min(max(int(value(network.shader, "alpha_mode", 0)), 0), 2)]
    is_drawn = isinstance(network.driven.get(inputs.opacity[0]), Sampled | Primvar)
    return "blend" if is_drawn or min(network.numbers((inputs.opacity[0], ONE))) < 1 else "opaque"


def _slots(network: Network, inputs: SurfaceInputs, alpha: str) -> dict[str, list[tuple[str, Sampled]]]:
    """The textures that are drawn, by our slots."""
    keys = {
        "base_texture": (inputs.base_color[0], *((inputs.opacity[0],) if alpha != "opaque" else ())),
        "surface_texture": (inputs.specular[0], inputs.roughness[0], inputs.metallic[0]),
        "normal_texture": (inputs.normal,) if _is_tangent_space(network, inputs.normal) else (),
        "emission_texture": (inputs.emission_color[0], inputs.emission[0]),
    }
    found = {slot: [(key, item) for key in names if (item := network.sampled(key))] for slot, names in keys.items()}
    return found | {"emission_texture": found["emission_texture"][:1]}


def _is_tangent_space(network: Network, key: str) -> bool:
    found = source(network.shader, key)
    return found is not None and node_of(found[0]) == "normalmap" and value(found[0], "space", "tangent") == "tangent"


def _constants(name: str, network: Network, inputs: SurfaceInputs) -> dict:
    weight = network.number(inputs.base_weight) if inputs.base_weight else 1.0
    opacity = network.numbers((inputs.opacity[0], ONE), drawn=True)
    if np.ptp(opacity) > GRAY:
        network.said.append(f"{inputs.opacity[0]} {as_text(opacity)}: its mean is drawn")
    color_is_drawn = network.sampled(inputs.emission_color[0]) is not None
    power = network.number(inputs.emission, drawn=not color_is_drawn)
    normal = network.sampled(inputs.normal)
    return {
        "base_color": tuple(weight * c for c in network.numbers(inputs.base_color, drawn=True)),
        "roughness": network.number(inputs.roughness, drawn=True),
        "metallic": network.number(inputs.metallic, drawn=True),
        "specular": _specular(name, network, inputs),
        "emission": tuple(power * c for c in network.numbers(inputs.emission_color, drawn=color_is_drawn)),
        "opacity": float(np.mean(opacity)),
        "alpha_cutoff": float(value(network.shader, "alpha_cutoff", 0.5)),
        "normal_scale": normal.normal_scale if normal else 1.0,
    }


def _specular(name: str, network: Network, inputs: SurfaceInputs) -> float:
    """Of F0, which metals do not have: their colour at grazing angles is named where it is not white."""
    color, weight = np.array(network.numbers(inputs.specular_color)), network.number(inputs.specular, drawn=True)
    ior = network.number(inputs.ior)
    specular, said = specular_of_f0(weight * float(color.mean()) * f0_of_ior(ior, name), f"{inputs.ior[0]} {ior:g}")
    if network.number(inputs.metallic) >= 1 and not network.sampled(inputs.metallic[0]):
        is_white = np.allclose(weight * color, 1) or inputs is GLTF_PBR
        said = () if is_white else (f"{inputs.specular_color[0]} {as_text(weight * color)} of a metal: its edge is white",)
    elif np.ptp(color) > GRAY:
        said += (f"{inputs.specular_color[0]} {as_text(color)}: F0 is grey, its mean",)
    network.said.extend(said)
    return specular


def _textures(name: str, textures: TextureReader, network: Network, inputs: SurfaceInputs, slots) -> dict[str, Slot | None]:
    drawn = {key: item for items in slots.values() for key, item in items}
    color, opacity = drawn.get(inputs.base_color[0]), drawn.get(inputs.opacity[0])
    parts = (drawn.get(key) for key in (inputs.roughness[0], inputs.metallic[0], inputs.specular[0]))
    emission, normal = (dict(slots[slot]).values() for slot in ("emission_texture", "normal_texture"))
    filled = {
        "base_texture": textures.base_slot(f"{name} base", color, opacity, _alpha(network, inputs) == "opaque"),
        "surface_texture": textures.surface_slot(f"{name} surface", *parts),
        "normal_texture": textures.slot(next((item.texture for item in normal), None)),
        "emission_texture": textures.color_slot(f"{name} emission", next(iter(emission), None)),
    }
    names = uv_names_of(slots)
    return {slot: slot_at(item, slots[slot][0][1], names, EARLIEST) if item else None for slot, item in filled.items()}


def _name_unread(network: Network, inputs: SurfaceInputs, slots) -> None:
    """Names the inputs that act and are not drawn, with their values."""
    drawn = {key for items in slots.values() for key, _ in items}
    ignored = {inputs.opacity[0]} if inputs is GLTF_PBR and not value(network.shader, "alpha_mode", 0) else set()
    weights = {key: 0.0 for key in inputs.layers} | dict(inputs.others)
    unweighted = {part for key, parts in inputs.layers.items() if network.numbers((key, ZERO)) == ZERO for part in parts}
    for key, item in network.driven.items():
        acts = key not in unweighted | ignored
        if isinstance(item, Unread) and acts:
            network.said.append(f"{key} through {item.kind}")
        elif isinstance(item, Sampled) and acts and key not in drawn:
            network.said.append(f"{key} (texture)")
        elif isinstance(item, Primvar) and acts and key not in (inputs.base_color[0], inputs.opacity[0]):
            network.said.append(f"{key} through primvar {item.name}")
        elif key in weights and (item is None or isinstance(item, Constant)):
            numbers = network.numbers((key, (weights[key],) * 3))
            if not np.allclose(numbers, weights[key]):
                parts = (part for part in (key, *inputs.layers.get(key, ())) if _has(network, part))
                network.said.extend(_with_value(network, part) for part in parts)
    network.said.extend(f"animation of {key}: it stays as it begins" for key in changing(network.shader))
    for key, item in ((key, item) for items in slots.values() for key, item in items):
        moved = {name for node in item.uv_nodes for name in changing(node)}
        network.said.extend(f"animation of {name} of the uv of {key}: it stays as it begins" for name in sorted(moved))


def _has(network: Network, key: str) -> bool:
    return value(network.shader, key) is not None or isinstance(network.driven.get(key), Constant)


def _with_value(network: Network, key: str) -> str:
    item = network.driven.get(key)
    numbers = item.value if isinstance(item, Constant) else np.atleast_1d(value(network.shader, key)).astype(float)
    return f"{key} {as_text(float(numbers[0]) if len(numbers) == 1 else tuple(numbers))}"
