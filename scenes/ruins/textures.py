"""The ruins' images, drawn from noise with fixed seeds: brick in two ages, herringbone, stone, turf, fresco, leaves, fire."""

from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw
from scenes.making.images import blocks, mix, noise, save, save_normal, smooth

WALL = 2.5  # metres that the bricks' image covers: 10 lengths of 25 cm, 34 courses of 7.35 cm
FLOOR = 2.24  # metres that the herringbone covers: 20 widths of 11.2 cm


def bricks(folder: Path) -> None:
    size = 1024
    edge, number = blocks(size, size, columns=10, rows=34)
    rng = np.random.default_rng(200)
    tone, hue, fired, sunk, tilt = rng.uniform(0, 1, (5, number.max() + 1))[:, number]
    grain, coarse = noise(size, size, 0.9, 201, low=8), noise(size, size, 1.5, 202, low=2)
    pits = smooth(1.7, 2.6, noise(size, size, 0.7, 203, low=40))
    worn = 0.05 + 0.05 * smooth(0.4, 1.4, coarse)
    body = smooth(worn, worn + 0.09, edge + 0.028 * grain + 0.03 * noise(size, size, 1.2, 204, low=14))
    gone = (sunk > 0.965) * 1.0  # bricks that have lost their face
    body = body * (1 - 0.75 * gone)

    colour = mix((0.46, 0.19, 0.095), (0.30, 0.115, 0.075), hue)
    colour = mix(colour, (0.55, 0.35, 0.20), 0.8 * smooth(0.82, 0.9, fired))
    colour = mix(colour, (0.12, 0.075, 0.065), 0.75 * smooth(0.1, 0.05, fired))
    colour = colour * (0.72 + 0.5 * tone + 0.10 * grain + 0.1 * coarse)[..., None]
    colour = mix(colour, (0.52, 0.46, 0.38), 0.42 * smooth(0.7, 2.2, noise(size, size, 1.7, 205)) * smooth(-0.8, 0.8, grain))
    colour = mix(colour, (0.10, 0.07, 0.055), 0.5 * pits + 0.5 * gone)
    mortar = np.array([0.47, 0.41, 0.33]) * (0.78 + 0.1 * grain + 0.12 * coarse)[..., None]
    mortar = mix(mortar, (0.16, 0.13, 0.10), smooth(0.1, 1.3, noise(size, size, 1.4, 206)))
    dry = mix(mortar, colour, body)
    save(folder, "brick", dry, colours=24)

    spread = noise(size, size, 1.6, 207, low=2)
    moss = smooth(0.15, 0.75, (1 - body) * 0.75 + 0.33 * spread + 0.12 * noise(size, size, 0.8, 208, low=30))
    green = mix((0.055, 0.075, 0.022), (0.15, 0.17, 0.045), smooth(-1, 1.4, noise(size, size, 0.8, 209, low=12)))
    codes = (mix(dry * 0.66, green, 0.92 * moss).clip(0, 1) * 255).astype(np.uint8)
    mossy = Image.fromarray(codes).resize((768, 768), Image.Resampling.BOX)
    save(folder, "brick_moss", np.asarray(mossy) / 255, colours=16)

    slope = (tilt - 0.5) * ((np.arange(size) / size * 34)[:, None] % 1 - 0.5) * 0.4
    height = body * (0.82 + 0.18 * tone + slope) + 0.013 * grain * body + 0.03 * coarse - 0.12 * pits * body
    height += 0.04 * noise(size, size, 0.9, 210, low=40) * (1 - body)
    save_normal(folder, "brick_normal", height, 3.6, 16)
    rough = 0.86 + 0.04 * grain - 0.28 * smooth(0.12, 0.05, fired) * body - 0.08 * tone
    save(folder, "brick_roughness", (rough[::4, ::4] * 20).round()[..., None] / 20, data=True)


