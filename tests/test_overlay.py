"""Overlays: files that are refused, where elements lie, what a footprint sees of them, and how often kernels are compiled."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageFont

from analytic import at, fractions, make_scene, path_of, project, quad
from framepairs.backend import dr, mi
from framepairs.conventions import Stream
from framepairs.demodulation import Floor, demodulate, remodulate
from framepairs.errors import InputError
from framepairs.frame import Shoot
from framepairs.jitter import antialiasing_positions
from framepairs.overlay import build_layer, composited, overlay_of, overlays_around
from framepairs.overlay_elements import make_overlay, read_overlay
from framepairs.overlay_text import MOST_TEXELS
from framepairs.scene.description import Material
from test_engine import compilations

EPSILON = 2.0**-24
HALF = 2.0**-11  # texels are halves
SIZE = (48, 27)
ASPECT = SIZE[0] / SIZE[1]
LR = Stream(name="lr", size=SIZE)
# Places are fractions of the frame, rounded to EPSILON / 2 each, of which four decide a share of one of 48 pixels.
SHARE = 4 * EPSILON * SIZE[0]
HERE = {"screen": [0.5, 0.5], "size": 0.1}


@pytest.fixture
def folder(tmp_path):
    white = np.full((8, 8, 4), 255, np.uint8)
    check = (np.indices((256, 256)).sum(0) % 2 * 255).astype(np.uint8)
    for name, texels in {"white": white, "check": np.dstack([check] * 3), "clear": white * np.uint8([1, 1, 1, 0])}.items():
        Image.fromarray(texels).save(tmp_path / f"{name}.png")
    Image.fromarray(check[:1, :64]).save(tmp_path / "stripes.png")
    Image.fromarray(check[:1, :2]).save(tmp_path / "two.png")
    (tmp_path / "folder").mkdir()
    (tmp_path / "no_image.png").write_bytes(b"none")
    (tmp_path / "no_font.ttf").write_bytes(b"none")
    (tmp_path / "font.ttf").write_bytes(ImageFont.load_default(20).path.getvalue())
    return tmp_path


def overlay(folder: Path, *elements: dict):
    return make_overlay({"version": 1, "elements": elements}, file=folder / "t.overlay.json")


class Drawn:
    """Elements drawn over a scene of one quad, named `part 0`."""

    def __init__(self, folder, *elements, path=None, matrix=None, scene=None):
        self.scene = scene or make_scene((quad(1, 1), Material(name="gray"), np.eye(4) if matrix is None else matrix))
        self.shoot = Shoot(self.scene, path or path_of(np.eye(4)), ASPECT)
        self.layer = build_layer(overlay(folder, *elements), self.scene)

    def of(self, stream=LR, offset=(0.0, 0.0), frame=0):
        """Colour [height, width, 3] and alpha [height, width], float64."""
        value = overlay_of(overlays_around(self.layer, self.shoot.state(frame), stream), stream, offset)
        width, height = stream.size
        color = np.array(value.color + mi.Color3f(0 * value.alpha), dtype=float)
        return color.reshape(3, height, width).transpose(1, 2, 0), np.array(value.alpha, dtype=float).reshape(height, width)

    def centre(self, stream=LR, offset=(0.0, 0.0), frame=0):
        """Fractions of the frame [2] around which alpha lies. Exact for elements of whole pixels: their shares are tents."""
        alpha = self.of(stream, offset, frame)[1]
        places = fractions(*stream.size, offset)
        return np.array([(alpha * place).sum() / alpha.sum() for place in places])


def share_of(rectangle, stream, positions):
    """Float64 shares [height, width] of a footprint's box in a rectangle, means over positions in the pixel."""
    left, top, right, bottom = rectangle
    width, height = stream.size
    total = 0
    for px, py in positions:
        x, y = (np.arange(width) + px) / width, (np.arange(height) + py) / height
        half = [0.5 * 2.0**stream.mip_bias / extent for extent in stream.size]
        across = np.clip(np.minimum(x + half[0], right) - np.maximum(x - half[0], left), 0, None) / (2 * half[0])
        down = np.clip(np.minimum(y + half[1], bottom) - np.maximum(y - half[1], top), 0, None) / (2 * half[1])
        total = total + down[:, None] * across
    return total / len(positions)


