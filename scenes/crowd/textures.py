"""The square's images, drawn from noise with fixed seeds: paving, ashlar, cloth, leaves, posters, a clock, shop windows."""

from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont
from scenes.making.images import blocks, cells, mix, noise, save, save_normal, smooth


def paving(folder: Path) -> None:
    """4 m x 4 m: granite slabs of 1 m x 0.5 m in running bond between bands of small dark setts."""
    size = 1024
    edge, number = blocks(size, size, columns=4, rows=8)
    rng = np.random.default_rng(1)
    tone, hue = rng.uniform(0, 1, (2, number.max() + 1))
    grit, cloud = noise(size, size, 0.35, 2, low=40), noise(size, size, 1.7, 3)
    slab = smooth(0.008, 0.028, edge + 0.004 * noise(size, size, 1.0, 4, low=8))
    granite = mix((0.46, 0.43, 0.385), (0.37, 0.365, 0.36), hue[number]) * (0.8 + 0.36 * tone[number])[..., None]
    granite = granite * (1 + 0.05 * grit + 0.08 * cloud)[..., None]
    colour = mix((0.085, 0.075, 0.065), granite, slab)
    height = slab * (0.85 + 0.15 * tone[number]) + 0.03 * grit
    first, second, sett = cells(size, columns=40, rows=40, seed=5, jitter=0.1, arch=0.0, arches=1)
    stone = smooth(0.06, 0.24, second - first)
    dark = mix((0.125, 0.12, 0.12), (0.17, 0.15, 0.135), rng.uniform(0, 1, 1600)[sett]) * (1 + 0.12 * grit)[..., None]
    dark = mix((0.06, 0.055, 0.048), dark, stone)
    y, x = (np.mgrid[0:size, 0:size] + 0.5) / size
    band = ((y < 0.1) | (x < 0.05)).astype(float)
    colour, height = mix(colour, dark, band), np.where(band > 0, stone * 0.8 - 0.3 * first**2, height)
    for _ in range(46):  # chewing gum, trodden flat
        gx, gy, radius = rng.uniform(0, 1, 2).tolist() + [rng.uniform(0.0022, 0.0045)]
        spot = smooth(radius, radius * 0.6, np.hypot(x - gx, (y - gy) * rng.uniform(0.8, 1.25)))
        colour = mix(colour, colour * rng.choice([0.55, 1.35]), 0.8 * spot)
    save(folder, "paving", colour, colours=28)
    save_normal(
        folder, "paving_normal", (height[::2, ::2] + height[1::2, ::2] + height[::2, 1::2] + height[1::2, 1::2]) / 4, 1.9, 40
    )
    worn = 0.6 + 0.16 * tone[number] - 0.09 * smooth(-0.5, 1.5, cloud) + 0.03 * grit
    roughness = np.where(band > 0, 0.62 + 0.05 * grit, np.where(slab > 0.5, worn, 0.9))[::4, ::4]
    save(folder, "paving_roughness", (roughness * 26).round()[..., None] / 26, data=True)


def ashlar(folder: Path) -> None:
    edge, number = blocks(512, 512, columns=4, rows=8)
    rng = np.random.default_rng(10)
    tone, hue = rng.uniform(0, 1, (2, number.max() + 1))
    grain, blotch = noise(512, 512, 0.8, 11, low=6), noise(512, 512, 1.8, 12)
    streak = noise(512, 512, 1.3, 13, stretch=0.1)
    block = smooth(0.012, 0.04, edge)
    colour = mix((0.66, 0.56, 0.42), (0.6, 0.54, 0.45), hue[number]) * (0.86 + 0.22 * tone[number])[..., None]
    colour = colour * (1 + 0.04 * grain + 0.05 * blotch - 0.06 * np.maximum(streak, 0))[..., None]
    save(folder, "ashlar", mix((0.34, 0.29, 0.23), colour, block), colours=44)
    relief = block + 0.05 * grain + 0.06 * blotch
    save_normal(folder, "ashlar_normal", (relief[::2, ::2] + relief[1::2, 1::2]) / 2, 1.2, 40)
    save(folder, "plaster", (0.84 + 0.035 * blotch + 0.025 * grain - 0.05 * np.maximum(streak, 0)).round(2)[::2, ::2, None])
    save_normal(folder, "plaster_normal", (0.4 * blotch + 0.2 * grain)[::2, ::2], 0.6, 24)


