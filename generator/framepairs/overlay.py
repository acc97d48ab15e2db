"""The overlay: elements composited over a frame's colour, without depth or motion.

All that a footprint covers is weighed: its share that lies inside an element's rectangle is exact, and the element's texels
are filtered like any texture, by the footprint and the stream's mip bias. Colours are meant for the display, as user
interfaces are: white has the radiance intensity * 2^-exposure_ev, which is `intensity` after exposure in every frame.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .backend import dr, mi, opaque
from .conventions import Stream
from .frame import FrameState
from .jitter import antialiasing_positions
from .overlay_elements import Element, Overlay, anchored_objects, is_shown
from .overlay_text import Picture
from .scene.description import SceneDescription, Texture
from .textures import TextureTable, build_textures, sample_texture

CELLS = 64  # per axis: which elements a part of the frame sees
SLACK = 1e-5  # fractions of the frame by which an element's cells reach further than its rectangle, for rounding
FARTHEST = 1e30  # fractions of the frame at which an element ends: a float32 whose sums are finite

Rectangle = tuple[float, float, float, float]


@dataclass(frozen=True)
class OverlayLayer:
    """An overlay on the device, for all frames. objects: per element the object that it hangs at, or -1."""

    overlay: Overlay
    objects: tuple[int, ...]
    textures: TextureTable
    picture: mi.UInt32


@dataclass(frozen=True)
class OverlayTable:
    """An overlay in one stream of one frame. places: left, top, right, bottom of each element, fractions of the frame.
    weights: its opacity, and that times the radiance of white. first: where the list of a cell of the frame begins among
    `entries`, which are elements in the order of drawing; one more than there are cells. extent: of the footprint, fractions
    of the frame."""

    textures: TextureTable
    picture: mi.UInt32
    places: mi.Float
    weights: mi.Float
    first: mi.UInt32
    entries: mi.UInt32
    extent: mi.Vector2f


@dataclass(frozen=True)
class OverlayValue:
    """One sample, or the mean over a pixel's samples. color: radiance [3] times alpha. alpha: 0 to 1."""

    color: mi.Color3f
    alpha: mi.Float


def build_layer(overlay: Overlay, scene: SceneDescription) -> OverlayLayer:
    """Raises InputError where the scene lacks an object that an element hangs at."""
    clamp = ("clamp", "clamp")
    pictures = [Texture(name="overlay", texels=each.texels, srgb=False, wrap=clamp) for each in overlay.pictures]
    return OverlayLayer(
        overlay=overlay,
        objects=anchored_objects(overlay, scene),
        textures=build_textures(pictures),
        picture=_table(overlay.picture),
    )


def place_of(element: Element, picture: Picture, thing: int, frame: FrameState) -> Rectangle | None:
    """Left, top, right, bottom, fractions of the frame, in float64; None where the element is not drawn in this frame.

    thing: the object that it hangs at. Not drawn is what hangs before the near plane, at a hidden object, or at another time.
    """
    if not is_shown(element, frame.time_s):
        return None
    camera = frame.camera
    x, y, per_unit = *(element.screen or (0.0, 0.0)), 1.0
    if element.screen is None:
        point = np.array([*(element.world or element.offset), 1.0])
        if thing >= 0:
            if not frame.objects.visible[thing]:
                return None
            point = frame.objects.world_from_object[thing] @ point
        seen = camera.view_from_world @ point
        if not -seen[2] >= camera.near:
            return None
        clip = camera.clip_from_view @ seen
        x, y = 0.5 + 0.5 * clip[0] / clip[3], 0.5 - 0.5 * clip[1] / clip[3]
        per_unit = 0.5 * camera.clip_from_view[1, 1] / clip[3]
    line = element.size if element.world_height is None else element.world_height * per_unit
    down = line / picture.line  # of a texel
    right = down / camera.aspect
    across_share, down_share = _aligned(element.align)
    box = picture.box
    left = x - right * (box[0] + across_share * (box[2] - box[0]))
    top = y - down * (box[1] + down_share * (box[3] - box[1]))
    height, width = picture.texels.shape[:2]
    found = (float(left), float(top), float(left + right * width), float(top + down * height))
    return found if np.isfinite(found).all() else None


def overlays_around(layer: OverlayLayer, frame: FrameState, stream: Stream) -> OverlayTable:
    """The elements of a frame, for footprints of one pixel of a stream, wider by its mip bias."""
    overlay = layer.overlay
    parts = zip(overlay.elements, overlay.picture, layer.objects, strict=True)
    places = [place_of(element, overlay.pictures[k], thing, frame) for element, k, thing in parts]
    white = 2.0**-frame.exposure_ev
    weights = [(element.opacity, element.opacity * element.intensity * white) for element in overlay.elements]
    extent = tuple(2.0**stream.mip_bias / size for size in stream.size)
    first, entries = _cells(places, extent)
    rectangles = np.clip([place or (0.0, 0.0, 0.0, 0.0) for place in [*places, None]], -FARTHEST, FARTHEST)
    return OverlayTable(
        textures=layer.textures,
        picture=layer.picture,
        places=mi.Float(rectangles.astype(np.float32).ravel()),
        weights=mi.Float(np.array([*weights, (0, 0)], np.float32).ravel()),
        first=mi.UInt32(first),
        entries=_table(entries),
        extent=opaque(mi.Vector2f, extent),
    )


