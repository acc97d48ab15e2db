"""The market's images, drawn from noise with fixed seeds: paving, brick, plaster, wood, cloth, glaze, leaves."""

from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw
from scenes.making.images import blocks, cells, mix, noise, save, save_normal, smooth

from .lettering import write_lettering


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
        24,
    )
    colour = mix((0.43, 0.365, 0.29), (0.325, 0.315, 0.305), smooth(0.35, 0.75, hue))
    colour = mix(colour, (0.44, 0.31, 0.22), 0.55 * smooth(0.86, 0.9, hue))
    colour = colour * (0.68 + 0.55 * tone)[..., None] * (1 + 0.13 * rough + 0.1 * noise(size, size, 1.8, 6))[..., None]
    joint = mix((0.15, 0.125, 0.095), (0.085, 0.1, 0.04), smooth(0.5, 1.5, noise(size, size, 1.6, 7)))
    save(folder, "cobbles", mix(joint, colour, stone), colours=40)
    half = slice(None, None, 2)
    polish = 0.52 + 0.22 * worn - 0.1 * smooth(0.3, 0, first) + 0.05 * rough
    save(
        folder,
        "cobbles_roughness",
        (np.where(stone > 0.5, polish, 0.92)[half, half] * 28).round()[..., None] / 28,
        data=True,
    )
    flooded = smooth(0.62, 0.52, dome + 0.06 * rough)[half, half]  # joints and the lower stones, between which water stands
    water = np.concatenate([np.ones((512, 512, 3)) * 0.5, (flooded * 3).round()[..., None] / 3], axis=-1)
    save(folder, "flooded", water, data=True)


def masonry(folder: Path) -> None:
    edge, number = blocks(512, 512, columns=10, rows=32)
    rng = np.random.default_rng(10)
    tone, hue = rng.uniform(0, 1, (2, number.max() + 1))
    grain = noise(512, 512, 0.9, 11, low=4)
    brick = smooth(0.05, 0.13, edge + 0.015 * grain)
    colour = mix((0.40, 0.155, 0.10), (0.29, 0.12, 0.095), hue[number]) * (0.7 + 0.5 * tone[number])[..., None]
    colour = mix((0.42, 0.38, 0.33), colour, brick) * (1 + 0.08 * grain + 0.08 * noise(512, 512, 2, 12))[..., None]
    save(folder, "brick", colour, colours=28)
    save_normal(folder, "brick_normal", brick * (0.8 + 0.2 * tone[number]) + 0.04 * grain, 2.2, 32)

    edge, number = blocks(512, 512, columns=4, rows=6)
    slab = smooth(0.012, 0.035, edge)
    tone = rng.uniform(0, 1, number.max() + 1)[number]
    blotch = noise(512, 512, 1.8, 9)
    colour = (
        mix((0.42, 0.365, 0.295), (0.31, 0.295, 0.275), tone) * (0.8 + 0.25 * tone + 0.07 * grain + 0.09 * blotch)[..., None]
    )
    colour *= (1 - 0.35 * smooth(0.12, 0.0, edge - 0.03 * blotch))[..., None]
    save(folder, "flags", mix((0.1, 0.09, 0.08), colour, slab), colours=22)

    tone = rng.uniform(0, 1, 4096)
    y = np.mgrid[0:512, 0:512][0] / 512 * 16
    edge, number = blocks(512, 512, columns=20, rows=16)
    lip = smooth(0, 0.18, y % 1)
    colour = mix((0.45, 0.17, 0.085), (0.33, 0.145, 0.095), tone[number + 900]) * (0.6 + 0.65 * tone[number])[..., None]
    colour = mix(colour, (0.5, 0.3, 0.17), 0.7 * smooth(0.9, 0.95, tone[number + 1800]))
    soot = smooth(0.2, 1.8, noise(512, 512, 1.7, 13))
    colour = mix(colour, (0.15, 0.125, 0.075), 0.6 * soot)
    save(folder, "tiles", colour * (0.35 + 0.65 * lip * smooth(0, 0.1, edge))[..., None], colours=40)
    save_normal(folder, "tiles_normal", ((y % 1) * 0.7 + np.sqrt(np.clip(edge, 0, 0.5)))[::2, ::2], 5)

    blotch, grit = noise(256, 256, 1.9, 14), noise(256, 256, 0.6, 15, low=10)
    save(folder, "stone", (0.8 + 0.07 * blotch + 0.04 * grit).round(2)[..., None])
    save_normal(
        folder, "plaster_normal", 0.5 * noise(512, 512, 1.7, 17, low=4) + 0.08 * noise(512, 512, 0.9, 18, low=40), 0.8, 14
    )


