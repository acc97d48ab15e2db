"""The render plan: every decision about a corpus, read from options or a file, resolved, stored, and runnable again."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from .channels import channels_with
from .conventions import (
    AntialiasingPattern,
    BrdfModel,
    RoughnessMapping,
    Stream,
    Visibility,
    default_mip_bias,
    lr_size,
    lr_stream_name,
    truth_mip_bias,
)
from .errors import InputError
from .jitter import ENHANCED_SAMPLES, default_length

Scale = Annotated[float, Field(ge=1, le=64, allow_inf_nan=False)]
Extent = Annotated[int, Field(ge=1, le=16384)]
LrVariant = Literal["native", "jittered", "mip", "jittered_mip"]


class RenderPlan(BaseModel):
    """What to render. Unknown keys are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    version: Literal[1] = 1
    display: tuple[Extent, Extent] = Field((1920, 1080), description="width and height of HR frames, in pixels")
    scales: tuple[Scale, ...] = Field((2.0,), description="scale factors of the LR streams, each >= 1")
    variants: tuple[LrVariant, ...] = Field(("native", "jittered_mip"), description="LR streams per scale")
    hr_native: bool = Field(False, description="add the stream hr_native: one sample per pixel, all channels")
    hr_mip0: bool = Field(False, description="add the stream hr_mip0: the truth at mip bias 0, to which unbiased LR converges")
    shading: Literal["raster", "path"] = Field("raster", description="noise-free raster shading or path tracing")
    antialiasing: Annotated[int, Field(ge=1, le=4096)] = Field(16, description="samples per pixel of the HR truth")
    antialiasing_pattern: AntialiasingPattern = Field(
        "strata", description="where these lie; qrisp_enhanced: 8 samples in each quarter of the pixel"
    )
    samples_per_pixel: Annotated[int, Field(ge=1, le=65536)] = Field(64, description="light paths per pixel (path)")
    clamp_radiance: Annotated[float, Field(gt=0, allow_inf_nan=False)] | None = Field(
        None, description="luminance to which a light path is limited (path); null: none is"
    )
    max_depth: Annotated[int, Field(ge=1, le=64)] = Field(6, description="longest light path, in edges (path)")
    light_samples: Annotated[int, Field(ge=1, le=1024)] = Field(16, description="points per light with an extent (raster)")
    mesh_lights: bool = Field(False, description="emissive objects light others in raster, too (in path they always do)")
    ambient_occlusion: Annotated[int, Field(ge=0, le=1024)] = Field(0, description="rays per sample (raster); 0: none")
    ambient_occlusion_radius_m: Annotated[float, Field(gt=0, allow_inf_nan=False)] = Field(
        1.0, description="metres within which ambient light is occluded"
    )
    jitter_length: Annotated[int, Field(ge=1)] | None = Field(
        None, description="length of the Halton sequence; null: int(8 S^2)"
    )
    subdivision: Annotated[int, Field(ge=0, le=6)] = Field(2, description="how often subdivision surfaces are refined")
    cull_back_faces: bool = Field(False, description="whether camera rays pass the back faces of single-sided objects")
    anisotropy: Annotated[int, Field(ge=1, le=16)] = Field(16, description="most taps of a texture look-up; 1: trilinear")
    normal_variance: bool = Field(True, description="what a filtered normal map lost in length becomes roughness (Toksvig)")
    mask_coverage: bool = Field(True, description="coarse levels of alpha masks keep the finest level's coverage")
    mip_bias_offset: Annotated[float, Field(ge=-8, le=8)] = Field(0.0, description="added to -log2(S)")
    brdf_model: Visibility = Field("separable_smith", description="Smith term of the model that shades and its table")
    roughness_mapping: RoughnessMapping = Field("squared", description="alpha of a roughness r: r^2 or r")
    brdf_table: Annotated[int, Field(ge=8, le=2048)] = Field(512, description="nodes per axis of the A, B table")
    demodulation: Literal["max", "softplus"] = Field("max", description="how F_beta is kept above 0 in a divisor")
    brdf_floor: Annotated[float, Field(ge=1e-6, le=1)] = Field(1e-3, description="max: the least F_beta to divide by")
    softplus_beta: Annotated[float, Field(ge=1e-3, le=1e6)] = Field(
        100.0, description="softplus: divide by log(1 + exp(beta F_beta)) / beta (FuseSR: 100)"
    )
    motion_offsets: tuple[Annotated[int, Field(ge=-64, le=64)], ...] = Field(
        (), description="further frame offsets of motion: -2 gives motion_m2, 1 gives motion_p1"
    )
    channels: Literal["needed", "all"] | tuple[str, ...] = Field("needed", description="which channels are files")
    color_precision: Literal["half", "float"] = Field("half", description="dtype of colour, emission and brdf")
    seed: Annotated[int, Field(ge=0, lt=2**32)] = Field(0, description="seed of the light paths (path)")

    @model_validator(mode="before")
    @classmethod
    def _enhanced_has_its_own_count(cls, values):
        if isinstance(values, dict) and values.get("antialiasing_pattern") == "qrisp_enhanced":
            return {"antialiasing": ENHANCED_SAMPLES} | values
        return values

    @model_validator(mode="after")
    def _consistent(self) -> "RenderPlan":
        if not isinstance(self.channels, str):
            if not self.channels:
                raise ValueError("channels: name at least one")
            known = [channel.name for channel in channels_with(self.motion_offsets)]
            unknown = [name for name in self.channels if name not in known]
            if unknown:
                raise ValueError(f"channels: unknown {unknown[0]!r}; known are {', '.join(known)}")
        if {-1, 0} & set(self.motion_offsets) or len(set(self.motion_offsets)) != len(self.motion_offsets):
            raise ValueError("motion_offsets: each but -1 (always there) and 0, and once")
        for what, values in (("scales", self.scales), ("variants", self.variants)):
            if len(set(values)) != len(values):
                raise ValueError(f"{what}: {values} names one value twice")
        if self.antialiasing_pattern == "qrisp_enhanced" and self.antialiasing != ENHANCED_SAMPLES:
            raise ValueError(f"antialiasing: qrisp_enhanced has {ENHANCED_SAMPLES} samples, not {self.antialiasing}")
        names = [stream.name for stream in plan_streams(self)]
        twins = sorted({name for name in names if names.count(name) > 1})
        if twins:
            raise ValueError(f"scales and variants give two streams the name {twins[0]!r}")
        return self