@pytest.mark.parametrize("offset", [(0.0, 0.0), (0.31, -0.47)])
@pytest.mark.parametrize("bias", [0.0, -1.585])
def test_a_rectangle_covers_its_exact_share_of_each_footprint(folder, offset, bias):
    drawn = Drawn(folder, {"image": "white.png", "screen": [0.413, 0.557], "size": 0.371})
    half = 0.371 / 2
    rectangle = (0.413 - half / ASPECT, 0.557 - half, 0.413 + half / ASPECT, 0.557 + half)
    stream = replace(LR, mip_bias=bias)
    color, alpha = drawn.of(stream, offset)
    expected = share_of(rectangle, stream, [(0.5 - offset[0], 0.5 - offset[1])])
    assert np.abs(alpha - expected).max() < SHARE * 2.0**-bias
    assert np.abs(color - expected[..., None]).max() < SHARE * 2.0**-bias
    assert (alpha[expected > 1 - 1e-9] == 1).all() and (expected > 1 - 1e-9).sum() > 50  # nothing shines through what is opaque


def test_the_truth_is_the_mean_over_its_samples(folder):
    drawn = Drawn(folder, {"image": "white.png", "screen": [0.413, 0.557], "size": 0.371})
    stream = Stream(name="hr", size=SIZE, samples=16, mip_bias=-2.0)
    half = 0.371 / 2
    rectangle = (0.413 - half / ASPECT, 0.557 - half, 0.413 + half / ASPECT, 0.557 + half)
    alpha = drawn.of(stream)[1]
    assert np.abs(alpha - share_of(rectangle, stream, antialiasing_positions(16))).max() < 4 * SHARE
    # 16 boxes of a quarter pixel in place of one of a pixel: an edge through 1 or 2 of 16 strata, twice at a corner
    assert np.abs(alpha - share_of(rectangle, LR, [(0.5, 0.5)])).max() < 2 / 16


def test_many_elements_in_order_with_opacity_against_float64(folder):
    """Every size from far below a pixel to far beyond the frame, in all alignments, over each other."""
    random = np.random.default_rng(7)
    words = ("left top", "top", "right top", "left", "centre", "right", "left bottom", "bottom", "right bottom")
    elements, expected, clear = [], np.zeros((SIZE[1], SIZE[0])), np.ones((SIZE[1], SIZE[0]))
    offset = (-0.2, 0.4)
    for k in range(60):
        size, opacity, intensity = 10.0 ** random.uniform(-3, 0.5), random.uniform(0, 1), random.uniform(0, 3)
        x, y = random.uniform(-0.3, 1.3, 2)
        align = words[k % 9]
        elements.append(
            {"image": "white.png", "screen": [x, y], "size": size, "align": align, "opacity": opacity, "intensity": intensity}
        )
        left = x - size / ASPECT * {"left": 0, "right": 1}.get(align.split()[0], 0.5)
        top = y - size * {"top": 0, "bottom": 1}.get(align.split()[-1], 0.5)
        alpha = opacity * share_of((left, top, left + size / ASPECT, top + size), LR, [(0.5 - offset[0], 0.5 - offset[1])])
        expected = expected * (1 - alpha) + intensity * alpha
        clear = clear * (1 - alpha)
    color, alpha = Drawn(folder, *elements).of(LR, offset)
    # of 60 layers, each edge errs by a share's rounding; places beyond the frame are up to 3 and round coarser
    assert np.abs(alpha - (1 - clear)).max() < 60 * SHARE
    assert np.abs(color[..., 1] - expected).max() < 3 * 60 * SHARE


CAMERA = at(0.4, -0.2, 1.0) @ np.array([[0.8, 0, 0.6, 0], [0, 1, 0, 0], [-0.6, 0, 0.8, 0], [0, 0, 0, 1]])
TAN = math.tan(math.radians(30))


def orthographic(point: np.ndarray, height: float) -> np.ndarray:
    x, y = (np.linalg.inv(CAMERA) @ np.append(point, 1))[:2]
    return np.array([0.5 + x / (height * ASPECT), 0.5 - y / height])