def herringbone(folder: Path) -> None:
    size, cells = 768, 20
    y, x = (np.mgrid[0:size, 0:size] + 0.5) / size * cells
    column, row = np.floor(x).astype(int), np.floor(y).astype(int)
    kind = (column - row) % 4  # two cells of a lying brick, then two of a standing one
    lying = kind < 2
    left, top = column - np.where(lying, kind, 0), row - np.where(kind == 2, 0, np.where(lying, 0, 1))
    across = np.minimum(x - left, left + np.where(lying, 2, 1) - x)
    along = np.minimum(y - top, top + np.where(lying, 1, 2) - y)
    edge, number = np.minimum(across, along), (top % cells) * cells + left % cells
    rng = np.random.default_rng(220)
    tone, hue, worn = rng.uniform(0, 1, (3, cells * cells))[:, number]
    grain, coarse = noise(size, size, 0.9, 221, low=8), noise(size, size, 1.6, 222)
    body = smooth(0.05, 0.13, edge + 0.02 * grain + 0.012 * coarse)
    colour = mix((0.36, 0.17, 0.105), (0.25, 0.14, 0.10), hue) * (0.62 + 0.65 * tone + 0.1 * grain)[..., None]
    colour = mix(colour, (0.37, 0.31, 0.24), 0.5 * smooth(0.82, 0.95, worn))
    dust = smooth(0.2, 1.9, coarse)
    colour = mix(colour, (0.38, 0.33, 0.26), 0.55 * dust)
    joint = mix((0.13, 0.105, 0.08), (0.07, 0.085, 0.03), smooth(0.1, 1.2, noise(size, size, 1.5, 223)))
    save(folder, "herringbone", mix(joint, colour, body), colours=24)
    dome = body * (0.75 + 0.25 * worn) + 0.04 * grain * body - 0.25 * body * np.clip(0.25 - edge, 0, 1)
    save_normal(folder, "herringbone_normal", dome + 0.05 * noise(size, size, 0.8, 224, low=50) * (1 - body), 2.6, 18)
    rough = np.where(body > 0.5, 0.5 + 0.24 * worn + 0.05 * grain + 0.25 * dust, 0.93)
    save(folder, "herringbone_roughness", (rough[::3, ::3] * 24).round()[..., None] / 24, data=True)


def limestone(folder: Path) -> None:
    grain, blotch = noise(512, 512, 0.85, 230, low=6), noise(512, 512, 1.7, 231)
    streak = noise(512, 512, 1.4, 232, stretch=0.15, low=2)
    pits = smooth(1.5, 2.4, noise(512, 512, 0.9, 233, low=24))
    colour = mix((0.60, 0.53, 0.42), (0.44, 0.41, 0.36), smooth(-1, 1.3, blotch)) * (0.92 + 0.07 * grain)[..., None]
    colour = mix(colour, (0.15, 0.14, 0.12), 0.6 * smooth(0.5, 2.0, streak))
    lichen = noise(512, 512, 1.25, 234, low=5)
    colour = mix(colour, (0.46, 0.40, 0.16), 0.6 * smooth(1.55, 1.9, lichen))
    colour = mix(colour, (0.55, 0.56, 0.50), 0.6 * smooth(1.5, 1.8, noise(512, 512, 1.2, 235, low=7)))
    save(folder, "stone", mix(colour, (0.14, 0.12, 0.10), 0.65 * pits), colours=16)
    save_normal(folder, "stone_normal", (0.5 * blotch + 0.3 * grain - 1.3 * pits)[::2, ::2], 0.8, 40)
    save(folder, "stone_roughness", ((0.8 + 0.07 * grain - 0.05 * blotch)[::2, ::2] * 24).round()[..., None] / 24, data=True)


def ground(folder: Path) -> None:
    clump, blade = noise(384, 384, 1.5, 240), noise(384, 384, 0.5, 241, stretch=0.35, low=24)
    grass = mix((0.075, 0.095, 0.03), (0.20, 0.19, 0.075), smooth(-1.2, 1.6, clump + 0.5 * blade))
    grass = grass * (0.85 + 0.22 * blade)[..., None].clip(0.3, 1.6)
    bare = smooth(0.3, 1.1, noise(384, 384, 1.4, 242, low=2) + 0.25 * blade)
    soil = np.array([0.21, 0.16, 0.11]) * (0.9 + 0.2 * noise(384, 384, 0.8, 243, low=10))[..., None]
    save(folder, "turf", mix(grass, soil, bare), colours=14)
    rings = noise(128, 128, 1.9, 244, stretch=0.6, low=3)
    save_normal(folder, "ripple_normal", rings, 0.2, 48)
    save_normal(folder, "turf_normal", (0.6 * clump + 0.35 * blade)[::2, ::2], 0.75, 24)


