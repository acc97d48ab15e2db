"""BSDFs without counterpart here: kept as plain dictionaries, which `path` hands to Mitsuba, and the values that stand in.

Only plugins and parameters of the list below are kept, so that a scene names no other plugin, and files only within reach.
Mitsuba's textures run down where ours run up: a kept BSDF wants uv as Mitsuba has it, (u, 1 - v).
"""

import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .containment import Reach
from .images import read_image
from .mitsuba_dictionary import constant_color, number_of, type_of
from .mitsuba_textures import acts, existing
from .reflectance import LARGEST_F0, f0_of_ior

_IOR = "int_ior ext_ior"
_ROUGH = "alpha alpha_u alpha_v distribution sample_visible"
_DISNEY = "base_color roughness anisotropic spec_trans eta spec_tint sheen sheen_tint flatness"
PARAMETERS = {
    name: frozenset(keys.split())
    for name, keys in {
        "principled": f"""{_DISNEY} specular metallic clearcoat clearcoat_gloss main_specular_sampling_rate
            clearcoat_sampling_rate diffuse_reflectance_sampling_rate""",
        "principledthin": f"{_DISNEY} diff_trans diffuse_reflectance_sampling_rate",
        "diffuse": "reflectance",
        "conductor": "material eta k specular_reflectance",
        "roughconductor": f"material eta k specular_reflectance {_ROUGH}",
        "plastic": f"diffuse_reflectance specular_reflectance nonlinear {_IOR}",
        "roughplastic": f"diffuse_reflectance specular_reflectance nonlinear alpha distribution sample_visible {_IOR}",
        "pplastic": f"diffuse_reflectance specular_reflectance alpha distribution sample_visible {_IOR}",
        "dielectric": f"specular_reflectance specular_transmittance {_IOR}",
        "thindielectric": f"specular_reflectance specular_transmittance {_IOR}",
        "roughdielectric": f"specular_reflectance specular_transmittance {_ROUGH} {_IOR}",
        "twosided": "",
        "mask": "opacity",
        "normalmap": "normalmap use_shadowing_function flip_invalid_normals",
        "bumpmap": "scale use_shadowing_function flip_invalid_normals",
        "blendbsdf": "weight",
        "hair": f"""eumelanin pheomelanin sigma_a scale longitudinal_roughness azimuthal_roughness scale_tilt
            {_IOR}""",
        "measured": "filename",
        "polarizer": "theta transmittance polarizing",
        "retarder": "theta delta transmittance",
        "circular": "transmittance left_handed",
        "null": "",
        # textures in them
        "bitmap": "filename raw filter_type wrap_mode to_uv format accel",
        "checkerboard": "color0 color1 to_uv",
        "rgb": "value",
        "srgb": "color value",
        "uniform": "value",
        "spectrum": "value",
    }.items()
}
NESTS = ("twosided", "mask", "normalmap", "bumpmap", "blendbsdf")  # they hold other objects under any name
TEXTURES = ("bitmap", "checkerboard", "rgb", "srgb", "uniform", "spectrum")
CLEAR = ("dielectric", "thindielectric", "roughdielectric", "polarizer", "retarder", "circular")
CLEAR_OPACITY = 0.1  # a layer of glass (1.5) reflects 0.092 of diffuse light (Fresnel over the hemisphere)
# Mitsuba's names of dielectrics, 589.3 nm.
INDICES = {
    "vacuum": 1.0, "helium": 1.000036, "hydrogen": 1.000132, "air": 1.000277, "carbon dioxide": 1.00045, "water": 1.3330,
    "acetone": 1.36, "ethanol": 1.361, "carbon tetrachloride": 1.461, "glycerol": 1.4729, "benzene": 1.501,
    "silicone oil": 1.52045, "bromine": 1.661, "water ice": 1.31, "fused quartz": 1.458, "pyrex": 1.470,
    "acrylic glass": 1.49, "polypropylene": 1.49, "bk7": 1.5046, "sodium chloride": 1.544, "amber": 1.55, "pet": 1.5750,
    "diamond": 2.419,
}  # fmt: skip


def kept_bsdf(
    values: Mapping[str, Any], reach: Reach, texels: dict[Path, NDArray] | None = None
) -> tuple[dict[str, Any], tuple[str, ...]]:
    """(the dictionary for `mi.load_dict`, what of it was left out): plain numbers, strings, lists, nested dictionaries.

    Files are absolute paths, transforms nested 4x4 lists. texels: images that were read, by file; it grows. Raises
    InputError for plugins that are not in `PARAMETERS`, for other files than those within reach, and for values of the wrong
    kind.
    """
    texels = {} if texels is None else texels
    kind = type_of(values, "a BSDF")
    if kind not in PARAMETERS:
        raise InputError(f"{kind[:80]} in a BSDF")
    kept: dict[str, Any] = {"type": kind}
    said: list[str] = []
    for key, value in values.items():
        if key in ("type", "id"):
            continue
        holds = isinstance(value, Mapping) and kind in NESTS
        if key not in PARAMETERS[kind] and not holds:
            said.append(f"{kind}.{key}")
        elif isinstance(value, Mapping):
            if value.get("type") in ("mesh_attribute", "volume", "rawconstant", "regular", "irregular", "d65", "blackbody"):
                said.append(f"{kind}.{key} through {value['type']}")
                continue
            kept[key], more = kept_bsdf(value, reach, texels)
            said += more
        else:
            kept[key] = _parameter(key, value, kind, reach, texels)
    if kind in NESTS and not any(type_of(v) not in TEXTURES for v in kept.values() if isinstance(v, dict)):
        raise InputError(f"{kind} without a BSDF in it")
    if kind == "spectrum" and isinstance(kept.get("value"), list):
        return {"type": "rgb", "value": list(constant_color(kept, "spectrum"))}, tuple(said)
    return kept, tuple(said)


