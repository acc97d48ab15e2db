"""The market's images, drawn from noise with fixed seeds: paving, brick, plaster, wood, cloth, glaze, leaves, signs."""

from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFilter
from scenes.making.images import blocks, cells, mix, noise, save, save_normal, smooth


def paving(folder: Path) -> None:
    size = 1024
    first, second, number = cells(size, columns=33, rows=32, seed=1, jitter=0.17, arch=2.4, arches=3)
    rng = np.random.default_rng(2)
    tone, hue, tilt, worn = (rng.uniform(0, 1, 33 * 32)[number] for _ in range(4))
    rough = noise(size, size, 1.1, 3, low=3)
    stone = smooth(0.05, 0.26, second - first + 0.02 * noise(size, size, 1.2, 4, low=24))
    dome = stone * (0.75 + 0.25 * tilt) - 0.35 * first**2 * stone
    save_normal(
        folder,
        "cobbles_normal",
        dome + 0.022 * rough * stone + 0.03 * noise(size, size, 0.8, 5, low=60) * (1 - stone),
        6.5,
        44,
    )
    colour = mix((0.34, 0.29, 0.235), (0.26, 0.25, 0.245), smooth(0.35, 0.75, hue))
    colour = mix(colour, (0.36, 0.26, 0.19), 0.55 * smooth(0.86, 0.9, hue))
    colour = colour * (0.6 + 0.7 * tone)[..., None] * (1 + 0.13 * rough + 0.1 * noise(size, size, 1.8, 6))[..., None]
    joint = mix((0.085, 0.07, 0.055), (0.075, 0.085, 0.035), smooth(0.6, 1.6, noise(size, size, 1.6, 7)))
    save(folder, "cobbles", mix(joint, colour, stone), colours=48)
    half = slice(None, None, 2)
    polish = 0.52 + 0.22 * worn - 0.1 * smooth(0.3, 0, first) + 0.05 * rough
    save(
        folder,
        "cobbles_roughness",
        (np.where(stone > 0.5, polish, 0.92)[half, half] * 28).round()[..., None] / 28,
        data=True,
    )


def masonry(folder: Path) -> None:
    edge, number = blocks(512, 512, columns=10, rows=32)
    rng = np.random.default_rng(10)
    tone, hue = rng.uniform(0, 1, (2, number.max() + 1))
    grain = noise(512, 512, 0.9, 11, low=4)
    brick = smooth(0.05, 0.13, edge + 0.015 * grain)
    colour = mix((0.40, 0.155, 0.10), (0.29, 0.12, 0.095), hue[number]) * (0.7 + 0.5 * tone[number])[..., None]
    colour = mix((0.42, 0.38, 0.33), colour, brick) * (1 + 0.08 * grain + 0.08 * noise(512, 512, 2, 12))[..., None]
    save(folder, "brick", colour, colours=40)
    save_normal(folder, "brick_normal", brick * (0.8 + 0.2 * tone[number]) + 0.04 * grain, 2.2, 48)

    edge, number = blocks(512, 512, columns=4, rows=6)
    slab = smooth(0.012, 0.035, edge)
    tone = rng.uniform(0, 1, number.max() + 1)[number]
    colour = mix((0.37, 0.34, 0.3), (0.3, 0.3, 0.3), tone) * (0.85 + 0.3 * tone + 0.09 * grain)[..., None]
    save(folder, "flags", mix((0.1, 0.09, 0.08), colour, slab), colours=32)

    y = np.mgrid[0:256, 0:256][0] / 256 * 8
    edge, number = blocks(256, 256, columns=10, rows=8)
    tone, hue = rng.uniform(0, 1, (2, number.max() + 1))
    lip = smooth(0, 0.18, y % 1)
    colour = mix((0.42, 0.15, 0.075), (0.3, 0.13, 0.085), hue[number]) * (0.65 + 0.6 * tone[number])[..., None]
    save(folder, "tiles", colour * (0.35 + 0.65 * lip * smooth(0, 0.1, edge))[..., None], colours=64)
    save_normal(folder, "tiles_normal", (y % 1) * 0.7 + np.sqrt(np.clip(edge, 0, 0.5)), 5)

    blotch, grit = noise(512, 512, 1.9, 14), noise(512, 512, 0.6, 15, low=20)
    streak = noise(512, 512, 1.4, 16, stretch=0.12)  # rain runs down the wall
    save(folder, "plaster", (0.8 + 0.06 * blotch + 0.03 * grit + 0.04 * np.minimum(streak, 0.5)).round(2)[..., None])
    save_normal(folder, "plaster_normal", (0.5 * blotch + 0.22 * grit)[::2, ::2], 0.7, 32)