def fresco(folder: Path) -> None:
    """What is left of a painted plaster: alpha is cut at 0.5."""
    v, u = (np.mgrid[0:512, 0:512] + 0.5) / 512
    ragged = noise(512, 512, 1.45, 250) + 0.35 * noise(512, 512, 0.9, 251, low=12)
    left = 1.0 - 1.5 * np.hypot((u - 0.5) * 1.75, (v - 0.48) * 1.9) ** 1.6 + 0.5 * ragged
    colour = np.array([0.50, 0.42, 0.30]) * (0.95 + 0.08 * noise(512, 512, 1.6, 252))[..., None]
    for low, high, paint in (
        (0.30, 0.325, (0.34, 0.09, 0.05)), (0.335, 0.342, (0.34, 0.09, 0.05)), (0.62, 0.72, (0.33, 0.10, 0.06)),
        (0.735, 0.742, (0.10, 0.13, 0.17)),
    ):  # fmt: skip
        colour = mix(colour, paint, 0.75 * ((v > low) & (v < high)) * smooth(1.6, 0.2, noise(512, 512, 1.2, 253, low=4)))
    arc = np.hypot((u * 6) % 1 - 0.5, (v - 0.60) * 6.0)
    colour = mix(colour, (0.11, 0.20, 0.22), 0.7 * (np.abs(arc - 0.38) < 0.05) * (v < 0.6) * (v > 0.5))
    colour *= (1 - 0.45 * smooth(0.12, 0.0, left - 0.25))[..., None]
    image = np.concatenate([colour.clip(0, 1), smooth(-0.2, 0.2, left - 0.25)[..., None]], axis=-1)
    image = image.reshape(256, 2, 256, 2, 4).mean(axis=(1, 3))
    image[..., :3] = (image[..., :3] * 26).round() / 26
    image[..., 3] = (image[..., 3] * 5).round() / 5
    save(folder, "fresco", image)


def patch(folder: Path) -> None:
    """Turf that has crept over the floor: alpha is cut at 0.5."""
    v, u = (np.mgrid[0:256, 0:256] + 0.5) / 256
    ragged = noise(256, 256, 1.3, 280, low=2) + 0.7 * noise(256, 256, 0.7, 281, low=16)
    left = 0.62 - 2.0 * np.hypot(u - 0.5, v - 0.5) ** 1.5 + 0.22 * ragged
    left = np.minimum(left, 6 * (0.5 - np.maximum(np.abs(u - 0.5), np.abs(v - 0.5))))
    colour = mix((0.075, 0.085, 0.028), (0.18, 0.165, 0.07), smooth(-1.2, 1.6, noise(256, 256, 1.0, 282, low=4)))
    colour = (
        mix(colour, (0.20, 0.155, 0.105), smooth(0.35, 0.1, left)) * (0.9 + 0.14 * noise(256, 256, 0.5, 283, low=20))[..., None]
    )
    image = np.concatenate(
        [(colour.clip(0, 1) * 22).round() / 22, (smooth(0.05, 0.2, left) * 5).round()[..., None] / 5], axis=-1
    )
    save(folder, "patch", image)


def _leaf(draw: ImageDraw.ImageDraw, place, size: float, angle: float, colour, lobes) -> None:
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    outline = np.array(lobes) * size @ turn.T + place
    draw.polygon([tuple(p) for p in outline], fill=(*np.clip(colour, 0, 255).astype(int), 255))
    half = np.array([p for p in lobes if p[0] >= 0]) * size @ turn.T + place
    draw.polygon([tuple(p) for p in half], fill=(*np.clip(np.array(colour) * 0.8, 0, 255).astype(int), 255))
    tip = np.array([0, -0.95]) * size @ turn.T + place
    draw.line([tuple(place), tuple(tip)], fill=(*np.clip(np.array(colour) * 1.35, 0, 255).astype(int), 255), width=6)


