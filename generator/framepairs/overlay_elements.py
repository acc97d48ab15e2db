"""Overlay files: text and images that are drawn over the frame without depth or motion, as games draw labels and scores.

A file `*.overlay.json` lists elements in the order in which they are drawn. Each is an axis-aligned rectangle of the frame,
hung up by one of its points at a place of the frame, at a point of the world, or at a point of an object that may move. Texts
are drawn here, once, finer than any frame needs; `overlay` filters them for the pixels of each stream.
"""

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from .errors import InputError
from .overlay_text import MOST_TEXELS as MOST_TEXELS_OF_A_TEXT
from .overlay_text import Picture, Style, draw_text
from .scene.containment import Reach, reach_of, within
from .scene.description import SceneDescription, Texture
from .scene.images import linear_texels, read_image

MOST_TEXELS = 2**25  # of all pictures of a file: 256 MiB
FINE_LINES = 2880.0  # texts are drawn at the size that frames of so many lines would need,
LEAST_FONT, MOST_FONT = 64, 512  # in texels, within these,
SLACK_S = 1e-9  # seconds by which a frame's time i / fps may miss a decimal one
WORLD_FONT = 192  # and at this one where the height in the frame changes

Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Fraction = Annotated[float, Field(ge=-100, le=100)]
Share = Annotated[float, Field(ge=0, le=1)]
Hex = Annotated[str, Field(pattern="^#[0-9a-fA-F]{6}$")]
Align = Literal[
    "left top", "top", "right top", "left", "centre", "right", "left bottom", "bottom", "right bottom"
]  # fmt: skip
TEXT_KEYS = ("font", "color", "outline", "background")


class Outline(BaseModel):
    """A line around the letters."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    color: Hex = Field("#000000", description="sRGB")
    width: Annotated[float, Field(gt=0, le=0.5)] = Field(0.06, description="fraction of a line's height")


class Background(BaseModel):
    """A box behind the text."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    color: Hex = Field("#000000", description="sRGB")
    opacity: Share = Field(0.6, description="of the box alone")
    padding: Annotated[float, Field(ge=0, le=8)] = Field(0.2, description="around the text, fraction of a line's height")


class Element(BaseModel):
    """One text or image, and where it hangs: exactly one of `text` and `image`, one of `screen`, `world` and `object`, one of
    `size` and `world_height`."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    text: Annotated[str, Field(min_length=1, max_length=4096)] | None = Field(None, description="lines end with \\n")
    image: str | None = Field(None, description="file of 8 bits a component, in this file's folder")
    font: str | None = Field(None, description="TrueType or OpenType file in this file's folder; null: Pillow's own, ASCII")
    color: Hex | None = Field(None, description="of a text, sRGB; null: white")
    outline: Outline | None = Field(None, description="of a text")
    background: Background | None = Field(None, description="of a text")
    opacity: Share = Field(1.0, description="of the whole element")
    intensity: Annotated[float, Field(ge=0, le=1e4)] = Field(1.0, description="exposed radiance of white")
    screen: tuple[Fraction, Fraction] | None = Field(None, description="anchor: fractions of the frame, (0, 0) top left")
    world: tuple[Finite, Finite, Finite] | None = Field(None, description="anchor: point of the world, scene units")
    object: str | None = Field(None, description="anchor: name of an object of the scene")
    offset: tuple[Finite, Finite, Finite] = Field((0, 0, 0), description="of the anchor in the object's own space")
    align: Align = Field("centre", description="which point of the element lies at the anchor")
    size: Annotated[float, Field(gt=0, le=16)] | None = Field(
        None, description="height of a line of text, or of the image, as a fraction of the frame's height"
    )
    world_height: Positive | None = Field(None, description="the same height in scene units, seen at the anchor")
    from_s: Finite | None = Field(None, description="drawn from this time of the camera path on, seconds")
    to_s: Finite | None = Field(None, description="drawn until before this time of the camera path, seconds")

    @model_validator(mode="after")
    def _consistent(self) -> "Element":
        for names in (("text", "image"), ("screen", "world", "object"), ("size", "world_height")):
            if sum(getattr(self, name) is not None for name in names) != 1:
                raise ValueError(f"give exactly one of {', '.join(names)}")
        foreign = [name for name in TEXT_KEYS if self.image is not None and getattr(self, name) is not None]
        if foreign:
            raise ValueError(f"{foreign[0]} is of texts")
        if self.screen is not None and self.world_height is not None:
            raise ValueError("world_height needs an anchor in the world")
        if self.object is None and any(self.offset):
            raise ValueError("offset needs an object")
        if None not in (self.from_s, self.to_s) and self.to_s <= self.from_s:
            raise ValueError("to_s must be greater than from_s")
        return self


class OverlayFile(BaseModel):
    """An overlay file. Unknown keys are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    version: Literal[1]
    elements: Annotated[tuple[Element, ...], Field(max_length=1024)] = Field(description="in the order of drawing")


@dataclass(frozen=True, kw_only=True)
class Overlay:
    """A file, read. picture: index into `pictures` per element. files: all that were read, the overlay file first."""

    elements: tuple[Element, ...]
    picture: tuple[int, ...]
    pictures: tuple[Picture, ...]
    files: tuple[Path, ...]


