"""The forest's images, drawn from noise and polygons with fixed seeds: floor, path, bark, moss, leaves, fern, grass, rock."""

from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw
from scenes.making.images import mix, noise, save, save_normal, smooth


def leaf_outline(length: float, width: float, lobes: int = 0, depth: float = 0.0) -> np.ndarray:
    """Polygon [n, 2] of a leaf from (0, 0) along +y; `lobes` rounded bays on each side."""
    t = np.linspace(0, 1, 28)
    half = width / 2 * np.sin(np.pi * t**0.85) ** 0.8 * (1 - depth * (0.5 + 0.5 * np.cos(2 * np.pi * lobes * t)) * (t < 0.93))
    right = np.stack([half, t * length], axis=-1)
    return np.concatenate([right, right[::-1] * [-1, 1]])


def placed(outline: np.ndarray, x: float, y: float, degrees: float) -> np.ndarray:
    a = np.radians(degrees)
    return outline @ np.array([[np.cos(a), np.sin(a)], [-np.sin(a), np.cos(a)]]) + [x, y]


def floor(folder: Path) -> None:
    """Forest floor: fallen leaves over earth, moss, needles and twigs; periodic. Leaves are drawn with their height."""
    size, rng = 1536, np.random.default_rng(1)
    earth, fine = noise(768, 768, 1.5, 2), noise(768, 768, 0.8, 3, low=30)
    colour = mix((0.105, 0.072, 0.042), (0.055, 0.038, 0.024), smooth(-1, 1, earth)) * (1 + 0.22 * fine)[..., None]
    moss = smooth(0.45, 1.15, noise(768, 768, 1.7, 4) + 0.25 * noise(768, 768, 0.9, 5, low=12))
    colour = mix(colour, np.array([0.105, 0.135, 0.028]) * (1 + 0.3 * fine)[..., None], moss)
    leaves, heights = Image.new("RGBA", (size, size), (0, 0, 0, 0)), Image.new("L", (size, size), 0)
    pens = ImageDraw.Draw(leaves), ImageDraw.Draw(heights)
    tones = np.array([(118, 78, 40), (142, 92, 40), (96, 62, 36), (160, 112, 48), (84, 66, 40), (110, 100, 46), (172, 88, 34)])
    for k in range(1350):
        length = rng.uniform(44, 84)
        outline = leaf_outline(length, length * rng.uniform(0.42, 0.6), 4 if k % 3 else 0, 0.4 if k % 3 else 0)
        x, y, turn = rng.uniform(0, size, 2).tolist() + [rng.uniform(0, 360)]
        tone = tones[rng.integers(len(tones))] * rng.uniform(0.55, 1.1)
        level = int(60 + 120 * k / 1350 + rng.uniform(0, 60))
        for dx in (-size, 0, size):
            for dy in (-size, 0, size):
                shape = placed(outline, x + dx, y + dy, turn)
                low, high = shape.min(axis=0), shape.max(axis=0)
                if (high < 0).any() or (low > size).any():
                    continue
                halves = shape[: len(shape) // 2], shape[len(shape) // 2 :]
                spine = [tuple(shape[0]), tuple(shape[len(shape) // 2])]
                for half, shade, lift in zip(halves, (1.0, 0.82), (0, -22), strict=True):
                    pens[0].polygon([tuple(p) for p in half], fill=(*(tone * shade).astype(int), 255))
                    pens[1].polygon([tuple(p) for p in half], fill=level + lift)
                pens[0].line(spine, fill=(*(tone * 0.62).astype(int), 255), width=4)
    small = np.asarray(leaves.resize((768, 768), Image.Resampling.BOX), float) / 255
    linear = np.where(small[..., :3] <= 0.04045, small[..., :3] / 12.92, ((small[..., :3] + 0.055) / 1.055) ** 2.4)
    cover = small[..., 3] * (1 - 0.8 * moss)
    height = np.asarray(heights.resize((768, 768), Image.Resampling.BOX), float) / 255
    shade = 0.55 + 0.6 * smooth(0.05, 0.75, height)
    colour = mix(colour, linear * (shade * (1 + 0.1 * fine))[..., None], cover)
    save(folder, "floor", colour, colours=24)
    field = height * cover * 1.3 + 0.12 * fine + 0.35 * moss * (1 + 0.3 * fine) + 0.12 * earth
    save_normal(folder, "floor_normal", field[::2, ::2], 1.7, 32)
    save(folder, "floor_roughness", (0.93 - 0.25 * cover * height + 0.03 * earth)[::4, ::4, None].round(2), data=True)


def path(folder: Path) -> None:
    """Trodden earth with flecks and pebbles; u runs across the path, alpha frays at its edges."""
    h, w, rng = 384, 192, np.random.default_rng(10)
    u = (np.arange(w) + 0.5)[None, :] / w
    earth, fine = noise(h, w, 1.4, 11), noise(h, w, 0.7, 12, low=16)
    worn = smooth(0.5, 0.05, np.abs(u - 0.5)) * np.ones((h, 1))
    colour = mix((0.135, 0.092, 0.055), (0.245, 0.18, 0.115), worn * smooth(-1.6, 1, earth)) * (1 + 0.16 * fine)[..., None]
    canvas = Image.new("RGBA", (w * 4, h * 4), (0, 0, 0, 0))
    pen = ImageDraw.Draw(canvas)
    for _ in range(420):
        x, y, length = rng.uniform(0, w * 4), rng.uniform(0, h * 4), rng.uniform(9, 20)
        tone = np.array([(130, 84, 42), (98, 64, 38), (164, 112, 46)][rng.integers(3)]) * rng.uniform(0.7, 1.1)
        for dy in (-h * 4, 0, h * 4):
            pen.polygon([tuple(p) for p in placed(leaf_outline(length, length / 2), x, y + dy, rng.uniform(0, 360))],
                        fill=(*tone.astype(int), 255))  # fmt: skip
    for _ in range(900):
        x, y, r = rng.uniform(0, w * 4), rng.uniform(0, h * 4), rng.uniform(1.5, 5)
        pen.ellipse((x - r, y - r * 0.8, x + r, y + r * 0.8), fill=(*[int(rng.uniform(84, 140))] * 3, 255))
    small = np.asarray(canvas.resize((w, h), Image.Resampling.BOX), float) / 255
    colour = mix(colour, small[..., :3] ** 2.2, small[..., 3])
    edge = np.abs(u - 0.5) * 2 + 0.16 * noise(h, w, 1.3, 13) + 0.09 * fine
    alpha = smooth(0.95, 0.72, edge)
    _save_cutout(folder, "path", colour, alpha)


def bark(folder: Path) -> None:
    size = 512
    rough = noise(size, size, 1.25, 20, stretch=5.5).T  # drawn out along v
    fine, blotch = noise(size, size, 0.8, 21, stretch=2.5, low=10).T, noise(size, size, 1.8, 22)
    ridge = smooth(0.0, 0.9, np.abs(rough + 0.25 * fine)) * smooth(-0.2, 0.6, np.abs(noise(size, size, 1.1, 23, low=5)) + 0.3)
    oak = mix((0.045, 0.034, 0.025), mix((0.25, 0.195, 0.145), (0.19, 0.18, 0.15), smooth(0, 1.2, blotch)), ridge)
    oak = mix(oak, (0.25, 0.28, 0.19), 0.55 * smooth(0.9, 1.9, noise(size, size, 1.2, 24)) * ridge)
    oak = oak * (1 + 0.14 * fine)[..., None]
    save(folder, "oak_bark", oak, colours=26)
    save_normal(folder, "oak_bark_normal", (ridge + 0.08 * fine)[::2, ::2], 2.6, 40)
    v = 1 - (np.arange(size) + 0.5)[:, None] / size
    grow = noise(size, size, 1.5, 25) * 0.28 + 0.1 * noise(size, size, 0.8, 26, low=10) + 0.95 - 1.25 * v
    moss = smooth(0.25, 0.6, grow) * smooth(1, 0.86, v)
    green = mix((0.075, 0.105, 0.018), (0.17, 0.20, 0.04), smooth(-1, 1.2, noise(size, size, 0.9, 27, low=14)))
    save(folder, "oak_root", mix(oak, green, moss)[::2, ::2], colours=40)
    save(folder, "bark_roughness", (0.84 - 0.16 * ridge + 0.05 * blotch)[::4, ::4, None].round(2), data=True)

    band, speck = noise(size, size, 1.2, 30, stretch=4), noise(size, size, 0.55, 31, stretch=6, low=10)
    white = mix((0.70, 0.665, 0.59), (0.80, 0.775, 0.72), smooth(-1, 1, band)) * (1 + 0.035 * fine)[..., None]
    white = mix(white, (0.60, 0.43, 0.30), 0.45 * smooth(0.5, 1.6, noise(size, size, 1.7, 32, stretch=2)))
    marks = smooth(1.35, 1.75, speck) + smooth(1.3, 1.55, noise(size, size, 1.5, 33, stretch=2.2))
    marks = np.clip(marks, 0, 1)
    birch = mix(white, (0.045, 0.038, 0.034), 0.92 * marks)
    save(folder, "birch_bark", birch, colours=24)
    save_normal(folder, "birch_bark_normal", (0.1 * band - 0.3 * marks)[::2, ::2], 1.6, 32)
    crack = smooth(0.05, 0.5, 0.6 * noise(size, size, 1.2, 34, stretch=3).T + 0.9 - 1.5 * v) * smooth(1, 0.8, v)
    base = mix((0.05, 0.042, 0.036), (0.12, 0.14, 0.04), smooth(0.2, 1.0, grow))
    save(folder, "birch_root", mix(birch, base * (1 + 0.3 * fine)[..., None], crack)[::2, ::2], colours=40)

    y, x = (np.mgrid[0:128, 0:128] + 0.5) / 128 - 0.5
    rings = np.sin(np.hypot(x, y) * 110 + 1.6 * noise(128, 128, 1.6, 35))
    save(folder, "end_grain", mix((0.26, 0.17, 0.09), (0.44, 0.31, 0.18), 0.5 + 0.5 * rings), colours=24)


def rock(folder: Path) -> None:
    size = 384
    lumps, fine = noise(size, size, 1.5, 40), noise(size, size, 0.8, 41, low=12)
    stone = (
        mix((0.17, 0.165, 0.155), (0.33, 0.315, 0.285), smooth(-1.4, 1.4, lumps + 0.4 * fine)) * (1 + 0.12 * fine)[..., None]
    )
    stone = mix(stone, (0.46, 0.46, 0.38), 0.7 * smooth(1.2, 1.7, noise(size, size, 1.2, 42, low=5)))
    moss = smooth(-0.15, 0.45, noise(size, size, 1.6, 43) + 0.22 * fine)
    green = mix((0.065, 0.092, 0.016), (0.165, 0.20, 0.04), smooth(-1, 1.4, noise(size, size, 0.9, 44, low=10)))
    save(folder, "rock", mix(stone, green, moss), colours=26)
    save_normal(folder, "rock_normal", (0.7 * lumps + 0.16 * fine + 0.5 * moss)[::2, ::2], 0.9, 32)
    save(folder, "rock_roughness", (0.72 + 0.22 * moss + 0.04 * fine)[::4, ::4, None].round(2), data=True)


def _save_cutout(folder: Path, name: str, linear: np.ndarray, alpha: np.ndarray) -> None:
    """RGB in steps of 12 of 256, alpha in 16 steps."""
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 1e-9) ** (1 / 2.4) - 0.055)
    rgb = (np.clip(encoded, 0, 1) * 255).astype(np.uint8) // 12 * 12 + 4
    value = np.concatenate([rgb, (np.clip(alpha, 0, 1) * 15).round().astype(np.uint8)[..., None] * 17], axis=-1)
    Image.fromarray(value).save(folder / f"{name}.png", optimize=True)


def _save_drawing(folder: Path, name: str, image: Image.Image, size: tuple[int, int], behind: tuple[int, int, int]) -> None:
    """A drawing at several times its size, with `behind` where nothing is drawn."""
    small = np.asarray(image.resize(size, Image.Resampling.BOX)).copy()
    small[..., :3] = np.where(small[..., 3:] > 0, small[..., :3], behind)
    small = np.concatenate([small[..., :3] // 8 * 8, small[..., 3:] // 17 * 17], axis=-1)
    Image.fromarray(small).save(folder / f"{name}.png", optimize=True)


def _draw_leaf(pen: ImageDraw.ImageDraw, outline: np.ndarray, tone: np.ndarray, vein: float, width: int) -> None:
    half = len(outline) // 2
    for part, shade in ((outline[:half], 1.0), (outline[half:], 0.84)):
        pen.polygon([tuple(p) for p in part], fill=(*np.clip(tone * shade, 0, 255).astype(int), 255))
    pen.line([tuple(outline[0]), tuple(outline[half - 1])], fill=(*np.clip(tone * vein, 0, 255).astype(int), 255), width=width)


def twigs(folder: Path) -> None:
    """Sprays of leaves that grow from the middle of the lower edge; alpha is cut at 0.5."""
    kinds = {
        "oak_leaves": (42, (380, 520), 0.56, 3, 0.34, (82, 122, 38), (96, 104, 30)),
        "birch_leaves": (58, (250, 350), 0.66, 0, 0.0, (104, 140, 44), (146, 146, 40)),
    }
    for seed, (name, (count, lengths, ratio, lobes, depth, green, other)) in enumerate(kinds.items(), 60):
        rng = np.random.default_rng(seed)
        image = Image.new("RGBA", (2048, 2048), (*green, 0))
        pen = ImageDraw.Draw(image)
        stems = []
        for k in range(7):
            a = np.radians(-62 + 124 * k / 6 + rng.normal(0, 4))
            reach = 1500 - 380 * abs(k - 3) / 3
            t = np.linspace(0, 1, 12)[:, None]
            stem = np.array([1024, 2040]) + t * reach * np.array([np.sin(a), -np.cos(a)]) + t**2 * [0, 130 * abs(k - 3) / 3]
            pen.line([tuple(p) for p in stem], fill=(88, 70, 42, 255), width=16)
            stems.append((stem, a))
        order = rng.permutation(count)
        for k in order:
            stem, a = stems[k % 7]
            along = 0.28 + 0.72 * (k // 7 + 1) / (count // 7 + 1)
            root = stem[int(min(along, 1) * 11)] + rng.normal(0, 14, 2)
            length = rng.uniform(*lengths)
            turn = 180 + np.degrees(a) + (-1) ** k * rng.uniform(15, 75)
            tone = np.array(green) + (np.array(other) - green) * rng.uniform(0, 1)
            outline = placed(leaf_outline(length, length * ratio, lobes, depth), *root, turn)
            _draw_leaf(pen, outline, tone * rng.uniform(0.62, 1.2), 1.3, 10)
        _save_drawing(folder, name, image, (512, 512), green)


def solid_spots(folder: Path, name: str, count: int = 40) -> np.ndarray:
    """Texture coordinates [count, 2] in a cut-out around which it is opaque for a 40th of its width."""
    alpha = np.asarray(Image.open(folder / f"{name}.png").convert("RGBA"))[..., 3] > 240
    reach = alpha.shape[0] // 40
    solid = np.logical_and.reduce([np.roll(alpha, (dy, dx), (0, 1)) for dy in (-reach, 0, reach) for dx in (-reach, 0, reach)])
    rows, columns = np.nonzero(solid)
    chosen = np.random.default_rng(64).integers(0, len(rows), count)
    return np.stack([(columns[chosen] + 0.5) / alpha.shape[1], 1 - (rows[chosen] + 0.5) / alpha.shape[0]], axis=-1)


def fern(folder: Path) -> None:
    """A frond from the lower edge up."""
    rng, green = np.random.default_rng(70), (74, 118, 36)
    image = Image.new("RGBA", (1024, 2048), (*green, 0))
    pen = ImageDraw.Draw(image)
    for k in range(34):
        t = 0.1 + 0.88 * k / 33
        y, reach = 2048 * (1 - t), 490 * np.sin(np.pi * min(t * 0.72 + 0.25, 1)) ** 0.9
        for side in (-1, 1):
            lean = 66 + rng.normal(0, 3) - 30 * t
            direction = np.array([side * np.sin(np.radians(lean)), -np.cos(np.radians(lean))])
            across = np.array([-direction[1], direction[0]])
            s = np.linspace(0, 1, 40)[:, None]
            half = 52 * (1 - s) ** 0.7 * (0.62 + 0.38 * np.abs(np.sin(s * np.pi * 9))) * (0.5 + 0.5 * min(1, reach / 300))
            spine = np.array([512, y]) + direction * reach * s + [0, 1] * (26 * s**2)
            tone = np.array(green) * rng.uniform(0.75, 1.2) + [18 * t, 14 * t, 0]
            outline = np.concatenate([spine + across * half, (spine - across * half)[::-1]])
            _draw_leaf(pen, outline, tone, 1.2, 5)
    pen.line([(512, 2047), (512, 60)], fill=(112, 116, 52, 255), width=14)
    _save_drawing(folder, "fern", image, (256, 512), green)


def grass(folder: Path) -> None:
    rng, green = np.random.default_rng(72), (104, 138, 50)
    image = Image.new("RGBA", (1024, 1024), (*green, 0))
    pen = ImageDraw.Draw(image)
    for k in range(34):
        x, lean, tall = rng.uniform(120, 904), rng.normal(0, 170), rng.uniform(500, 1000)
        t = np.linspace(0, 1, 20)[:, None]
        spine = np.array([x, 1024]) + t * [0, -tall] + t**2 * [lean, 40]
        half = np.concatenate([15 * (1 - t**2), 0 * t], axis=1) + [1.5, 0]
        tone = (np.array(green) if k % 5 else np.array([150, 138, 70])) * rng.uniform(0.65, 1.15)
        _draw_leaf(pen, np.concatenate([spine + half, (spine - half)[::-1]]), tone, 1.1, 4)
    _save_drawing(folder, "grass", image, (256, 256), green)


def fallen(folder: Path) -> None:
    """Single leaves in a grid of 3 x 3, for the floor and the air."""
    rng = np.random.default_rng(74)
    image = Image.new("RGBA", (1536, 1536), (130, 84, 40, 255))
    pen = ImageDraw.Draw(image)
    tones = [(196, 140, 44), (150, 92, 40), (188, 104, 34), (112, 74, 42), (206, 168, 62), (134, 112, 46), (170, 84, 32),
             (122, 84, 48), (178, 128, 52)]  # fmt: skip
    for k, tone in enumerate(tones):
        x, y = 256 + 512 * (k % 3), 256 + 512 * (k // 3)
        length = rng.uniform(380, 450)
        turn = (-8, 14, 3, -18, 8, 20, -14, 10, -5)[k]
        start = np.array([x, y]) - placed(np.array([[0, length / 2]]), 0, 0, turn)[0]
        outline = placed(leaf_outline(length, length * 0.58, 4 if k % 2 else 0, 0.4 if k % 2 else 0), *start, turn)
        _draw_leaf(pen, outline, np.array(tone), 0.7, 12)
    _save_drawing(folder, "fallen_leaves", image, (192, 192), (130, 84, 40))


def backdrop(folder: Path) -> None:
    """Trees at the end of sight, as a silhouette; u runs around, periodic."""
    rng = np.random.default_rng(76)
    w, h = 4096, 1024
    image = Image.new("RGBA", (w, h), (60, 66, 56, 0))
    pen = ImageDraw.Draw(image)
    ink = (60, 66, 56, 255)
    for _ in range(120):
        x, width, top = rng.uniform(0, w), rng.uniform(7, 22), rng.uniform(0, 240)
        lean = rng.normal(0, 25)
        for dx in (-w, 0, w):
            pen.polygon([(x + dx - width, h), (x + dx + width, h), (x + dx + lean + width / 3, top),
                         (x + dx + lean - width / 3, top)], fill=ink)  # fmt: skip
            for _ in range(26):
                cy = rng.uniform(top, 560)
                cx, r = x + dx + lean * (1 - cy / h) + rng.normal(0, 85), rng.uniform(12, 46)
                for _ in range(9):
                    px, py, s = cx + rng.normal(0, r), cy + rng.normal(0, r * 0.6), rng.uniform(5, 17)
                    pen.ellipse((px - s, py - s * 0.7, px + s, py + s * 0.7), fill=ink)
    for _ in range(700):  # undergrowth
        x, r = rng.uniform(0, w), rng.uniform(12, 46)
        y = h - rng.uniform(0, 90)
        pen.ellipse((x - r, y - r, x + r, y + r), fill=ink)
    _save_drawing(folder, "backdrop", image, (1024, 256), ink[:3])


def write_all(folder: Path) -> None:
    folder.mkdir(exist_ok=True, parents=True)
    for part in (floor, path, bark, rock, twigs, fern, grass, fallen, backdrop):
        part(folder)