def cloth(folder: Path) -> None:
    """Grey cloths, to be tinted: plain weave, twill of denim, knit, stripes, checks; and a normal map of creases."""
    y, x = np.mgrid[0:256, 0:256]
    soft, fine = noise(256, 256, 1.6, 20), noise(256, 256, 0.3, 21, low=20)
    save(folder, "weave", (0.86 + 0.05 * soft + 0.035 * fine).round(2)[..., None])
    twill = ((x + y) % 8 < 3) * 0.12
    save(
        folder,
        "denim",
        (0.74 + twill + 0.07 * soft + 0.07 * noise(256, 256, 0.8, 22, stretch=0.1)).round(2)[..., None],
        colours=24,
    )
    rib = np.abs((x % 16) - 8) / 8
    stitch = np.abs(((y + (x % 16 < 8) * 4) % 8) - 4) / 4
    save(folder, "knit", (0.6 + 0.26 * (1 - rib**2) + 0.1 * stitch + 0.03 * soft).round(2)[..., None], colours=24)
    save_normal(folder, "knit_normal", (1 - rib**2) + 0.3 * stitch, 1.3, 32)
    stripe = smooth(60, 64, np.abs((x % 128) - 64.0) * 2) * 0 + smooth(20, 24, np.abs((y % 128) - 64.0))
    save(folder, "stripes", mix((0.13, 0.16, 0.26), (0.82, 0.8, 0.75), stripe) * (0.96 + 0.04 * fine)[..., None], colours=16)
    broad = 0.5 * (x % 128 < 64) + 0.5 * (y % 128 < 64)
    line = 0.8 * ((x % 128 >= 94) & (x % 128 < 99)) + 0.8 * ((y % 128 >= 94) & (y % 128 < 99))
    check = mix((0.86, 0.83, 0.78), (0.33, 0.3, 0.3), broad) + np.clip(line, 0, 1)[..., None] * (
        np.array([0.8, 0.42, 0.2]) - 0.5
    )
    save(folder, "checks", np.clip(check, 0.05, 0.9) * (0.96 + 0.04 * fine)[..., None], colours=24)
    crease = noise(256, 256, 3.0, 23, stretch=0.5, low=2) + 0.25 * noise(256, 256, 2.4, 24, stretch=2, low=4)
    save_normal(folder, "creases_normal", crease * 9 + 0.04 * ((x + y) % 2), 0.75, 40)
    strand = noise(128, 128, 0.8, 25, stretch=0.06, low=2)
    save(folder, "strands", (0.72 + 0.16 * strand).round(2)[..., None])


def wood(folder: Path) -> None:
    ring, fibre = noise(256, 256, 1.5, 30, stretch=16, low=1), noise(256, 256, 0.7, 31, stretch=30, low=10)
    board = np.abs((np.arange(256) % 64) - 32) / 32
    save(
        folder,
        "wood",
        ((0.64 + 0.13 * ring + 0.08 * fibre) * (1 - 0.7 * smooth(0.94, 1, board))[:, None])[..., None],
        colours=32,
    )


