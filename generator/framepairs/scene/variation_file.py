"""What of a scene may vary, in JSON beside the scene file: `<stem>.variation.json`. Data alone; `variation` applies it.

Ranges are [low, high]; a number is drawn evenly from them. Names are patterns of shell style (`*`, `?`, `[abc]`), case counts.
"""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from .beside import read_beside

LARGEST_FILE = 2**24  # bytes
LARGEST = 1e6


def _rising(pair: tuple[float, float]) -> tuple[float, float]:
    if pair[1] < pair[0]:
        raise ValueError(f"{pair[0]:g} to {pair[1]:g} is no range: the low end comes first")
    return pair


def _range(low: float, high: float):
    number = Annotated[float, Field(ge=low, le=high, allow_inf_nan=False)]
    return Annotated[tuple[number, number], AfterValidator(_rising)]


Share = Annotated[float, Field(ge=0, le=1)]
Shares = _range(0, 1)
Gains = _range(0, 1e4)
Angles = _range(-360, 360)
Kelvins = _range(1000, 20000)
Half = Annotated[float, Field(ge=0, le=LARGEST, allow_inf_nan=False)]
Reflectance = tuple[Share, Share, Share]
Tint = tuple[Half, Half, Half]
Names = Annotated[tuple[str, ...], Field(min_length=1)]


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Daylight(_Part):
    """The hour and the weather: a sky made from numbers and a sun that goes with it."""

    sun: str | None = Field(None, description="pattern of the one directional light that is the sun; null: a new light")
    azimuth_deg: Angles = Field((0, 360), description="of the sun, about the up axis; 0 is +z of a scene with y up, 90 is +x")
    elevation_deg: Annotated[_range(-5, 90), Field(description="of the sun above the horizon")] = (10, 60)
    turbidity: Annotated[_range(1.9, 10), Field(description="haze: 1.9 clear to 10")] = (2, 5)
    clouds: Shares = Field((0, 0.5), description="share of the sky that they cover; beyond 0.55 they dim the sun")
    gain: Gains = Field((1, 1), description="factor of sun and sky")
    adaptation: Share = Field(0, description="share (as a power) of the light lost against a clear noon that is given back")
    ground: Reflectance = Field((0.2, 0.18, 0.15), description="albedo of what lies below the horizon")


class EnvironmentRule(_Part):
    """Of the scene's own sky."""

    turn_deg: Angles = Field((0, 0), description="about the up axis; directional lights turn along")
    gain: Gains = Field((1, 1), description="factor of its radiance")
    temperature_k: Kelvins | None = Field(None, description="tint of a black body against 6500 K, at constant luminance")


class LightRule(_Part):
    """Of lights, each by itself."""

    lights: Names = Field(description="patterns of names of lights")
    temperature_k: Kelvins | None = Field(None, description="tint of a black body against 6500 K, at constant luminance")
    gain: Gains = Field((1, 1), description="factor of its radiance")
    dark: Share = Field(0, description="chance that it is switched off")


class Palette(_Part):
    """Of materials' base colour and roughness, each material by itself; hue and saturation are Oklab's."""

    materials: Names = Field(description="patterns of names of materials")
    base_color: tuple[Reflectance, ...] = Field((), description="to choose from, linear Rec. 709; multiplies a texture")
    hue_deg: Angles = Field((0, 0), description="turn of the hue, of a texture's texels too")
    saturation: Gains = Field((1, 1), description="factor of the chroma, of a texture's texels too")
    value: Gains = Field((1, 1), description="factor of the base colour, which is limited to 1")
    roughness: Gains = Field((1, 1), description="factor of the roughness, which is limited to 1")


class Glow(_Part):
    """Of materials' emission, each material by itself."""

    materials: Names = Field(description="patterns of names of materials")
    color: tuple[Tint, ...] = Field((), description="radiance to choose from, linear Rec. 709; multiplies a texture")
    hue_deg: Angles = Field((0, 0), description="turn of the hue, of a texture's texels too")
    saturation: Gains = Field((1, 1), description="factor of the chroma, of a texture's texels too")
    gain: Gains = Field((1, 1), description="factor of the radiance")
    dark: Share = Field(0, description="chance that it is switched off")


class Placement(_Part):
    """Of where groups stand. A group is everything below the first parts of a name that the pattern matches, as many as the
    pattern has between `/`; it turns and grows about the middle of its underside at time 0."""

    objects: Names = Field(description="patterns of groups")
    shift: tuple[Half, Half, Half] = Field((0, 0, 0), description="farthest along the world's axes, scene units, either way")
    turn_deg: Annotated[float, Field(ge=0, le=180)] = Field(0, description="farthest about the up axis, either way")
    scale: Annotated[_range(0.01, 100), Field(description="factor of the size")] = (1, 1)


class Absence(_Part):
    """Of which groups are there at all."""

    objects: Names = Field(description="patterns of groups, as in placement")
    share: Shares = Field(description="of the groups that are left out: they keep their object_id and have no triangles")


class Timing(_Part):
    """Of how groups move: each group has its own rate, delay and amplitude."""

    objects: Names = Field(description="patterns of groups, as in placement")
    rate: Annotated[_range(0, 100), Field(description="factor of the speed")] = (1, 1)
    delay_s: Annotated[_range(0, LARGEST), Field(description="before it begins; with cycle_s: what it lags behind")] = (0, 0)
    amplitude: Annotated[_range(0, 100), Field(description="factor of what differs from time 0")] = (1, 1)
    cycle_s: Annotated[float, Field(gt=0, le=LARGEST)] | None = Field(
        None, description="the animation starts again after so many seconds"
    )


class Variation(_Part):
    """A variation file. Unknown keys are refused. Rules of a list apply one after another."""

    version: Literal[1]
    daylight: Daylight | None = Field(None, description="the hour and the weather, instead of the scene's sky and sun")
    environment: EnvironmentRule | None = Field(None, description="the scene's own sky; not beside daylight")
    lights: tuple[LightRule, ...] = Field((), description="colour and strength of lights")
    palettes: tuple[Palette, ...] = Field((), description="colour and roughness of materials")
    emission: tuple[Glow, ...] = Field((), description="emission of materials")
    placement: tuple[Placement, ...] = Field((), description="where groups of objects stand")
    absent: tuple[Absence, ...] = Field((), description="which groups of objects are left out")
    animation: tuple[Timing, ...] = Field((), description="how groups of objects move: wind, traffic, crowds")

    @model_validator(mode="after")
    def _one_sky(self) -> "Variation":
        if self.daylight is not None and self.environment is not None:
            raise ValueError("daylight replaces the scene's environment: give one of the two")
        return self


def variation_beside(file: Path) -> Path:
    """Where the variation of a scene file would be; it may not exist."""
    return file.with_name(f"{file.stem}.variation.json")


def read_variation(file: Path) -> Variation:
    """Raises InputError naming the file and the field."""
    return read_beside(Variation, file, LARGEST_FILE)