def read_overlay(file: Path, allow_outside: bool = False) -> Overlay:
    """An overlay file with all that it names. Raises InputError that names the file and the field."""
    try:
        values = json.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(error.strerror or "cannot be read", file=file) from None
    except (ValueError, RecursionError) as error:
        raise InputError(f"not JSON: {error}", file=file) from None
    return make_overlay(values, file=file, allow_outside=allow_outside)


def make_overlay(values: object, *, file: Path, allow_outside: bool = False) -> Overlay:
    """As `read_overlay`, from the file's content; `file` says where images and fonts lie."""
    try:
        elements = OverlayFile.model_validate(values).elements
    except ValidationError as error:
        first = error.errors()[0]
        field = ".".join(str(part) for part in first["loc"]) or None
        raise InputError(first["msg"].removeprefix("Value error, "), file=file, field=field) from None
    reach = reach_of(file, allow_outside)
    files, drawn, pictures, picture = {file: None}, {}, [], []
    texels, share = 0, min(MOST_TEXELS // max(len(elements), 1), MOST_TEXELS_OF_A_TEXT)
    for number, element in enumerate(elements):
        field = f"elements.{number}"
        key = _picture_key(element)
        if key not in drawn:
            drawn[key] = len(pictures)
            pictures.append(_picture(element, reach, file, field, files, share))
            texels += pictures[-1].texels.size // 4
            if texels > MOST_TEXELS:
                problem = f"needs {texels} texels with the elements before it; {MOST_TEXELS} are the most"
                raise InputError(problem, file=file, field=field)
        picture.append(drawn[key])
    return Overlay(elements=elements, picture=tuple(picture), pictures=tuple(pictures), files=tuple(files))


def is_shown(element: Element, time_s: float) -> bool:
    """Whether the element is drawn at a time of the path."""
    begins = element.from_s is None or time_s >= element.from_s - SLACK_S
    return begins and (element.to_s is None or time_s < element.to_s - SLACK_S)


def anchored_objects(overlay: Overlay, scene: SceneDescription) -> tuple[int, ...]:
    """Per element the index of the object that it hangs at, -1 for none. Raises InputError for names that no object or more
    than one has."""
    found = []
    for number, element in enumerate(overlay.elements):
        same = [k for k, item in enumerate(scene.objects) if item.name == element.object]
        if element.object is not None and len(same) != 1:
            problem = f"the scene has {len(same) or 'no'} object{'s' * (len(same) > 1)} named {element.object[:200]!r}"
            raise InputError(problem, file=overlay.files[0], field=f"elements.{number}.object")
        found.append(same[0] if same and element.object is not None else -1)
    return tuple(found)


def _picture_key(element: Element) -> tuple:
    """What decides the texels: labels that look alike share them."""
    if element.image is not None:
        return ("image", element.image)
    side = element.align.split()[0]
    look = (element.font, element.color, element.outline, element.background)
    return ("text", element.text, *look, side if side in ("left", "right") else "centre", _font_texels(element))


def _font_texels(element: Element) -> int:
    if element.size is None:
        return WORLD_FONT
    return min(max(math.ceil(FINE_LINES * element.size), LEAST_FONT), MOST_FONT)


def _picture(element: Element, reach: Reach, file: Path, field: str, files: dict[Path, None], share: int) -> Picture:
    """The texels of an element; `files` grows by what is read. share: of all texels, what a text may take where it can."""
    if element.image is not None:
        image = within(reach, element.image, file=file, field=f"{field}.image")
        files[image] = None
        return _image_picture(image)
    font = None
    if element.font is not None:
        font = within(reach, element.font, file=file, field=f"{field}.font")
        files[font] = None
    outline, background = element.outline, element.background
    style = Style(
        color=_linear(element.color or "#ffffff"),
        outline=_linear(outline.color) if outline else None,
        outline_width=outline.width if outline else 0.0,
        box=_linear(background.color) if background else None,
        box_opacity=background.opacity if background else 0.0,
        padding=background.padding if background else 0.0,
        side=_picture_key(element)[-2],
    )
    try:
        return draw_text(element.text, font, style, _font_texels(element), share)
    except ValueError as error:
        raise InputError(str(error), file=file, field=f"{field}.text") from None


def _image_picture(image: Path) -> Picture:
    texels = read_image(image)
    height, width = texels.shape[:2]
    if texels.dtype != np.uint8:
        raise InputError("images of overlays have 8 bits a component", file=image)
    if height * width > MOST_TEXELS:
        raise InputError(f"{width} x {height} texels; {MOST_TEXELS} are the most in an overlay", file=image)
    straight = linear_texels(Texture(name=image.name, texels=texels, srgb=True))
    straight[..., :3] *= straight[..., 3:]
    return Picture(texels=straight.astype(np.float16), line=height, box=(0, 0, width, height))


def _linear(color: str) -> tuple[float, float, float]:
    """Linear Rec. 709 of #rrggbb."""
    codes = np.array([[[*bytes.fromhex(color[1:]), 255]]], np.uint8)
    return tuple(float(value) for value in linear_texels(Texture(name="color", texels=codes, srgb=True))[0, 0, :3])