@pytest.mark.parametrize("offset", [(0.0, 0.0), (0.31, -0.47)])
@pytest.mark.parametrize("far_away", [0.0, 1e6])
def test_a_world_anchor_lands_where_the_camera_sees_it(folder, offset, far_away):
    origin = np.array([far_away, -far_away, 2 * far_away])
    point = np.array([-1.5, 0.7, -3.0])
    drawn = Drawn(
        folder,
        {"image": "white.png", "world": (origin + point).tolist(), "size": 2 / 27},
        path=path_of(at(*origin) @ CAMERA),
    )
    expected = project(point, CAMERA, TAN * ASPECT, TAN)
    # a mean over the element's 9 pixels or less, each weight wrong by SHARE; a world 2e6 away has 1e-9 in float64
    assert np.abs(drawn.centre(LR, offset) - expected).max() < 9 * SHARE / SIZE[1] + 1e-8


@pytest.mark.parametrize("offset", [(0.0, 0.0), (-0.2, 0.4)])
def test_orthographic_cameras_and_shifted_lenses(folder, offset):
    point = np.array([-1.5, 0.7, -3.0])
    element = {"image": "white.png", "world": point.tolist(), "size": 2 / 27}
    keys = {"projection": "orthographic", "height": 6.0, "lens_shift": (0.05, -0.1)}
    drawn = Drawn(folder, element, path=path_of(CAMERA, **keys))
    expected = orthographic(point, 6.0) + [0.05, -0.1]
    assert np.abs(drawn.centre(LR, offset) - expected).max() < 9 * SHARE / SIZE[1]
    shifted = Drawn(folder, element, path=path_of(CAMERA, lens_shift=(0.05, -0.1)))
    expected = project(point, CAMERA, TAN * ASPECT, TAN) + [0.05, -0.1]
    assert np.abs(shifted.centre(LR, offset) - expected).max() < 9 * SHARE / SIZE[1]


def test_world_height_is_seen_at_the_anchor(folder):
    element = {"image": "white.png", "world": [0, 0, -4], "world_height": 1.5}
    assert Drawn(folder, element).of()[1].sum() == pytest.approx(
        (1.5 / (2 * 4 * TAN)) ** 2 / ASPECT * SIZE[0] * SIZE[1], rel=1e-4
    )
    path = path_of(np.eye(4), projection="orthographic", height=6.0)
    assert Drawn(folder, element, path=path).of()[1].sum() == pytest.approx((1.5 / 6) ** 2 / ASPECT * 48 * 27, rel=1e-4)


def moving(time_s: float) -> np.ndarray:
    c, s = np.cos(0.3 * time_s), np.sin(0.3 * time_s)
    return at(0.4 * time_s, -0.1 * time_s, -5) @ np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])


def test_an_object_anchor_follows_the_object_in_its_own_space(folder):
    element = {"image": "white.png", "object": "part 0", "offset": [0.3, 1.0, 0.2], "size": 2 / 27}
    drawn = Drawn(folder, element, path=path_of(*[np.eye(4)] * 4), matrix=moving)
    for frame in range(4):
        point = (moving(frame) @ [0.3, 1.0, 0.2, 1])[:3]
        assert np.abs(drawn.centre(frame=frame) - project(point, np.eye(4), TAN * ASPECT, TAN)).max() < 9 * SHARE / SIZE[1]


def test_labels_of_hidden_objects_are_not_drawn(folder):
    scene = make_scene((quad(1, 1), Material(name="gray"), at(0, 0, -5)))
    scene = replace(scene, visible=lambda time_s: np.array([time_s < 1]))
    element = {"image": "white.png", "object": "part 0", "size": 0.2}
    drawn = Drawn(folder, element, path=path_of(np.eye(4), np.eye(4)), scene=scene)
    assert drawn.of(frame=0)[1].max() == 1 and drawn.of(frame=1)[1].max() == 0


@pytest.mark.parametrize(("z", "alpha"), [(-0.02, 1), (-0.009, 0), (0.0, 0), (5.0, 0)])
def test_what_lies_before_the_near_plane_is_not_drawn(folder, z, alpha):
    assert Drawn(folder, {"image": "white.png", "world": [0, 0, z], "size": 0.3}).of()[1].max() == alpha
    path = path_of(np.eye(4), projection="orthographic", height=6.0)
    assert Drawn(folder, {"image": "white.png", "world": [0, 0, z], "size": 0.3}, path=path).of()[1].max() == alpha


