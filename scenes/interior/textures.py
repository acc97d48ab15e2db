"""The library's images, drawn from noise with fixed seeds: parquet, wood, leather, cloth, marble, books, rug, pictures."""

from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw
from scenes.making.images import mix, noise, save, save_normal, smooth

PLANKS = 36  # plank widths across the parquet's image
LONG = 6  # plank widths along a plank
SPINES = 32  # books in the atlas of spines, in two rows


def parquet(folder: Path) -> None:
    """Herringbone: planks of 1 by 6 that run along both axes, each with its own tone, grain, tilt and wear."""
    size = 1024
    y, x = (np.mgrid[0:size, 0:size] + 0.5) / size * PLANKS
    i, j = np.floor(x).astype(int), np.floor(y).astype(int)
    k = (i - j) % (2 * LONG)
    flat = k < LONG
    start_x = np.where(flat, i - k, i) % PLANKS
    start_y = np.where(flat, j, j - (2 * LONG - 1 - k)) % PLANKS
    number = start_y * PLANKS + start_x
    along = np.where(flat, x % 1 + k, y % 1 + 2 * LONG - 1 - k)
    across = np.where(flat, y % 1, x % 1)
    rng = np.random.default_rng(1)
    tone, hue, polish, lean, roll = rng.uniform(0, 1, (5, PLANKS * PLANKS))[:, number]
    offset = rng.integers(0, size, (2, PLANKS * PLANKS))[:, number]
    ring, fibre = noise(size, size, 1.6, 2, stretch=14), noise(size, size, 0.8, 3, stretch=26, low=10)
    pixels = size / PLANKS
    row, column = (across * pixels).astype(int) + offset[0], (along * pixels).astype(int) + offset[1]
    grain, fine = ring[row % size, column % size], fibre[row % size, column % size]
    edge = np.minimum(np.minimum(across, 1 - across), np.minimum(along, LONG - along))
    board = smooth(0.012, 0.05, edge)
    colour = mix((0.17, 0.088, 0.043), (0.1, 0.054, 0.03), hue) * (0.62 + 0.7 * tone)[..., None]
    colour *= np.clip(1 + 0.17 * grain + 0.1 * fine, 0.4, 1.6)[..., None]
    save(folder, "parquet", mix((0.02, 0.012, 0.008), colour, board), colours=28)
    worn = noise(size, size, 1.7, 4, low=2)
    rough = 0.13 + 0.08 * polish + 0.035 * worn + 0.012 * fine + 0.25 * (1 - board)
    half = slice(None, None, 2)
    save(folder, "parquet_roughness", (np.clip(rough, 0.06, 0.6)[half, half] * 64).round()[..., None] / 64, data=True)
    height = 0.8 * board + 0.45 * (lean - 0.5) * across + 0.07 * (roll - 0.5) * along + 0.006 * fine
    save_normal(folder, "parquet_normal", height, 1.1, 26)


