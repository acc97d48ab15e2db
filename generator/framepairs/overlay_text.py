"""Text as texels: letters, outline and box composited in linear light.

Glyphs are set one after the other with the font's own kerning (Pillow's basic layout, which every build of Pillow has, so that
corpora do not depend on it). What that would set wrongly is refused: scripts from right to left, marks that combine, and
characters that the font lacks.
"""

import io
import unicodedata
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from .errors import InputError

MOST_TEXELS = 2**22  # of one text
LEAST_FONT = 16  # texels; below twice that, a font is not halved
PROBE = 32  # texels; at which characters are looked for
NO_CHARACTER = "\U0010ffff"  # a code point that is none: fonts draw it as they draw what they lack
SIDE = {"left": 0.0, "centre": 0.5, "right": 1.0}


@dataclass(frozen=True, kw_only=True)
class Picture:
    """texels: [height, width, 4], linear Rec. 709 times alpha, and alpha, 0 to 1. line: how many rows an element's `size` or
    `world_height` spans. box: left, top, right, bottom in texels of what `align` aligns; letters may overhang it."""

    texels: NDArray[np.float16]
    line: float
    box: tuple[float, float, float, float]


@dataclass(frozen=True, kw_only=True)
class Style:
    """color, outline, box: linear Rec. 709, or None for no outline or box. outline_width, padding (of the box): fractions of a
    line's height. side: where lines are flush."""

    color: tuple[float, float, float]
    outline: tuple[float, float, float] | None
    outline_width: float
    box: tuple[float, float, float] | None
    box_opacity: float
    padding: float
    side: str


def draw_text(text: str, font_file: Path | None, style: Style, font_texels: int, wanted_texels: int = MOST_TEXELS) -> Picture:
    """A picture with transparent margins, whose `box` holds the lines and the padding of the style's box.

    font_texels: wanted size of the font, halved while the picture has more than `wanted_texels` and letters can still be read.
    Raises ValueError for a text that cannot be set, or not within MOST_TEXELS, and InputError for a font file that is none.
    """
    try:
        return _drawn(unicodedata.normalize("NFC", text).split("\n"), font_file, style, font_texels, wanted_texels)
    except OSError as error:  # damaged glyphs
        raise InputError(f"cannot be read as a font: {error}", file=font_file) from None


def _drawn(lines: list[str], font_file: Path | None, style: Style, font_texels: int, wanted_texels: int) -> Picture:
    """See `draw_text`."""
    _check_characters(lines, font_file)
    while True:
        font = _font(font_file, font_texels)
        layout = _Layout.of(lines, font, style)
        texels, is_least = layout.size[0] * layout.size[1], font_texels < 2 * LEAST_FONT
        if texels <= (MOST_TEXELS if is_least else wanted_texels):
            break
        if is_least:
            characters = sum(map(len, lines)) + len(lines) - 1
            raise ValueError(f"text of {characters} characters in {len(lines)} lines is too long to be drawn")
        font_texels //= 2
    return Picture(texels=_composited(lines, font, style, layout).astype(np.float16), line=float(layout.line), box=layout.box)