@pytest.mark.filterwarnings("error")
def test_extreme_sizes_and_places_stay_finite(folder):
    for height, z, alpha in ((1e300, -1.0, 1), (1e30, -1.0, 1), (1e30, -1e12, 1), (1e-30, -1.0, 0), (1.0, -1e300, 0)):
        color, covered = Drawn(folder, {"image": "check.png", "world": [0, 0, z], "world_height": height}).of()
        assert np.isfinite(color).all() and (covered == alpha).all(), (height, z)
    color, covered = Drawn(folder, {"image": "white.png", "world": [1e300, -1e300, -1.0], "size": 16}).of()
    assert not color.any() and not covered.any()


def test_times_are_of_the_path_and_half_open(folder):
    path = path_of(*[np.eye(4)] * 6)
    drawn = Drawn(folder, HERE | {"image": "white.png", "from_s": 2, "to_s": 4}, path=path)
    assert [drawn.of(frame=k)[1].max() for k in range(6)] == [0, 0, 1, 1, 0, 0]


def test_a_checkerboard_far_below_the_pixel_is_grey(folder):
    """256 squares over 8 pixels: their mean in linear light, also in a footprint that is wider than the element."""
    color, alpha = Drawn(folder, HERE | {"image": "check.png", "size": 8 / 27}).of()
    inside = alpha > 1 - SHARE
    assert inside.sum() >= 49
    assert np.abs(color[inside] - 0.5).max() < 0.5 * HALF
    color, alpha = Drawn(folder, HERE | {"image": "check.png", "size": 0.2 / 27}).of()
    assert np.abs(color - 0.5 * alpha[..., None]).max() < 0.5 * HALF
    assert alpha.sum() == pytest.approx(0.04, rel=1e-3)
    # 8 stripes a pixel, an eighth of a pixel high, sampled in the middle of stripes
    color, alpha = Drawn(folder, HERE | {"image": "stripes.png", "size": 1 / 8 / 27}).of(LR, (1 / 16, 0))
    inside = alpha > 1 / 8 - SHARE
    assert inside.sum() >= 7 and np.abs(color[inside] - 0.5 / 8).max() < HALF / 8


def test_edges_of_images_do_not_bleed_into_each_other(folder):
    color, _ = Drawn(folder, HERE | {"image": "two.png", "size": 9 / 27}).of()  # two texels over 18 pixels
    row = color[13, 15:33, 0]
    assert (row[:4] == 0).all() and (row[-4:] == 1).all() and (np.diff(row) >= 0).all()


def test_what_is_transparent_has_no_colour(folder):
    color, alpha = Drawn(folder, HERE | {"image": "clear.png"}).of()
    assert not color.any() and not alpha.any()


def test_white_is_white_after_exposure(folder):
    drawn = Drawn(folder, HERE | {"image": "white.png", "intensity": 2.5}, path=path_of(np.eye(4), exposure_ev=-3))
    assert drawn.of()[0].max() * 2.0**-3 == 2.5


def pixel_means(picture, rectangle, steps=16):
    """Float64 means [height, width] over each pixel of the bilinear alpha of a picture in a rectangle."""
    left, top, right, bottom = rectangle
    alpha = picture.texels[..., 3].astype(float)
    x, y = fractions(SIZE[0] * steps, SIZE[1] * steps)
    u, v = (x - left) / (right - left), (y - top) / (bottom - top)
    column, row = u * alpha.shape[1] - 0.5, v * alpha.shape[0] - 0.5
    i, j = np.floor(column).astype(int), np.floor(row).astype(int)
    total = 0
    for di, dj in ((0, 0), (1, 0), (0, 1), (1, 1)):
        weight = (column - i if di else 1 - (column - i)) * (row - j if dj else 1 - (row - j))
        clipped = alpha[np.clip(j + dj, 0, alpha.shape[0] - 1), np.clip(i + di, 0, alpha.shape[1] - 1)]
        total = total + weight * clipped
    inside = (u > 0) & (u < 1) & (v > 0) & (v < 1)
    return (total * inside).reshape(SIZE[1], steps, SIZE[0], steps).mean((1, 3))