def crafts(folder: Path) -> None:
    ring = noise(512, 512, 1.5, 10, stretch=16)
    fibre = noise(512, 512, 0.7, 11, stretch=30, low=12)
    save(folder, "walnut", mix((0.2, 0.095, 0.042), (0.085, 0.04, 0.02), smooth(-1.6, 1.6, ring + 0.5 * fibre)), colours=32)
    save(folder, "wood_roughness", (0.36 + 0.05 * ring - 0.03 * fibre).round(2)[::2, ::2, None], data=True)

    y, x = np.mgrid[0:256, 0:256]
    crackle, pores = np.abs(noise(256, 256, 1.15, 12, low=8)), noise(256, 256, 0.5, 13, low=40)
    save_normal(folder, "leather_normal", -0.6 * np.exp(-6 * crackle) + 0.05 * pores, 0.9, 40)
    worn = noise(256, 256, 1.8, 14)
    save(folder, "leather_roughness", (0.42 + 0.06 * worn + 0.06 * np.exp(-6 * crackle)).round(2)[..., None], data=True)
    rubbed = smooth(0.5, 2.2, worn + 0.3 * pores)
    crease = (1 - 0.35 * np.exp(-8 * crackle))[..., None]
    save(folder, "leather", mix((0.27, 0.075, 0.032), (0.46, 0.2, 0.09), 0.6 * rubbed) * crease, colours=32)
    save(folder, "leather_green", mix((0.035, 0.085, 0.05), (0.11, 0.16, 0.09), 0.6 * rubbed) * crease, colours=32)

    weave = np.maximum(np.sin(x * np.pi / 4), np.sin(y * np.pi / 4))
    save_normal(folder, "weave_normal", 0.35 * weave + 0.12 * noise(256, 256, 0.6, 15, low=8), 0.8, 32)
    nap = noise(256, 256, 1.3, 16, stretch=0.2)
    save(folder, "velvet", np.array([0.19, 0.03, 0.034]) * np.clip(1 + 0.16 * nap, 0.5, 1.5)[..., None], colours=24)

    vein = np.abs(noise(512, 512, 1.7, 17)) + 0.25 * np.abs(noise(512, 512, 1.2, 18, low=4))
    cloud = noise(512, 512, 1.9, 19)
    stone = mix((0.62, 0.58, 0.52), (0.5, 0.45, 0.39), smooth(-1, 1.5, cloud))
    save(folder, "marble", mix((0.26, 0.21, 0.17), stone, smooth(0.0, 0.22, vein)), colours=40)

    streaks = noise(128, 256, 0.35, 20, stretch=60, low=3) + 0.8 * noise(128, 256, 1.7, 21)
    save(folder, "brass_roughness", np.clip(0.22 + 0.06 * streaks, 0.08, 0.5).round(2)[..., None], data=True)
    blotch, grit = noise(256, 256, 1.9, 22), noise(256, 256, 0.6, 23, low=20)
    save(folder, "plaster", np.array([0.72, 0.66, 0.55]) * (1 + 0.05 * blotch + 0.02 * grit)[..., None], colours=24)
    save_normal(folder, "plaster_normal", 0.5 * blotch + 0.15 * grit, 0.5, 24)
    soot = smooth(-1, 1.5, noise(128, 256, 1.5, 24))
    rows, columns = np.mgrid[0:128, 0:256]
    course = rows // 16
    brick = np.minimum((rows % 16) / 2, np.minimum(((columns + 16 * (course % 2)) % 32) / 2, 1))
    save(folder, "soot", mix((0.02, 0.016, 0.014), (0.13, 0.07, 0.05), np.clip(brick, 0.3, 1) * (1 - 0.7 * soot)), colours=24)


def wallpaper(folder: Path) -> None:
    """Damask: a mirrored motif that repeats, a shade lighter than its ground."""
    half = noise(256, 128, 1.5, 30, low=2)
    motif = np.concatenate([half, half[:, ::-1]], axis=1)
    v, u = (np.mgrid[0:256, 0:256] + 0.5) / 256
    x, y = 2 * np.pi * (u - 0.5), 2 * np.pi * (v - 0.5)
    petal = np.cos(x) * np.cos(y) + 0.55 * np.cos(3 * x) * np.cos(y) + 0.5 * np.cos(2 * x) * np.cos(4 * y) + 0.4 * np.cos(y * 3)
    figure = smooth(-0.1, 0.1, np.sin(3.4 * petal + 0.6) + 0.1 * motif)
    dirt = noise(256, 256, 1.8, 31)
    colour = mix((0.036, 0.082, 0.078), (0.062, 0.125, 0.112), figure) * (1 + 0.07 * dirt)[..., None]
    save(folder, "damask", colour, colours=24)
    save(folder, "damask_roughness", (0.8 - 0.28 * figure).round(2)[..., None], data=True)