def crafts(folder: Path) -> None:
    ring = noise(512, 512, 1.5, 20, stretch=16, low=1)
    fibre = noise(512, 512, 0.7, 21, stretch=30, low=12)
    board = np.abs((np.arange(512) % 128) - 64) / 64
    save(
        folder,
        "wood",
        ((0.62 + 0.13 * ring + 0.09 * fibre) * (1 - 0.75 * smooth(0.955, 1, board))[:, None])[..., None],
        colours=40,
    )
    save(folder, "wood_roughness", (0.6 + 0.1 * ring - 0.05 * fibre).round(2)[::2, ::2, None], data=True)

    streaks = noise(256, 512, 0.35, 22, stretch=90, low=3)
    dents = noise(256, 512, 1.6, 23)
    save(
        folder,
        "brushed_roughness",
        np.clip(0.28 + 0.1 * streaks + 0.015 * dents, 0.08, 0.6).round(2)[..., None],
        data=True,
    )
    save_normal(folder, "brushed_normal", 0.5 * noise(256, 256, 0.2, 24, stretch=40, low=3), 0.14, 32)

    y, x = np.mgrid[0:256, 0:256]
    weave = ((x + y) % 4 < 2) * 0.05 + 0.035 * noise(256, 256, 1.2, 25)
    stripe = smooth(60, 64, np.abs(x - 128.0))[..., None]
    for name, a, b in (
        ("red", (0.52, 0.045, 0.035), (0.8, 0.75, 0.66)),
        ("blue", (0.05, 0.13, 0.34), (0.8, 0.76, 0.68)),
        ("green", (0.06, 0.24, 0.13), (0.82, 0.76, 0.6)),
    ):
        save(
            folder,
            f"canvas_{name}",
            (np.array(a) * (1 - stripe) + np.array(b) * stripe) * (0.93 + weave)[..., None],
            colours=32,
        )
    threads = np.maximum(np.sin(x * np.pi / 4), np.sin(y * np.pi / 4))
    save(folder, "burlap", (0.68 + 0.1 * threads + 0.07 * noise(256, 256, 1, 26)).round(2)[..., None])

    peel = noise(256, 256, 1.0, 27, low=6)
    save(folder, "peel", (0.78 + 0.07 * peel + 0.08 * noise(256, 256, 2, 28)).round(2)[..., None])
    ripple = np.abs(((x + 5 * noise(256, 256, 1.8, 29)) / 256 * 9) % 1 - 0.5) * 2
    save(folder, "melon", mix((0.03, 0.11, 0.03), (0.24, 0.42, 0.12), smooth(0.35, 0.75, ripple)), colours=48)
    save(folder, "ball", mix((0.62, 0.03, 0.03), (0.85, 0.82, 0.75), ((x // 32) % 2) * 1.0), colours=4)


def glaze(folder: Path) -> None:
    """White tin glaze with cobalt bands, petals and dots; u runs around the vase, v up."""
    v, u = (np.mgrid[0:512, 0:512] + 0.5) / 512
    v = 1 - v
    angle = (u * 16) % 1 - 0.5
    paint = np.zeros((512, 512))
    for low, high in ((0.06, 0.09), (0.30, 0.315), (0.335, 0.345), (0.70, 0.71), (0.735, 0.75), (0.93, 0.96)):
        paint = np.maximum(paint, smooth(low - 0.003, low, v) * smooth(high + 0.003, high, v))
    petal = np.abs(((u * 8) % 1) - 0.5) * 2 - np.sqrt(np.clip(1 - ((v - 0.52) / 0.16) ** 2, 0, 1)) * 0.8
    paint = np.maximum(paint, smooth(0.14, 0.08, np.abs(petal)) * (np.abs(v - 0.52) < 0.16))
    paint = np.maximum(paint, smooth(0.22, 0.18, np.hypot(((u * 8) % 1 - 0.5) * 1.6, (v - 0.52) / 0.11)))
    for height in (0.2, 0.83):
        paint = np.maximum(paint, smooth(0.3, 0.25, np.hypot(angle, (v - height) * 16)))
    body = mix((0.78, 0.77, 0.72), (0.03, 0.07, 0.36), paint * (0.85 + 0.1 * noise(512, 512, 1.5, 30)))
    save(folder, "glaze", body, colours=48)


def leaves(folder: Path) -> None:
    """A twig with leaves; alpha is cut at 0.5. Drawn at four times the size."""
    rng = np.random.default_rng(40)
    image = Image.new("RGBA", (2048, 2048), (52, 92, 28, 0))
    draw = ImageDraw.Draw(image)
    draw.line([(1024, 2040), (1010, 1300), (1040, 500)], fill=(92, 74, 40, 255), width=22)
    for k in range(15):
        along = k / 14
        root = np.array([1024 + rng.normal(0, 8), 1900 - 1400 * along])
        side = (-1) ** k * np.radians(28 + 42 * (1 - along) + rng.normal(0, 8)) if k < 14 else 0.0
        length, width = (560 - 120 * along) * rng.uniform(0.85, 1.1), 118 * rng.uniform(0.85, 1.1)
        forward, across = np.array([np.sin(side), -np.cos(side)]), np.array([np.cos(side), np.sin(side)])
        t = np.linspace(0, 1, 40)
        half = width * np.sin(np.pi * t**0.8) * (1 + 0.04 * np.sin(t * 60))
        spine = root + forward * (t * length)[:, None]
        green = np.array([66, 116, 36]) * rng.uniform(0.75, 1.25) + rng.normal(0, 5, 3)
        for sign, shade in ((1, 1.0), (-1, 0.82)):
            outline = np.concatenate([spine, (spine + sign * across * half[:, None])[::-1]])
            draw.polygon([tuple(p) for p in outline], fill=(*(green * shade).astype(int), 255))
        draw.line([tuple(spine[0]), tuple(spine[-1])], fill=(140, 168, 84, 255), width=9)
    small = np.asarray(image.resize((512, 512), Image.Resampling.BOX)).copy()
    small[..., :3] = np.where(small[..., 3:] > 0, small[..., :3], (52, 92, 28))
    small = np.concatenate([small[..., :3] // 8 * 8, small[..., 3:] // 16 * 17], axis=-1)
    Image.fromarray(small).save(folder / "leaves.png", optimize=True)


LETTERS = {
    "M": [[(0, 1), (0, 0), (0.5, 0.6), (1, 0), (1, 1)]],
    "A": [[(0, 1), (0.5, 0), (1, 1)], [(0.2, 0.64), (0.8, 0.64)]],
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


def write_all(folder: Path) -> None:
    folder.mkdir(exist_ok=True)
    paving(folder)
    masonry(folder)
    crafts(folder)
    glaze(folder)
    leaves(folder)
    sign(folder)
    shop(folder)