def overlay_of(table: OverlayTable, stream: Stream, offset: tuple[float, float]) -> OverlayValue:
    """The overlay of all pixels of a stream: the mean over its AA samples, or one sample at centre - J, J = `offset`."""
    width, height = stream.size
    index, columns = dr.arange(mi.UInt32, width * height), dr.opaque(mi.UInt32, width)
    i, j = mi.Float(index % columns), mi.Float(index // columns)
    positions = [(0.5 - offset[0], 0.5 - offset[1])]
    if stream.samples > 1:
        positions = antialiasing_positions(stream.samples, stream.pattern)
    flat = mi.Float(np.array([*positions, (0, 0)], dtype=np.float32).ravel())
    size = tuple(dr.opaque(mi.Float, float(extent)) for extent in stream.size)
    return _mean(table, i, j, size, flat, dr.opaque(mi.UInt32, len(positions)))


@dr.syntax
def _mean(table: OverlayTable, i: mi.Float, j: mi.Float, size, positions: mi.Float, count: mi.UInt32) -> OverlayValue:
    k, color, alpha = mi.UInt32(0), mi.Color3f(0), mi.Float(0)
    while dr.hint(k < count, exclude=[table, size]):
        place = dr.gather(mi.Point2f, positions, k)
        sample = overlay_at(table, (i + place.x) / size[0], (j + place.y) / size[1])
        color += sample.color
        alpha += sample.alpha
        k += 1
    return OverlayValue(color / mi.Float(count), alpha / mi.Float(count))


@dr.syntax
def overlay_at(table: OverlayTable, x: mi.Float, y: mi.Float) -> OverlayValue:
    """What a footprint around fraction (x, y) of the frame sees of the elements, later ones over earlier ones."""
    column, row = (dr.clip(mi.Int32(dr.floor(c * CELLS)), 0, CELLS - 1) for c in (x, y))
    cell = mi.UInt32(row * CELLS + column)
    entry, last = dr.gather(mi.UInt32, table.first, cell), dr.gather(mi.UInt32, table.first, cell + 1)
    half = 0.5 * table.extent
    color, passed = mi.Color3f(0), mi.Float(1)
    while dr.hint(entry < last, exclude=[table, half]):
        element = dr.gather(mi.UInt32, table.entries, entry)
        place = dr.gather(mi.Vector4f, table.places, element)
        weight = dr.gather(mi.Vector2f, table.weights, element)
        # How far the footprint reaches from its middle to each side before it, or the element, ends.
        left, right = dr.minimum(half.x, x - place.x), dr.minimum(half.x, place.z - x)
        top, bottom = dr.minimum(half.y, y - place.y), dr.minimum(half.y, place.w - y)
        covered = mi.Vector2f(left + right, top + bottom)
        inside = (covered.x > 0) & (covered.y > 0)
        width, height = place.z - place.x, place.w - place.y
        u, v = (x + 0.5 * (right - left) - place.x) / width, (y + 0.5 * (bottom - top) - place.y) / height
        texel = sample_texture(
            table.textures,
            dr.gather(mi.UInt32, table.picture, element),
            mi.Point2f(u, 1 - v),
            mi.Vector2f(covered.x / width, 0),
            mi.Vector2f(0, covered.y / height),
            mi.Float(0),
            inside,
        )
        share = dr.select(inside, covered.x / (2 * half.x) * (covered.y / (2 * half.y)), 0)
        hidden = share * weight.x * texel.w
        color = (1 - hidden) * color + share * weight.y * mi.Color3f(texel.x, texel.y, texel.z)
        passed *= 1 - hidden
        entry += 1
    return OverlayValue(color, 1 - passed)


def composited(color: mi.Color3f, overlay: OverlayValue) -> mi.Color3f:
    """Colour [3] under the overlay; a variance of the colour is multiplied by (1 - alpha)^2 instead."""
    return (1 - overlay.alpha) * color + overlay.color


def _aligned(align: str) -> tuple[float, float]:
    """How far across and down the aligned point lies in the element, 0 to 1."""
    words = align.split()
    return 0.5 + 0.5 * (("right" in words) - ("left" in words)), 0.5 + 0.5 * (("bottom" in words) - ("top" in words))


def _cells(places: list[Rectangle | None], extent: tuple[float, float]) -> tuple[NDArray[np.uint32], NDArray[np.uint32]]:
    """Where the list of each cell, row by row, begins, and all lists, elements in order."""
    cells, elements = [np.empty(0, np.int64)], [np.empty(0, np.int64)]
    reach = [extent[k % 2] / 2 + SLACK for k in range(4)]
    for number, place in enumerate(places):
        if place is None:
            continue
        edges = np.array(place) + np.array([-reach[0], -reach[1], reach[2], reach[3]])
        if (edges[:2] >= 1).any() or (edges[2:] < 0).any():
            continue
        left, top, right, bottom = np.clip(np.floor(edges * CELLS), 0, CELLS - 1).astype(int)
        covered = np.arange(top, bottom + 1)[:, None] * CELLS + np.arange(left, right + 1)
        cells.append(covered.ravel())
        elements.append(np.full(covered.size, number))
    cell, element = np.concatenate(cells), np.concatenate(elements)
    order = np.argsort(cell, kind="stable")
    first = np.searchsorted(cell[order], np.arange(CELLS**2 + 1))
    return first.astype(np.uint32), element[order].astype(np.uint32)


def _table(values) -> mi.UInt32:
    """Of two numbers at least: a table of one would be a constant, and its kernel another one."""
    return mi.UInt32(np.array([*values, 0, 0], np.uint32))