def books(folder: Path) -> None:
    """Spines in two rows of 32, each with bands, title panel and gilt; the last cell of each row is cut paper."""
    rng = np.random.default_rng(40)
    wide, tall = 16, 160
    image = np.zeros((2 * tall, SPINES * wide, 3))
    gilt = np.zeros((2 * tall, SPINES * wide))
    palette = np.array(
        [(0.2, 0.045, 0.03), (0.05, 0.1, 0.06), (0.045, 0.06, 0.13), (0.24, 0.14, 0.06), (0.09, 0.045, 0.025),
         (0.3, 0.22, 0.12), (0.035, 0.03, 0.03), (0.14, 0.03, 0.06), (0.42, 0.36, 0.25), (0.06, 0.12, 0.14)]
    )  # fmt: skip
    for row in range(2):
        for column in range(SPINES):
            cloth = palette[rng.integers(len(palette))] * rng.uniform(0.75, 1.25)
            cell = np.tile(cloth, (tall, wide, 1))
            gold = np.zeros(tall)
            style = rng.integers(4)
            if style in (0, 3):
                for at in rng.permutation([12, 40, 70, 100, 126, 146])[: rng.integers(2, 6)]:
                    gold[at : at + 2] = 1
            if style in (1, 3):
                low = rng.integers(16, 60)
                cell[low : low + rng.integers(20, 40)] = palette[rng.integers(len(palette))] * 0.8
                gold[[low - 2, low - 1, low + 41, low + 42]] = 1
            letters = np.zeros((tall, wide))
            begin, end = sorted(rng.integers(20, 130, 2))
            letters[begin:end:2, 6:11] = rng.uniform(0, 1, (len(range(begin, end, 2)), 5)) > 0.45
            shine = np.maximum(gold[:, None], letters * (style > 0))
            cell = cell * (1 - shine[..., None]) + np.array([0.55, 0.38, 0.13]) * shine[..., None]
            rub = np.abs(np.linspace(-1, 1, tall))[:, None] ** 8 * 0.5 + rng.normal(0, 0.05, (tall, wide))
            cell = cell * (1 + 0.9 * np.clip(rub, -0.2, 1))[..., None]
            if column == SPINES - 1:
                cell = np.array([0.55, 0.46, 0.31]) * (0.8 + 0.25 * rng.uniform(0, 1, (tall, wide)))[..., None]
                shine = np.zeros((tall, wide))
            place = slice(row * tall, (row + 1) * tall), slice(column * wide, (column + 1) * wide)
            image[place], gilt[place] = cell, shine
    save(folder, "spines", image, colours=96)
    save(folder, "spines_roughness", (0.62 - 0.3 * gilt).round(2)[..., None], data=True)