def test_text_is_drawn_and_filtered(folder):
    drawn = Drawn(folder, {"text": "jig Q", "screen": [0.5, 0.5], "size": 0.7})
    picture = drawn.layer.overlay.pictures[0]
    texel = 0.7 / picture.line
    height, width = np.array(picture.texels.shape[:2]) * texel
    box = np.array(picture.box) * texel
    left, top = 0.5 - (box[0] + box[2]) / 2 / ASPECT, 0.5 - (box[1] + box[3]) / 2
    rectangle = (left, top, left + width / ASPECT, top + height)
    reference = pixel_means(picture, rectangle)
    assert 0.03 < reference.mean() < 0.2 and reference.max() > 0.9
    truth = drawn.of(Stream(name="hr", size=SIZE, samples=64, mip_bias=-3.0))[1]
    # an edge crosses some of 64 strata (1 / 8 of a pixel wide): an eighth of a pixel at worst, a tenth of that on average
    assert np.abs(truth - reference).max() < 1 / 8 and np.abs(truth - reference).mean() < 1 / 80
    single = drawn.of()[1]
    # one trilinear sample: blurred by a tent twice as wide as a texel of its level; ink is kept
    assert np.abs(single - reference).mean() < 0.05
    assert single.sum() == pytest.approx(reference.sum(), rel=0.02)


def test_margins_of_text_are_clear_and_lines_stand_under_each_other(folder):
    for text in ("Agj\nAgj", "f", "_W_"):
        for outline in ({}, {"outline": {"width": 0.2}}):
            alpha = overlay(folder, HERE | {"text": text} | outline).pictures[0].texels[..., 3]
            assert not alpha[[0, -1]].any() and not alpha[:, [0, -1]].any() and alpha.max() == 1
    picture = overlay(folder, HERE | {"text": "Agj\nAgj"}).pictures[0]
    top, line = picture.box[1], int(picture.line)
    first, second = picture.texels[top : top + line], picture.texels[top + line : top + 2 * line]
    assert first[..., 3].any() and np.array_equal(first, second) and picture.box[3] == top + 2 * line


@pytest.mark.parametrize(("align", "share"), [("left", 0), ("centre", 0.5), ("right", 1), ("right top", 1), ("bottom", 0.5)])
def test_lines_are_flush_where_the_text_hangs(folder, align, share):
    picture = overlay(folder, HERE | {"text": "HHHHHH\nH", "align": align}).pictures[0]
    top, line = picture.box[1], int(picture.line)
    (begin, end), (left, right) = (
        np.flatnonzero(picture.texels[top + k * line : top + (k + 1) * line, :, 3].any(0))[[0, -1]] for k in (0, 1)
    )
    assert left == pytest.approx(begin + share * (end - begin - (right - left)), abs=2)  # starts are between texels


def test_background_outline_and_letters_lie_over_each_other(folder):
    element = HERE | {
        "text": "H",
        "color": "#ff0000",
        "outline": {"color": "#00ff00", "width": 0.1},
        "background": {"color": "#0000ff", "opacity": 0.25, "padding": 0.5},
    }
    picture = overlay(folder, element).pictures[0]
    texels = picture.texels.reshape(-1, 4).astype(float)
    for color in ((1, 0, 0, 1), (0, 1, 0, 1), (0, 0, 0.25, 0.25)):
        assert (np.abs(texels - color).max(-1) == 0).sum() > 100, color
    left, top, right, bottom = picture.box
    assert picture.texels[top, left, 3] == 0.25 and bottom - top == picture.line + 2 * round(0.5 * picture.line)


def test_letters_are_set_in_the_font_that_is_named(folder):
    plain, named = overlay(folder, HERE | {"text": "Abc"}, HERE | {"text": "Abc", "font": "font.ttf"}).pictures
    assert np.array_equal(plain.texels, named.texels)  # the file holds Pillow's own font