# Keys that say which streams exist; all others decide the pixels of every stream.
STREAM_KEYS = frozenset({"scales", "variants", "hr_native", "hr_mip0"})


def make_plan(values: dict, *, file: str | Path | None = None) -> RenderPlan:
    """Validate `values`. Raises InputError that names the field."""
    try:
        return RenderPlan.model_validate(values)
    except ValidationError as error:
        first = error.errors()[0]
        field = ".".join(str(part) for part in first["loc"]) or None
        problem = first["msg"].removeprefix("Value error, ")
        got = f" (got {first['input']!r:.80})" if field else ""
        raise InputError(f"{problem}{got}", file=file or "plan", field=field) from None


def read_plan(file: Path) -> dict:
    """The keys of a plan file, unchecked: options on the command line go over them before `make_plan`."""
    try:
        values = json.loads(file.read_text())
    except OSError as error:
        raise InputError(error.strerror or "cannot be read", file=file) from None
    except (ValueError, RecursionError) as error:
        raise InputError(f"not JSON: {error}", file=file) from None
    if not isinstance(values, dict):
        raise InputError("a plan is a JSON object", file=file)
    return values


def plan_streams(plan: RenderPlan) -> tuple[Stream, ...]:
    """The streams of a plan, HR first."""
    samples, pattern = plan.antialiasing, plan.antialiasing_pattern
    bias = truth_mip_bias(samples, pattern)
    truth = Stream(name="hr", size=plan.display, samples=samples, mip_bias=bias, pattern=pattern)
    others = [Stream(name="hr_native", size=plan.display)] if plan.hr_native else []
    others += [replace(truth, name="hr_mip0", mip_bias=0.0)] if plan.hr_mip0 else []
    return (truth, *others, *(_lr_stream(plan, scale, variant) for scale in plan.scales for variant in plan.variants))


def brdf_model(plan: RenderPlan) -> BrdfModel:
    return BrdfModel(plan.brdf_model, plan.roughness_mapping)


def jitter_length(plan: RenderPlan, scale: float) -> int:
    return plan.jitter_length or default_length(scale)


def _lr_stream(plan: RenderPlan, scale: float, variant: LrVariant) -> Stream:
    jittered, mip = variant.startswith("jittered"), variant.endswith("mip")
    bias = default_mip_bias(scale, plan.mip_bias_offset) if mip else 0.0
    return Stream(
        name=lr_stream_name(scale, jittered=jittered, mip_bias=bias),
        size=lr_size(plan.display, scale),
        scale=scale,
        jittered=jittered,
        mip_bias=bias,
    )