def rug(folder: Path) -> None:
    """A knotted rug: borders around a field with a medallion, mirrored both ways; half of it is drawn."""
    height, width = 384, 512
    v, u = np.abs((np.mgrid[0:height, 0:width] + 0.5) / np.array([height, width])[:, None, None] - 0.5) * 2
    edge = np.minimum((1 - v) * 3, (1 - u) * 4)  # distance to the border in quarters of a metre or so
    quarter = noise(height // 2, width // 2, 1.25, 50, low=5)
    leaf = np.block([[quarter[::-1, ::-1], quarter[::-1]], [quarter[:, ::-1], quarter]])
    red, navy, cream, gold = (0.3, 0.035, 0.028), (0.028, 0.04, 0.1), (0.5, 0.42, 0.29), (0.4, 0.23, 0.07)
    colour = mix(red, navy, smooth(0.35, 0.42, leaf))
    colour = mix(colour, cream, smooth(1.15, 1.2, leaf) + smooth(-1.35, -1.4, leaf))
    reach = np.hypot(u * 1.15, v) + 0.05 * np.cos(12 * np.arctan2(v, u * 1.3))
    for radius, inner in ((0.62, navy), (0.56, cream), (0.53, red), (0.3, gold), (0.27, navy), (0.1, cream)):
        colour = mix(colour, mix(inner, gold, smooth(0.85, 0.95, np.abs(leaf))), smooth(radius + 0.008, radius, reach))
    along = np.where((1 - v) * 3 < (1 - u) * 4, u * 4, v * 3)
    wave = np.abs((along * 4 + 0.25) % 1 - 0.5) * 2
    for outer, ground, figure in (
        (0.62, navy, cream),
        (0.55, gold, gold),
        (0.51, navy, cream),
        (0.17, gold, red),
        (0.1, red, navy),
    ):
        band = mix(ground, figure, smooth(0.1, 0.0, np.abs(wave - 0.5 - 0.8 * (edge - 0.34)) - 0.14))
        colour = mix(colour, band, smooth(outer, outer - 0.012, edge))
    knots = 1 + 0.12 * noise(height, width, 0.3, 51, low=20) + 0.09 * noise(height, width, 1.6, 52, stretch=6)
    save(folder, "rug", colour * np.clip(knots, 0.5, 1.5)[..., None], colours=40)


def pictures(folder: Path) -> None:
    """Landscapes in oil: sky, hills and water, three beside each other."""
    panels = []
    for seed, (sky, glow, land) in enumerate(
        (
            ((0.12, 0.2, 0.3), (0.75, 0.5, 0.25), (0.07, 0.09, 0.04)),
            ((0.3, 0.34, 0.36), (0.7, 0.62, 0.45), (0.12, 0.1, 0.05)),
            ((0.05, 0.09, 0.17), (0.5, 0.42, 0.3), (0.035, 0.05, 0.045)),
        )
    ):
        v, u = (np.mgrid[0:192, 0:256] + 0.5) / np.array([192, 256])[:, None, None]
        stroke = noise(192, 256, 1.2, 60 + seed, stretch=3)
        picture = mix(sky, glow, np.clip(smooth(0.05, 0.6, v) + 0.12 * stroke, 0, 1))
        picture = mix(picture, glow, smooth(0.5, 1.8, noise(192, 256, 1.7, 70 + seed, stretch=0.5)) * smooth(0.6, 0.2, v))
        for layer in range(4):
            ridge = 0.48 + 0.1 * layer + 0.06 / (1 + layer) * noise(8, 256, 1.5, 80 + 5 * seed + layer)[0]
            shade = mix(glow, land, np.full((192, 256), 0.45 + 0.18 * layer)) * (1 + 0.2 * stroke)[..., None]
            picture = mix(picture, shade, smooth(-0.006, 0.006, v - ridge[None, :]))
        panels.append(picture)
    save(folder, "pictures", np.concatenate(panels, axis=1), colours=64)


def small_things(folder: Path) -> None:
    """Globe and clock face."""
    height, width = 192, 384
    v, u = (np.mgrid[0:height, 0:width] + 0.5) / np.array([height, width])[:, None, None]
    ground = noise(height, width, 1.75, 90, stretch=0.6) + 0.25 * noise(height, width, 1.0, 91, low=8)
    land = smooth(0.25, 0.35, ground - 0.4 * np.abs(v - 0.5))
    relief = smooth(0.2, 2.2, ground)
    colour = mix((0.16, 0.27, 0.27), mix((0.4, 0.3, 0.13), (0.3, 0.13, 0.06), relief), land)
    coast = smooth(0.5, 0.2, np.abs(land - 0.5))
    grid = np.maximum(smooth(0.06, 0.03, np.abs((u * 24) % 1 - 0.5)), smooth(0.05, 0.02, np.abs((v * 12) % 1 - 0.5)))
    colour = mix(colour, (0.1, 0.06, 0.03), np.maximum(0.6 * coast * (land > 0.02), 0.35 * grid))
    save(folder, "globe", colour * (0.85 + 0.06 * noise(height, width, 1.8, 92))[..., None], colours=40)

    face = Image.new("L", (512, 512), 230)
    pen = ImageDraw.Draw(face)
    pen.ellipse((12, 12, 500, 500), outline=40, width=8)
    for tick in range(60):
        a, inner = 2 * np.pi * tick / 60, 168 if tick % 5 == 0 else 204
        ends = [(256 + r * np.sin(a), 256 - r * np.cos(a)) for r in (inner, 222)]
        pen.line(ends, fill=25, width=16 if tick % 5 == 0 else 5)
    for a, length, width in ((5.34, 120, 16), (0.85, 185, 9)):
        pen.line([(256, 256), (256 + length * np.sin(a), 256 - length * np.cos(a))], fill=10, width=width)
    dial = np.asarray(face.resize((128, 128), Image.Resampling.BOX), float) / 255
    save(folder, "dial", dial[..., None] * np.array([0.78, 0.72, 0.58]), colours=24)


def write_all(folder: Path) -> None:
    folder.mkdir(exist_ok=True)
    for part in (parquet, crafts, wallpaper, books, rug, pictures, small_things):
        part(folder)
