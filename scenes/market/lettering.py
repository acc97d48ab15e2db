"""Images with something to read or to look into: the neon sign, a painted gable, a slate, lit shop windows."""

from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFilter
from scenes.making.images import noise, save, smooth

LETTERS = {
    "M": [[(0, 1), (0, 0), (0.5, 0.6), (1, 0), (1, 1)]],
    "A": [[(0, 1), (0.5, 0), (1, 1)], [(0.2, 0.64), (0.8, 0.64)]],
    "B": [
        [(0, 0), (0, 1)],
        [(0, 0), (0.65, 0), (0.85, 0.12), (0.85, 0.36), (0.65, 0.48), (0, 0.48)],
        [(0.65, 0.48), (0.95, 0.62), (0.95, 0.86), (0.7, 1), (0, 1)],
    ],
    "Y": [[(0, 0), (0.5, 0.5), (1, 0)], [(0.5, 0.5), (0.5, 1)]],
    "R": [[(0, 1), (0, 0), (0.7, 0), (0.95, 0.13), (0.95, 0.37), (0.7, 0.5), (0, 0.5)], [(0.5, 0.5), (1, 1)]],
    "K": [[(0, 0), (0, 1)], [(0.95, 0), (0.05, 0.55)], [(0.35, 0.4), (1, 1)]],
    "E": [[(1, 0), (0, 0), (0, 1), (1, 1)], [(0, 0.5), (0.8, 0.5)]],
    "T": [[(0, 0), (1, 0)], [(0.5, 0), (0.5, 1)]],
}


def sign(folder: Path) -> None:
    """A neon sign: tubes with a halo, as radiance / 8 (the material scales it)."""
    tubes = [Image.new("L", (2048, 512)) for _ in range(2)]
    pen = ImageDraw.Draw(tubes[0])
    for k, letter in enumerate("MARKET"):
        for stroke in LETTERS[letter]:
            points = [(230 + 278 * k + 190 * x, 135 + 242 * y) for x, y in stroke]
            pen.line(points, fill=255, width=26, joint="curve")
            for x, y in (points[0], points[-1]):
                pen.ellipse((x - 13, y - 13, x + 13, y + 13), fill=255)
    ImageDraw.Draw(tubes[1]).rounded_rectangle((60, 50, 1988, 462), 120, outline=255, width=22)
    total = np.zeros((128, 512, 3))
    for tube, colour in zip(tubes, ((1.0, 0.16, 0.07), (0.08, 0.55, 0.75)), strict=True):
        line = tube.resize((512, 128), Image.Resampling.BOX)
        halo = np.asarray(line.filter(ImageFilter.GaussianBlur(7)), float) / 255
        core = np.asarray(line, float) / 255
        total += (0.85 * core**2 + 0.16 * halo)[..., None] * np.array(colour) + 0.1 * core[..., None] ** 4
    save(folder, "sign", total, colours=128)


def lettering(folder: Path) -> None:
    """A baker's name painted on a gable long ago, alpha cut at 0.5; and a slate with the day's dishes."""
    pen_image = Image.new("L", (2048, 512))
    pen = ImageDraw.Draw(pen_image)
    for k, letter in enumerate("BAKERY"):
        for stroke in LETTERS[letter]:
            points = [(120 + 316 * k + 200 * x, 120 + 270 * y) for x, y in stroke]
            pen.line(points, fill=255, width=58, joint="curve")
    pen.rectangle((20, 20, 2027, 491), outline=255, width=20)
    letters = np.asarray(pen_image.resize((512, 128), Image.Resampling.BOX), float) / 255
    wear = noise(128, 512, 0.9, 56, low=3)
    alpha = letters * smooth(-1.5, -0.5, wear)
    colour = np.array([0.13, 0.2, 0.3]) * (1 + 0.05 * wear.round())[..., None]
    save(folder, "painted", np.concatenate([colour * 30 // 1 / 30, (alpha * 7).round()[..., None] / 7], axis=-1))
    board = Image.new("L", (512, 768), 14)
    pen, rng = ImageDraw.Draw(board), np.random.default_rng(57)
    for k, letter in enumerate("TEA"):
        for stroke in LETTERS[letter]:
            pen.line([(120 + 105 * k + 70 * x, 60 + 90 * y) for x, y in stroke], fill=170, width=13, joint="curve")
    for line in range(7):
        x, y = 60, 230 + 68 * line
        while x < 340:
            word = rng.uniform(40, 110)
            steps = np.arange(x, min(x + word, 350), 6)
            pen.line([(float(s), y + rng.normal(0, 9)) for s in steps], fill=int(rng.integers(90, 150)), width=7)
            x += word + 26
        pen.line([(410, y), (450, y + rng.normal(0, 4))], fill=130, width=7)
    small = np.asarray(board.resize((128, 192), Image.Resampling.BOX), float) / 255
    save(folder, "slate", small[..., None] ** 1.3 * (1 + 0.1 * noise(192, 128, 1.4, 58))[..., None] + 0.012, colours=24)


def shop(folder: Path) -> None:
    """What is behind the lit windows: shelves with jars before a wall that lamps light from above, as radiance."""
    v, u = 1 - (np.mgrid[0:192, 0:192][0] + 0.5) / 192, (np.mgrid[0:192, 0:192][1] + 0.5) / 192
    lamp = sum(np.exp(-(((u - x) / 0.22) ** 2) - ((v - 0.86) / 0.4) ** 2) for x in (0.25, 0.75))
    wall = (0.1 + 0.75 * lamp)[..., None] * np.array([0.8, 0.42, 0.16])
    rng = np.random.default_rng(53)
    for shelf in (0.06, 0.3, 0.54):
        wall *= 1 - 0.85 * (np.abs(v - shelf) < 0.012)[..., None]
        for x in np.arange(0.04, 1, 0.075):
            width, tall = rng.uniform(0.018, 0.033), rng.uniform(0.09, 0.17)
            neck = width * np.where(v - shelf < 0.7 * tall, 1, 0.45)
            jar = (np.abs(u - x) < neck) & (v > shelf) & (v < shelf + tall)
            wall = np.where(jar[..., None], wall * rng.uniform(0.1, 0.75, 3), wall)
    save(folder, "shop", wall, colours=64)


def write_lettering(folder: Path) -> None:
    sign(folder)
    lettering(folder)
    shop(folder)