@dataclass(frozen=True, kw_only=True)
class _Layout:
    """size: width, height in texels. starts: left end of each line's base line. line: its height. stroke: width of the outline.
    box: as in `Picture`."""

    size: tuple[int, int]
    starts: list[tuple[float, float]]
    line: int
    stroke: int
    box: tuple[float, float, float, float]

    @staticmethod
    def of(lines: list[str], font: ImageFont.FreeTypeFont, style: Style) -> "_Layout":
        ascent, descent = font.getmetrics()
        line = max(ascent + descent, 1)
        stroke = max(round(style.outline_width * line), 1) if style.outline else 0
        padding = round(style.padding * line)
        widths = [font.getlength(each) for each in lines]
        width, height = int(np.ceil(max(*widths, 1))), line * len(lines)
        bounds = [font.getbbox(each, anchor="ls", stroke_width=stroke) for each in lines]
        left = max(padding, stroke, *(-b[0] for b in bounds)) + 1  # a clear texel around all
        right = max(padding, stroke, *(b[2] - w for b, w in zip(bounds, widths, strict=True))) + 1
        above, below = (max(padding, stroke, *overhang) + 1 for overhang in (
            [-b[1] - ascent for b in bounds], [b[3] - descent for b in bounds]
        ))  # fmt: skip
        left, right, above, below = (int(np.ceil(margin)) for margin in (left, right, above, below))
        return _Layout(
            size=(left + width + right, above + height + below),
            starts=[(left + SIDE[style.side] * (width - w), above + ascent + k * line) for k, w in enumerate(widths)],
            line=line,
            stroke=stroke,
            box=(left - padding, above - padding, left + width + padding, above + height + padding),
        )


def _composited(lines: list[str], font, style: Style, layout: _Layout) -> NDArray[np.float32]:
    width, height = layout.size
    canvas = np.zeros((height, width, 4), np.float32)
    if style.box is not None:
        left, top, right, bottom = (int(edge) for edge in layout.box)
        canvas[top:bottom, left:right] = np.float32([*style.box, 1]) * np.float32(style.box_opacity)
    if style.outline is not None:
        _over(canvas, style.outline, _coverage(lines, font, layout, layout.stroke))
    _over(canvas, style.color, _coverage(lines, font, layout, 0))
    return canvas


def _coverage(lines: list[str], font, layout: _Layout, stroke: int) -> NDArray[np.float32]:
    """[height, width], 0 to 1, of the letters, `stroke` texels wider on all sides."""
    plane = Image.new("L", layout.size)
    pen = ImageDraw.Draw(plane)
    for place, line in zip(layout.starts, lines, strict=True):
        pen.text(place, line, fill=255, font=font, anchor="ls", stroke_width=stroke)
    return np.asarray(plane, dtype=np.float32) / np.float32(255)


def _over(canvas: NDArray[np.float32], color: tuple[float, float, float], alpha: NDArray[np.float32]) -> None:
    canvas *= 1 - alpha[..., None]
    canvas += np.float32([*color, 1]) * alpha[..., None]


def _font(file: Path | None, font_texels: int) -> ImageFont.FreeTypeFont:
    """The font at a size in texels; its lines are somewhat higher."""
    if file is None:
        return ImageFont.load_default(font_texels).font_variant(layout_engine=ImageFont.Layout.BASIC)
    try:
        data = io.BytesIO(file.read_bytes())
        return ImageFont.truetype(data, font_texels, layout_engine=ImageFont.Layout.BASIC)
    except (OSError, ValueError) as error:
        raise InputError(f"cannot be read as a font: {error}", file=file) from None


def _check_characters(lines: list[str], font_file: Path | None) -> None:
    if not any(line.strip() for line in lines):
        raise ValueError("the text is blank")
    font = _font(font_file, PROBE)
    lacking = _look(font, NO_CHARACTER)
    for character in sorted(set("".join(lines)) - {" "}):
        what = f"character U+{ord(character):04X}"
        if unicodedata.category(character) in ("Cc", "Cf", "Cs", "Mn", "Mc", "Me"):
            raise ValueError(f"{what} cannot be set: it controls or combines; use an image")
        if unicodedata.bidirectional(character) in ("R", "AL", "AN"):
            raise ValueError(f"{what} cannot be set: its script runs from right to left; use an image")
        if _look(font, character) == lacking:
            where = "the font of Pillow (ASCII alone); name a font file" if font_file is None else font_file.name
            raise ValueError(f"{what} ({character}) is missing in {where}")


def _look(font: ImageFont.FreeTypeFont, character: str) -> tuple:
    mask = font.getmask(character)
    return mask.size, bytes(mask), font.getlength(character)
