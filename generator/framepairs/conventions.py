"""What sizes, names and positions mean. Each sentence here is a test in tests/test_conventions.py.

Image origin top left, x right, y down; the centre of pixel (i, j) is (i + 0.5, j + 0.5). All streams span the frustum of
the display: a sample is addressed by its fraction of the frame, so that LR pixels may be slightly non-square.
"""

import math
from dataclasses import dataclass
from typing import Literal

CONVENTIONS = {
    "image": "origin top left, x right, y down; centre of pixel (i, j) at (i + 0.5, j + 0.5)",
    "frustum": "every stream spans exactly the frustum of the display",
    "jitter": "LR pixels, |J| <= 0.5, y down; the pixel samples the unjittered position centre - J; "
    "in Mitsuba principal_point_offset = -J / size",
    "motion": "previous minus current place of the surface point: previous = current + motion; pixels of its own buffer, "
    "y down, without jitter, not dilated",
    "dual_motion": "y - z with y = x + motion(x) and z the present place of the surface that was visible at y in the "
    "previous frame; equals motion where nothing was occluded",
    "visibility": "bit 0 inside the previous frame, bit 1 in front of the previous camera, bit 2 seen by it",
    "depth": "linear z along the viewing axis, scene units, positive; +inf for the background",
    "normal": "world space, unit length, shading normal turned towards the camera; (0, 0, 0) for the background",
    "color": "scene-linear Rec. 709, unexposed; display = color * 2^exposure_ev",
    "roughness": "perceptual; GGX alpha by the plan's roughness_mapping: roughness^2 (squared) or roughness (linear)",
    "brdf": "F_beta = (1 - metallic) * albedo + F0 * A + F90 * B; F0 = lerp(0.08 * specular, albedo, metallic); "
    "F90 = min(50 * max(F0), 1)",
    "matrices": "a_from_b, row major, column vectors; camera x right, y up, looking along -z; clip z in [-1, 1]",
}


Visibility = Literal["separable_smith", "height_correlated", "schlick_k"]
RoughnessMapping = Literal["squared", "linear"]
AntialiasingPattern = Literal["strata", "halton", "qrisp_enhanced"]


@dataclass(frozen=True)
class BrdfModel:
    """Which Smith term the BRDF has, and what GGX alpha is of a perceptual roughness r: `squared` r^2, `linear` r."""

    visibility: Visibility = "separable_smith"
    mapping: RoughnessMapping = "squared"


@dataclass(frozen=True, kw_only=True)
class Stream:
    """One set of frames of a sequence: HR truth, or LR at one scale.

    size: (width, height) in pixels. scale: nominal S >= 1. jittered: samples at centre - J instead of the centre.
    mip_bias: added to the texture level that the stream's own pixel asks for. samples: AA samples per pixel for `color`,
    `emission`, `brdf`, `transparency`, `overlay`, and `pattern` where they lie.
    """

    name: str
    size: tuple[int, int]
    scale: float = 1.0
    jittered: bool = False
    mip_bias: float = 0.0
    samples: int = 1
    pattern: AntialiasingPattern = "strata"

    def effective_scale(self, display: tuple[int, int]) -> tuple[float, float]:
        """Display pixels per pixel of this stream, per axis."""
        return display[0] / self.size[0], display[1] / self.size[1]


def lr_size(display: tuple[int, int], scale: float) -> tuple[int, int]:
    """floor(display / S + 0.5) per axis, at least one pixel."""
    width, height = (max(1, math.floor(extent / scale + 0.5)) for extent in display)
    return width, height


def short_number(value: float) -> str:
    """`value` written as short as it is exact to 3 decimals: 2, 2.7, -1.433."""
    return f"{value:.3f}".rstrip("0").rstrip(".") if round(value, 3) else "0"


def lr_stream_name(scale: float, *, jittered: bool, mip_bias: float) -> str:
    """`lr_x2`, `lr_x2.7_jittered_mip-1.433`."""
    name = f"lr_x{short_number(scale)}"
    return name + ("_jittered" if jittered else "") + (f"_mip{short_number(mip_bias)}" if mip_bias else "")


def default_mip_bias(scale: float, offset: float = 0.0) -> float:
    """-log2(S) + offset (QRISP, XeSS and Unity: offset 0; FSR and DLSS: -1)."""
    return -math.log2(scale) + offset


def truth_mip_bias(samples: int, pattern: AntialiasingPattern = "strata") -> float:
    """-log2(N) / 2 for N samples a pixel: the level whose texels are as far apart as the samples. QRISP's enhanced truth
    shades once per pixel of twice the resolution: -1."""
    if pattern == "qrisp_enhanced":
        return -1.0
    return 0.0 - 0.5 * math.log2(samples)


def frame_name(frame: int) -> str:
    """Six digits."""
    return f"{frame:06d}"