IVY = (
    (0, 0.12),
    (0.42, 0.3),
    (0.5, -0.12),
    (0.82, -0.3),
    (0.42, -0.52),
    (0, -1.0),
    (-0.42, -0.52),
    (-0.82, -0.3),
    (-0.5, -0.12),
    (-0.42, 0.3),
)


def cards(folder: Path) -> None:
    """A spray of ivy and a tuft of grass; alpha is cut at 0.5. Drawn at four times the size."""
    rng = np.random.default_rng(260)
    image = Image.new("RGBA", (2048, 2048), (44, 66, 26, 0))
    draw = ImageDraw.Draw(image)
    for stem in range(3):
        x = 500 + 520 * stem + rng.normal(0, 60, 9).cumsum() * 0.6
        draw.line([(x[k], 40 + 245 * k) for k in range(9)], fill=(78, 62, 42, 255), width=14, joint="curve")
    for _ in range(46):
        place = rng.uniform((260, 220), (1790, 1790))
        green = np.array([50, 84, 30]) * rng.uniform(0.62, 1.35) + rng.normal(0, 5, 3)
        if rng.uniform() < 0.1:
            green = np.array([120, 92, 40]) * rng.uniform(0.8, 1.1)
        _leaf(draw, place, rng.uniform(125, 215), np.pi + rng.normal(0, 0.7), green, IVY)
    _store(folder, "ivy", image, (44, 66, 26), 384)

    image = Image.new("RGBA", (1024, 1024), (92, 98, 44, 0))
    draw = ImageDraw.Draw(image)
    for _ in range(44):
        root, lean, tall = 512 + rng.normal(0, 90), rng.normal(0, 0.42), rng.uniform(380, 980)
        t = np.linspace(0, 1, 12)
        spine = np.stack([root + lean * tall * t**1.8, 1023 - tall * t * (1 - 0.25 * abs(lean) * t)], axis=-1)
        half = rng.uniform(9, 17) * (1 - t**1.5)
        green = np.array([104, 108, 48]) * rng.uniform(0.6, 1.25) + np.array([28, 10, 0]) * rng.uniform(0, 1)
        side = np.stack([half, 0 * half], axis=-1)
        outline = np.concatenate([spine - side, (spine + side)[::-1]])
        draw.polygon([tuple(p) for p in outline], fill=(*np.clip(green, 0, 255).astype(int), 255))
    _store(folder, "grass", image, (92, 98, 44), 256)


def _store(folder: Path, name: str, image: Image.Image, empty, size: int) -> None:
    small = np.asarray(image.resize((size, size), Image.Resampling.BOX)).copy()
    small[..., :3] = np.where(small[..., 3:] > 0, small[..., :3], empty)
    small = np.concatenate([small[..., :3] // 8 * 8, small[..., 3:] // 16 * 17], axis=-1)
    Image.fromarray(small).save(folder / f"{name}.png", optimize=True)


def flame(folder: Path) -> None:
    """Radiance / 12 along a tongue of fire, v up: pale at the foot, red at the tip."""
    v, u = 1 - (np.mgrid[0:64, 0:32][0] + 0.5) / 64, (np.mgrid[0:64, 0:32][1] + 0.5) / 32
    lick = np.clip(v + 0.07 * noise(64, 32, 1.3, 270) + 0 * u, 0, 1)
    colour = mix((0.85, 0.40, 0.10), (0.60, 0.17, 0.03), smooth(0.1, 0.5, lick))
    save(folder, "flame", mix(colour, (0.20, 0.03, 0.004), smooth(0.5, 1, lick)), colours=48)


def write_all(folder: Path) -> None:
    folder.mkdir(exist_ok=True)
    for draw in (bricks, herringbone, limestone, ground, patch, fresco, cards, flame):
        draw(folder)