def facade(folder: Path) -> None:
    """Weathered render of a whole wall: u over 6.4 m, v from the ground to the eaves; the material tints it."""
    size = 1024
    v = 1 - (np.mgrid[0:size, 0:size][0] + 0.5) / size
    blotch, grit = noise(size, size, 1.9, 14), noise(size, size, 0.7, 15, low=30)
    streak = noise(size, size, 1.1, 16, stretch=0.06, low=3)  # rain runs down the wall
    lift = noise(size, size, 1.5, 19, low=2)
    colour = np.ones((size, size, 3)) * (0.88 + 0.045 * blotch + 0.008 * grit)[..., None]
    rain = smooth(0.1, 1.9, streak) * (0.25 + 0.75 * smooth(0.45, 1.0, v))
    colour *= mix((1, 1, 1), (0.62, 0.6, 0.56), 0.6 * rain)
    damp = np.exp(-v / (0.06 * np.exp(0.45 * lift)))
    colour *= mix((1, 1, 1), (0.5, 0.44, 0.36), np.clip(1.05 * damp, 0, 1))
    colour = mix(colour, (0.3, 0.33, 0.2), 0.6 * smooth(0.035, 0.0, v - 0.012 * lift))
    colour *= (1 - 0.3 * smooth(0.03, 0.0, 1 - v))[..., None]  # under the eaves
    fallen = noise(size, size, 1.6, 31, low=2) + 0.65 * smooth(0.5, 0.05, v) + 0.2 * smooth(0.75, 1, v)
    colour = mix(colour, np.array([0.58, 0.5, 0.47]) * (1 + 0.1 * grit)[..., None], smooth(2.3, 2.34, fallen))
    colour *= (1 - 0.35 * smooth(2.22, 2.3, fallen) * smooth(2.34, 2.3, fallen))[..., None]
    crack = smooth(0.035, 0.0, np.abs(noise(size, size, 1.45, 32, low=2))) * smooth(0.9, 1.5, noise(size, size, 2, 33, low=1))
    save(folder, "plaster", colour * (1 - 0.4 * crack)[..., None], colours=16)


def panes(folder: Path) -> None:
    """What shows behind window panes, eight rooms of 128 x 128 in two rows: dusk, curtains, blinds, plants on the sill."""
    v, u = (np.mgrid[0:128, 0:128] + 0.5) / 128
    v = 1 - v
    rng = np.random.default_rng(54)
    room = np.array([0.03, 0.034, 0.04]) * (0.5 + 0.9 * v + 0.5 * u)[..., None]
    cloths = ((0.62, 0.6, 0.54), (0.5, 0.2, 0.13), (0.6, 0.52, 0.34), (0.28, 0.36, 0.42))
    rooms = []
    for k in range(8):
        one, cloth = room * (0.7 + 0.15 * k), np.array(cloths[k % 4])
        fold = 0.62 + 0.28 * np.sin(u * 58 + 2.5 * np.sin(u * 11 + k) + k) + 0.1 * v
        if k in (1, 2, 4, 6):  # drawn to the sides, narrower below
            gap = (0.30, 0.12, 0.24, 0.36)[k // 2] + 0.07 * np.sin(3 * v + k) * (k % 3)
            one = mix(one, cloth * fold[..., None], 0.9 * smooth(gap - 0.01, gap + 0.01, np.abs(u - 0.5)))
        if k in (3, 7):  # a blind
            low = 0.35 if k == 3 else 0.62
            slat = 0.75 + 0.25 * np.sin(v * 190)
            one = mix(one, np.array((0.55, 0.5, 0.4)) * slat[..., None], 1.0 * (v > low))
        if k in (0, 4, 5):  # a plant
            for _ in range(26):
                x, y, r = rng.normal(0.5, 0.13), abs(rng.normal(0.12, 0.12)), rng.uniform(0.02, 0.06)
                one = mix(one, np.array((0.06, 0.13, 0.04)) * rng.uniform(0.5, 1.5), smooth(r, 0.8 * r, np.hypot(u - x, v - y)))
        one *= (1 - 0.55 * smooth(0.1, 0.0, 1 - v))[..., None]  # the lintel's shade
        rooms.append(one)
    save(folder, "panes", np.concatenate([np.concatenate(rooms[:4], axis=1), np.concatenate(rooms[4:], axis=1)]), colours=64)


def crafts(folder: Path) -> None:
    ring = noise(512, 512, 1.5, 20, stretch=16, low=1)
    fibre = noise(512, 512, 0.7, 21, stretch=30, low=12)
    board = np.abs((np.arange(512) % 128) - 64) / 64
    save(
        folder,
        "wood",
        ((0.62 + 0.13 * ring + 0.09 * fibre) * (1 - 0.75 * smooth(0.955, 1, board))[:, None])[..., None],
        colours=26,
    )
    save(folder, "wood_roughness", (0.6 + 0.1 * ring - 0.05 * fibre).round(2)[::2, ::2, None], data=True)

    streaks = noise(256, 512, 0.35, 22, stretch=90, low=3)
    dents = noise(256, 512, 1.6, 23)
    save(
        folder,
        "brushed_roughness",
        (np.clip(0.28 + 0.1 * streaks + 0.015 * dents, 0.08, 0.6).round(2) * 50 // 1)[..., None] / 50,
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
    threads = np.maximum(np.sin(x * np.pi / 2 + 0.4), np.sin(y * np.pi / 2 + 0.4))
    save(folder, "burlap", (0.68 + 0.09 * threads + 0.06 * noise(256, 256, 0.8, 26, low=8)).round(2)[..., None])

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


def write_all(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    paving(folder)
    masonry(folder)
    facade(folder)
    panes(folder)
    crafts(folder)
    glaze(folder)
    leaves(folder)
    write_lettering(folder)