def test_equal_looks_share_a_picture_and_files_are_listed_once(folder):
    image, text = {"image": "white.png"}, {"text": "a", "font": "font.ttf"}
    found = overlay(
        folder, HERE | image, HERE | text, HERE | image | {"opacity": 0.5}, HERE | text, HERE | text | {"size": 0.3}
    )
    assert found.picture == (0, 1, 0, 1, 2) and len(found.pictures) == 3
    assert found.files == (folder / "t.overlay.json", (folder / "white.png").resolve(), (folder / "font.ttf").resolve())


def test_long_texts_are_drawn_smaller(folder):
    picture = overlay(folder, HERE | {"text": "m" * 4096}).pictures[0]
    assert picture.texels.size / 4 <= MOST_TEXELS
    assert overlay(folder, HERE | {"text": "m", "size": 16}).pictures[0].line < 1024
    many = overlay(folder, *(HERE | {"text": f"Label number {k}", "size": 0.3} for k in range(300)))  # 400 M texels otherwise
    assert sum(picture.texels.size // 4 for picture in many.pictures) < 2**25


WRONG = {
    "text": ({"text": ""}, "elements.0.text: String should have at least 1"),
    "blank": ({"text": " \n "}, "elements.0.text: the text is blank"),
    "long": ({"text": "a" * 100_000}, "elements.0.text: String should have at most 4096"),
    "area": ({"text": "a" * 2000 + "\n" * 2000}, "elements.0.text: text of 4000 characters in 2001 lines is too long"),
    "glyph": ({"text": "caf\u00e9"}, "elements.0.text: character U+00E9 (\u00e9) is missing in the font of Pillow"),
    "font glyph": ({"text": "\u4e2d", "font": "font.ttf"}, "character U+4E2D (\u4e2d) is missing in font.ttf"),
    "control": ({"text": "a\tb"}, "elements.0.text: character U+0009 cannot be set"),
    "combining": ({"text": "q\u0301"}, "elements.0.text: character U+0301 cannot be set"),
    "right to left": ({"text": "\u05d0"}, "elements.0.text: character U+05D0 cannot be set: its script runs"),
    "both": ({"text": "a", "image": "white.png"}, "elements.0: give exactly one of text, image"),
    "no anchor": ({"text": "a", "screen": None}, "elements.0: give exactly one of screen, world, object"),
    "two sizes": ({"text": "a", "world_height": 1}, "elements.0: give exactly one of size, world_height"),
    "huge": ({"text": "a", "size": 1e30}, "elements.0.size: Input should be less than or equal to 16"),
    "not finite": ({"text": "a", "world": [0, 0, float("nan")]}, "elements.0.world.2: Input should be a finite number"),
    "screen height": ({"text": "a", "size": None, "world_height": 1}, "elements.0: world_height needs an anchor in the world"),
    "offset": ({"text": "a", "offset": [0, 1, 0]}, "elements.0: offset needs an object"),
    "times": ({"text": "a", "from_s": 2, "to_s": 2}, "elements.0: to_s must be greater than from_s"),
    "text key": ({"image": "white.png", "color": "#ffffff"}, "elements.0: color is of texts"),
    "color": ({"text": "a", "color": "white"}, "elements.0.color: String should match pattern"),
    "align": ({"text": "a", "align": "center"}, "elements.0.align: Input should be 'left top'"),
    "unknown": ({"text": "a", "depth": 1}, "elements.0.depth: Extra inputs are not permitted"),
    "outside": ({"image": "../white.png"}, "elements.0.image: ../white.png lies outside the scene's folder"),
    "outside font": ({"text": "a", "font": "/etc/hostname"}, "elements.0.font: /etc/hostname lies outside"),
    "folder": ({"image": "folder"}, "elements.0.image: folder is no plain file"),
    "missing": ({"image": "none.png"}, "No such file or directory"),
    "no image": ({"image": "no_image.png"}, "no_image.png: cannot be read as an image"),
    "no font": ({"text": "a", "font": "no_font.ttf"}, "no_font.ttf: cannot be read as a font"),
}


@pytest.mark.parametrize("what", WRONG)
def test_wrong_files_are_refused_in_one_line(folder, what):
    element, message = WRONG[what]
    file = folder / "wrong.overlay.json"
    file.write_text(json.dumps({"version": 1, "elements": [HERE | element]}))
    with pytest.raises(InputError) as caught:
        read_overlay(file)
    assert message in str(caught.value) and str(folder) in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize("text", ["{", "[" * 100_000, "[]", '{"version": 2, "elements": []}', '{"version": 1}'])
def test_what_is_no_overlay_file_is_refused(folder, text):
    (folder / "wrong.overlay.json").write_text(text)
    with pytest.raises(InputError, match="wrong.overlay.json"):
        read_overlay(folder / "wrong.overlay.json")
    with pytest.raises(InputError, match="nowhere"):
        read_overlay(folder / "nowhere.overlay.json")


def test_sixteen_bits_and_too_many_texels_are_refused(folder, monkeypatch):
    Image.fromarray(np.zeros((4, 4), np.uint16)).save(folder / "deep.png")
    with pytest.raises(InputError, match="8 bits a component"):
        overlay(folder, HERE | {"image": "deep.png"})
    monkeypatch.setattr("framepairs.overlay_elements.MOST_TEXELS", 100)
    with pytest.raises(InputError, match="elements.1: needs .* texels with the elements before it; 100 are the most"):
        overlay(folder, HERE | {"image": "white.png"}, HERE | {"text": "a"})
    with pytest.raises(InputError, match="check.png: 256 x 256 texels; 100 are the most"):
        overlay(folder, HERE | {"image": "check.png"})


def test_objects_are_named_once(folder):
    part = (quad(1, 1), Material(name="gray"), np.eye(4))
    scene = make_scene(part, part)
    for objects, many in ((scene.objects, "no object"), ((replace(scene.objects[0], name="who"),) * 2, "2 objects")):
        with pytest.raises(InputError, match=f"elements.0.object: the scene has {many} named 'who'"):
            build_layer(overlay(folder, {"text": "a", "object": "who", "size": 0.1}), replace(scene, objects=objects))


def test_lighting_under_an_overlay_comes_back(folder):
    """`emission` and `brdf` know nothing of overlays: the identity of demodulation holds for the composited colour."""
    drawn = Drawn(folder, HERE | {"image": "check.png", "size": 0.3, "opacity": 0.75})
    table = overlays_around(drawn.layer, drawn.shoot.state(0), LR)
    scene = (0.2, 0.4, 0.8)
    color = np.array(composited(mi.Color3f(*scene), overlay_of(table, LR, (0.0, 0.0))), dtype=np.float32).T
    alpha = drawn.of()[1].reshape(-1, 1)
    assert np.abs(color - (alpha * 0.5 + (1 - alpha) * scene)).max() < HALF and {0.0, 0.75} < set(alpha.ravel())
    emission, f_beta, floor = np.full_like(color, 0.05), np.full_like(color, 0.3), Floor()
    back = remodulate(demodulate(color, emission, f_beta, floor), emission, f_beta, floor)
    assert np.abs(back - color).max() < 8 * EPSILON


def test_an_empty_overlay_draws_nothing(folder):
    color, alpha = Drawn(folder).of()
    assert not color.any() and not alpha.any()


def test_no_kernel_is_compiled_after_the_first_frame(folder):
    """Elements come and go, move and hide; the truth and LR at two scales."""
    elements = [
        HERE | {"text": "score", "to_s": 2},
        HERE | {"image": "white.png", "from_s": 3},
        {"text": "who", "object": "part 0", "world_height": 0.4},
        {"text": "there", "world": [3.5, 0, -4], "size": 0.05},
    ]
    drawn = Drawn(folder, *elements, path=path_of(*[at(k, 0, 0) for k in range(6)]), matrix=moving)
    truth = Stream(name="hr", size=SIZE, samples=4, mip_bias=-1.0)
    counts = []
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        for frame in range(6):
            dr.kernel_history_clear()
            for stream, offset in ((truth, (0, 0)), (LR, (0.1 * frame, 0.2)), (replace(LR, size=(32 + frame, 18)), (0.3, 0.1))):
                value = overlay_of(overlays_around(drawn.layer, drawn.shoot.state(frame), stream), stream, offset)
                dr.eval(value.color, value.alpha)
            counts.append(compilations(dr.kernel_history()))
    assert counts[1:] == [0, 0, 0, 0, 0], counts