def _parameter(key: str, value: Any, kind: str, reach: Reach, texels: dict[Path, NDArray]) -> Any:
    if key == "filename":
        file = existing(reach, value, "image" if kind == "bitmap" else "file")
        if kind == "bitmap" and file not in texels:
            texels[file] = read_image(
                file
            )  # Mitsuba's readers are not made for damaged files: what ours refuse does not get there
        return str(file)
    if key == "to_uv":
        matrix = np.array(value, dtype=object)
        if matrix.shape not in ((3, 3), (4, 4)):
            raise InputError(f"to_uv of {kind} is no 3x3 or 4x4 matrix")
        affine = np.eye(4)
        for row in range(2):
            for column, source in ((0, 0), (1, 1), (3, -1)):
                affine[row, column] = number_of(matrix[row, source], "to_uv")
        return affine.tolist()
    if isinstance(value, str):
        if not re.fullmatch(r"[\w .,+-]{0,80}", value):
            raise InputError(f"{key} is {value[:80]!r}, a name is expected")
        return value
    if isinstance(value, list | tuple):
        flat = np.array(value, dtype=object).ravel()
        _ = [number_of(component, key) for component in flat]
        return value
    return value if isinstance(value, bool) else _small(number_of(value, key), value)


def _small(checked: float, value: int | float) -> int | float:
    return value if isinstance(value, int) else checked


def index_of(values: Mapping[str, Any], key: str, default: float) -> float:
    """An index of refraction: a number, or one of Mitsuba's names."""
    value = values.get(key, default)
    if isinstance(value, str):
        if value.lower() not in INDICES:
            raise InputError(f"{key} is {value[:80]!r}, a number or one of {', '.join(sorted(INDICES))} is expected")
        return INDICES[value.lower()]
    return number_of(value, key)


def stand_in(values: Mapping[str, Any]) -> dict[str, Any]:
    """Constants of a Material for `raster` and the G-buffer: the nearest that ours has.

    Base colour from the diffuse reflectance (of hair and measured ones, grey), roughness sqrt(alpha), F0 from the indices of
    refraction, metallic for conductors; clear ones are a blended layer, of an opacity that reflects as much of diffuse light.
    """
    kind = type_of(values, "a BSDF")
    if kind == "blendbsdf":
        nested = [v for v in values.values() if isinstance(v, Mapping) and type_of(v) not in TEXTURES]
        weight = values.get("weight", 0.5)
        is_second = not isinstance(weight, Mapping) and number_of(weight, "weight") > 0.5
        return stand_in(nested[-1] if is_second else nested[0])
    if kind in NESTS:
        return stand_in(next(v for v in values.values() if isinstance(v, Mapping) and type_of(v) not in TEXTURES))
    if kind in CLEAR or acts(values.get("spec_trans", 0)) and kind in ("principled", "principledthin"):
        roughness = _roughness(values) if kind != "dielectric" else 0.0
        clear = {"base_color": (1.0, 1.0, 1.0), "roughness": roughness, "specular": _specular(values)}
        return {**clear, "alpha": "blend", "opacity": CLEAR_OPACITY}
    if kind in ("conductor", "roughconductor"):
        base = _reflectance(values, "specular_reflectance", 1.0)
        return {"base_color": base, "roughness": _roughness(values), "metallic": 1.0}
    if kind in ("plastic", "roughplastic", "pplastic"):
        base = _reflectance(values, "diffuse_reflectance", 0.5)
        return {"base_color": base, "roughness": _roughness(values), "specular": _specular(values)}
    if kind == "diffuse":
        return {"base_color": _reflectance(values, "reflectance", 0.5), "roughness": 1.0, "specular": 0.0}
    if kind in ("principled", "principledthin"):
        return {"base_color": _reflectance(values, "base_color", 0.5), "roughness": _roughness(values)}
    return {"base_color": (0.5, 0.5, 0.5), "roughness": 0.5}


def _reflectance(values: Mapping[str, Any], key: str, default: float) -> tuple[float, float, float]:
    return constant_color(values.get(key, default), key) or (default,) * 3


def _roughness(values: Mapping[str, Any]) -> float:
    if type_of(values) in ("conductor", "plastic", "thindielectric"):
        return 0.0
    disney = type_of(values).startswith("principled")
    keys = ("roughness",) if disney else ("alpha_u", "alpha_v") if "alpha_u" in values else ("alpha",)
    found = [_reflectance(values, key, 0.5 if disney else 0.1)[1] for key in keys]
    value = min(max(math.prod(found) ** (1 / len(found)), 0.0), 1.0)
    return value if disney else math.sqrt(value)


def _specular(values: Mapping[str, Any]) -> float:
    if "specular" in values or "eta" in values or type_of(values).startswith("principled"):
        eta = values.get("eta", 1.5)
        return min(f0_of_ior(number_of(eta, "eta"), "eta") / LARGEST_F0, 1.0) if not isinstance(eta, Mapping) else 0.5
    inside = index_of(values, "int_ior", 1.49 if "plastic" in type_of(values) else 1.5046)
    outside = index_of(values, "ext_ior", INDICES["air"])
    if outside <= 0:
        raise InputError(f"ext_ior is {outside:g}, above 0 is expected")
    return min(f0_of_ior(inside / outside, "int_ior") / LARGEST_F0, 1.0)