def leaves(folder: Path) -> None:
    """A spray of rounded leaves; alpha is cut at 0.5. Drawn at four times the size."""
    rng = np.random.default_rng(40)
    image = Image.new("RGBA", (1536, 1536), (58, 84, 26, 0))
    draw = ImageDraw.Draw(image)
    draw.line([(768, 1530), (780, 900), (760, 300)], fill=(78, 62, 40, 255), width=16)
    for _ in range(30):
        along = rng.uniform(0, 1)
        side = rng.uniform(-1, 1) * (1.25 - 0.55 * along)
        root = np.array([770 + 520 * side * rng.uniform(0.15, 0.75), 1350 - 1050 * along + 120 * abs(side)])
        draw.line([(770, min(root[1] + 220, 1500)), tuple(root)], fill=(78, 62, 40, 255), width=7)
        lean, length = side * 1.1 + rng.normal(0, 0.35), rng.uniform(220, 330)
        forward, across = np.array([np.sin(lean), -np.cos(lean)]), np.array([np.cos(lean), np.sin(lean)])
        t = np.linspace(0, 1, 24)
        half = 0.46 * length * np.sin(np.pi * t**0.72) ** 0.8
        spine = root + forward * (t * length)[:, None]
        green = np.array([70, 104, 32]) * rng.uniform(0.7, 1.3) + rng.normal(0, 6, 3)
        for sign, tint in ((1, 1.0), (-1, 0.8)):
            outline = np.concatenate([spine, (spine + sign * across * half[:, None])[::-1]])
            draw.polygon([tuple(p) for p in outline], fill=(*np.clip(green * tint, 0, 255).astype(int), 255))
        draw.line([tuple(spine[0]), tuple(spine[-1])], fill=(128, 150, 72, 255), width=6)
    small = np.asarray(image.resize((384, 384), Image.Resampling.BOX)).copy()
    small[..., :3] = np.where(small[..., 3:] > 0, small[..., :3], (58, 84, 26))
    small = np.concatenate([small[..., :3] // 8 * 8, small[..., 3:] // 16 * 17], axis=-1)
    Image.fromarray(small).save(folder / "leaves.png", optimize=True)


def lettering(size: tuple[int, int], items: list, ground, extra=None) -> np.ndarray:
    """Texts (x, y, height, colour, text) in the middle at x, y of an image of `size`, as linear values [h, w, 3]."""
    image = Image.new("RGB", (size[0] * 2, size[1] * 2), ground)
    draw = ImageDraw.Draw(image)
    if extra:
        extra(draw, 2)
    for x, y, height, colour, text in items:
        draw.text((2 * x, 2 * y), text, font=ImageFont.load_default(2 * height), fill=colour, anchor="mm")
    encoded = np.asarray(image.resize(size, Image.Resampling.BOX), float) / 255
    return encoded**2.2


def signs(folder: Path) -> None:
    """Posters (four beside each other), the clock's face, the tram stop's sign, the frieze of the hall."""

    def posters(draw: ImageDraw.ImageDraw, s: int) -> None:
        for k, (a, b) in enumerate(
            (("#d9a441", "#7c2d1a"), ("#1d4e63", "#e7d9b8"), ("#b8c4a0", "#2f4a2c"), ("#a33b4a", "#f0d9c2"))
        ):
            x = k * 128 * s
            draw.rectangle((x, 0, x + 128 * s, 192 * s), fill=a)
            if k == 0:
                for j in range(6):
                    draw.ellipse(
                        (x + (14 + 8 * j) * s, (50 + 8 * j) * s, x + (114 - 8 * j) * s, (150 - 8 * j) * s), fill=(b, a)[j % 2]
                    )
            if k == 1:
                draw.polygon(
                    [
                        (x + 10 * s, 150 * s),
                        (x + 52 * s, 62 * s),
                        (x + 74 * s, 104 * s),
                        (x + 88 * s, 82 * s),
                        (x + 120 * s, 150 * s),
                    ],
                    fill=b,
                )
                draw.ellipse((x + 82 * s, 36 * s, x + 106 * s, 60 * s), fill="#d96c3a")
            if k == 2:
                for j in range(7):
                    draw.rectangle(
                        (x + (12 + 15 * j) * s, (145 - 12 * (j * 5 % 7)) * s, x + (22 + 15 * j) * s, 152 * s), fill=b
                    )
            if k == 3:
                draw.polygon([(x + 64 * s, 40 * s), (x + 108 * s, 96 * s), (x + 64 * s, 152 * s), (x + 20 * s, 96 * s)], fill=b)
                draw.ellipse((x + 46 * s, 78 * s, x + 82 * s, 114 * s), fill=a)

    words = [
        (64, 22, 17, "#f6ead2", "OPERA"),
        (192, 20, 15, "#e7d9b8", "ALPES"),
        (320, 24, 17, "#2f4a2c", "JAZZ"),
        (448, 22, 16, "#f0d9c2", "MUSEUM"),
    ]
    small = [
        (64 + 128 * k, 172, 11, ("#f6ead2", "#e7d9b8", "#2f4a2c", "#f0d9c2")[k], text)
        for k, text in enumerate(("12 MAY", "BY TRAIN", "TONIGHT", "OPEN"))
    ]
    art = lettering((512, 192), words + small, "#888888", posters)
    save(folder, "posters", art * (0.92 + 0.04 * noise(192, 512, 1.6, 50))[..., None] * 0.85 + 0.02, colours=48)

    def dial(draw: ImageDraw.ImageDraw, s: int) -> None:
        for k in range(60):
            a, r = np.radians(6 * k), 112 if k % 5 else 100
            draw.line(
                [
                    (128 * s + r * s * np.sin(a), 128 * s - r * s * np.cos(a)),
                    (128 * s + 120 * s * np.sin(a), 128 * s - 120 * s * np.cos(a)),
                ],
                fill="#161616",
                width=(2 if k % 5 else 7) * s,
            )

    save(folder, "clock", lettering((256, 256), [], "#f4f0e6", dial) * 0.9, colours=8)

    def stop(draw: ImageDraw.ImageDraw, s: int) -> None:
        draw.rectangle((0, 0, 256 * s, 256 * s), fill="#1f5a46")
        draw.ellipse((68 * s, 18 * s, 188 * s, 138 * s), fill="#f2e9d0")

    items = [(128, 78, 92, "#1f5a46", "T"), (128, 168, 34, "#f2e9d0", "Central"), (128, 216, 30, "#e9c65c", "4   7   12")]
    save(folder, "stop", lettering((256, 256), items, "#1f5a46", stop) * 0.9, colours=16)
    name = lettering((512, 64), [(256, 32, 44, "#3a2b16", "CENTRAL   STATION")], "#b9a37c")
    save(folder, "frieze", name * (0.95 + 0.05 * noise(64, 512, 1.2, 51))[..., None], colours=16)


def shop(folder: Path) -> None:
    """What is behind the arcade's windows, as radiance: lit walls with shelves, and dark figures of goods."""
    v, u = 1 - (np.mgrid[0:160, 0:320][0] + 0.5) / 160, (np.mgrid[0:160, 0:320][1] + 0.5) / 320
    lamps = sum(np.exp(-(((u - x) / 0.12) ** 2) - ((v - 0.9) / 0.5) ** 2) for x in (0.15, 0.4, 0.62, 0.88))
    wall = (0.12 + 0.8 * lamps)[..., None] * np.array([0.85, 0.55, 0.28])
    rng = np.random.default_rng(53)
    for shelf in (0.12, 0.36, 0.6):
        wall *= 1 - 0.8 * (np.abs(v - shelf) < 0.014)[..., None]
        for x in np.arange(0.02, 1, 0.032):
            width, tall = rng.uniform(0.008, 0.014), rng.uniform(0.07, 0.19)
            thing = (np.abs(u - x) < width) & (v > shelf) & (v < shelf + tall)
            wall = np.where(thing[..., None], wall * rng.uniform(0.1, 0.9, 3), wall)
    save(folder, "shop", np.clip(wall, 0, 1), colours=64)


def write_all(folder: Path) -> None:
    folder.mkdir(exist_ok=True)
    for part in (paving, ashlar, cloth, wood, leaves, signs, shop):
        part(folder)
