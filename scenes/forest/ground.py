"""The floor, the path on it, and what closes the view all around: silhouettes in the mist, and hills."""

import numpy as np
from scenes.making.shapes import Shape, sheet
from scenes.making.usd_stage import Stage

from .instancing import add_mist, shining_vertices
from .terrain import END, PATH_HALF_WIDTH, height, mist, path_x


def ground(m: Stage) -> None:
    side = np.concatenate([np.linspace(-END, -22, 14)[:-1], np.linspace(-22, 22, 67), np.linspace(22, END, 14)[1:]])
    x, z = np.meshgrid(side, side[::-1])
    points = np.stack([x, height(x, z), z], axis=-1)
    warp = 0.5 * np.sin(0.31 * x + 0.22 * z), 0.5 * np.sin(0.27 * z - 0.19 * x + 1)  # the image's repeats do not line up
    m.add("Ground/floor", sheet(points, np.stack([x + warp[0], -z + warp[1]], axis=-1)), "floor")
    shining_vertices(m, "floor")
    add_mist(m, "Ground/floor", points.reshape(-1, 3), lambda p: 0.62 * mist(p))
    along, across = np.meshgrid(np.linspace(-30, 24, 163), np.linspace(-1, 1, 5), indexing="ij")
    slope = (path_x(along + 0.05) - path_x(along - 0.05)) / 0.1
    scale = PATH_HALF_WIDTH * 1.35 * (1 + 0.16 * np.sin(0.9 * along) + 0.1 * np.sin(2.3 * along + 1))
    px, pz = path_x(along) + across * scale / np.hypot(1, slope), along - across * scale * slope / np.hypot(1, slope)
    lifted = np.stack([px, height(px, pz) + 0.018, pz], axis=-1)
    st = np.stack([across * 0.5 + 0.5, along / 4.2], axis=-1)
    strip = sheet(lifted, st)
    up = strip.normals[:, 1].mean() > 0
    m.add("Ground/path", Shape(strip.points, strip.normals if up else -strip.normals, strip.st,
                               strip.faces if up else strip.faces[:, ::-1]), "path")  # fmt: skip


def backdrop(m: Stage) -> None:
    """Two rings of silhouettes in the mist, and hills behind them."""
    for k, (radius, low, high, shift, repeats) in enumerate(((47, -0.5, 11.5, 0.0, 5), (61, 0.5, 16, 0.37, 5))):
        angle, t = np.meshgrid(np.linspace(0, 2 * np.pi, 73), np.linspace(0, 1, 4))
        y = float(height(radius, 0)) + low + t * (high - low)
        points = np.stack([radius * np.sin(angle), y, radius * np.cos(angle)], axis=-1)
        st = np.stack([angle / (2 * np.pi) * repeats + shift, 0.01 + 0.98 * t], axis=-1)
        m.add(f"Backdrop/ring{k}", sheet(points, st), "backdrop")
        fade = 0.78 + 0.22 * (1 - t.ravel()[:, None])
        add_mist(m, f"Backdrop/ring{k}", points.reshape(-1, 3), lambda p, fade=fade, k=k: mist(p) * fade * (0.72 + 0.22 * k))
    shining_vertices(m, "backdrop")
    angle, t = np.meshgrid(np.linspace(0, 2 * np.pi, 73), np.linspace(0, 1, 4))
    rim = 15 + 2.5 * np.sin(3 * angle + 1) + 1.4 * np.sin(7 * angle)
    points = np.stack([70 * np.sin(angle), t * rim, 70 * np.cos(angle)], axis=-1)
    m.add("Backdrop/hills", sheet(points, np.stack([angle, t], axis=-1)), "hills")
    shining_vertices(m, "hills")
    add_mist(m, "Backdrop/hills", points.reshape(-1, 3), lambda p: 1.05 * mist(p) * (1 - 0.2 * t.ravel()[:, None]))
