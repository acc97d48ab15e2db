"""The square before the station: paving and tram lines, where its furniture and trees stand, and the houses beyond."""

import numpy as np
from scenes.making.gltf_stage import GltfStage
from scenes.making.images import noise
from scenes.making.shapes import box, lathe, merged, quad, sheet, tube, wall

from .furniture import bench, column, kiosk, lamp, stop
from .greenery import tree, tub
from .moving import pigeons, tram
from .station import HALL, face_normals

TRACKS = (7.6, 10.8)  # x of the middles of the two lines


def ground(m: GltfStage) -> None:
    """A grid with vertex colours: trodden ways are lighter, the edges darker, with stains."""
    x, z = np.meshgrid(np.linspace(-13.4, 5.4, 34), np.linspace(22, -38, 90))
    stain = noise(90, 34, 1.4, 70)
    worn = np.exp(-(((x + 2.0 + 1.5 * np.sin(z / 6)) / 2.6) ** 2))
    shade = (
        0.8 + 0.1 * worn + 0.055 * stain - 0.12 * np.exp(-(((x + 9.0) / 0.5) ** 2)) - 0.1 * np.exp(-(((x - 5.2) / 0.4) ** 2))
    )
    colors = np.clip(shade, 0, 1)[..., None] * np.array([1.0, 0.985, 0.96])
    shape = sheet(np.stack([x, 0 * x, z], axis=-1), np.stack([x + 0.6, -z], axis=-1))
    m.add("Ground/paving", shape, "paving", colors=colors.reshape(-1, 3))
    x, z = np.meshgrid(np.linspace(5.4, 13.4, 9), np.linspace(30, -60, 46))
    tone = np.clip(0.85 + 0.1 * noise(46, 9, 1.2, 71), 0, 1)[..., None] * np.ones(3)
    m.add(
        "Ground/street",
        sheet(np.stack([x, 0 * x - 0.06, z], axis=-1), np.stack([x, -z], axis=-1)),
        "asphalt",
        colors=tone.reshape(-1, 3),
    )
    x, z = np.meshgrid(np.linspace(13.4, 70, 12), np.linspace(40, -90, 27))
    m.add("Ground/park", sheet(np.stack([x, 0 * x + 0.02, z], axis=-1), np.stack([x, -z], axis=-1)), "paving")
    x, z = np.meshgrid(np.linspace(-60, 5.4, 14), np.linspace(60, 22, 8))
    m.add("Ground/behind", sheet(np.stack([x, 0 * x, z], axis=-1), np.stack([x + 0.6, -z], axis=-1)), "paving")
    kerbs = [box(0.3, 0.14, 82, 5.4, -0.12, -19), box(0.3, 0.2, 90, 13.4, -0.12, -15)]
    m.add("Ground/kerbs", merged(kerbs), "kerb")
    rails = [box(0.065, 0.02, 90, x + s * 0.72, -0.062, -15) for x in TRACKS for s in (-1, 1)]
    m.add("Ground/rails", merged(rails), "rail")
    sleepers = [box(1.9, 0.02, 90, x, -0.075, -15) for x in TRACKS]
    m.add("Ground/track_bed", merged(sleepers), "paving")


def wires(m: GltfStage) -> None:
    lines = [tube([(x, 5.15, 25), (x, 5.15, -60)], 0.008, 4) for x in TRACKS]
    masts, spans = [], []
    for z in (12, -8, -28, -48):
        masts.append(lathe([(0.14, 0), (0.12, 0.6), (0.07, 0.7), (0.05, 6.4), (0, 6.5)], 10).at(13.0, 0, z))
        spans.append(tube([(13.0, 5.9, z), (TRACKS[0] - 0.3, 5.35, z)], 0.025, 5))
        spans.append(tube([(13.0, 6.3, z), (TRACKS[0] - 0.3, 5.4, z)], 0.006, 4))
    m.add("Wires/lines", merged([*lines, *spans]), "iron")
    m.add("Wires/masts", merged(masts), "green_paint")


def backdrop(m: GltfStage) -> None:
    """Houses beyond the park, so low that the sun stands above them, and the park's balustrade."""
    rng = np.random.default_rng(81)
    for k in range(7):
        floors, columns, z = (2, 3, 3, 2, 3, 2, 3)[k], (5, 4, 6, 5, 4, 6, 5)[k], 18 - 13.4 * k
        width, height, front = 2.2 * columns + 0.8, 3.3 * floors + 1.0, 46.0 + 2.0 * rng.uniform()
        group = m.group(f"Houses/House{k}", (front, 0, z - width / 2), -90)
        holes = [
            (0.9 + 2.2 * i, 0.9 + 3.3 * j, 1.1, 1.9 - 0.2 * (j == floors - 1)) for i in range(columns) for j in range(floors)
        ]
        m.add(
            f"Houses/House{k}/front", wall(width, height, holes, reveal=0.2), ("ochre", "ashlar", "cream")[k % 3], parent=group
        )
        m.add(
            f"Houses/House{k}/back",
            box(width - 0.02, height, 9, width / 2, 0, -4.75),
            ("ochre", "ashlar", "cream")[k % 3],
            parent=group,
        )
        m.add(
            f"Houses/House{k}/glass",
            merged([quad((x, y, -0.15), (w, 0, 0), (0, h, 0), st=(1, 1)) for x, y, w, h in holes]),
            "glass",
            parent=group,
        )
        trims = [box(w + 0.3, 0.12, 0.3, x + w / 2, y - 0.1, 0) for x, y, w, h in holes] + [
            box(0.06, h, 0.08, x + w / 2, y, -0.14) for x, y, w, h in holes
        ]
        trims += [box(width + 0.3, 0.3, 0.7, width / 2, height - 0.2, 0), box(width, 0.16, 0.2, width / 2, 3.7, 0)]
        m.add(f"Houses/House{k}/trim", merged(trims), "trim", parent=group)
        roof = (
            lathe([(1.06, 0), (1.0, 0.25), (0.62, 3.0), (0.0, 3.3)], 4)
            .turned("y", 45)
            .scaled(width / 1.42, 1, 7.2)
            .at(width / 2, height, -4.6)
        )
        m.add(f"Houses/House{k}/roof", face_normals(roof), "slate", parent=group)
    for k in range(7):
        far = box(12, 9 + 5 * rng.uniform(), 12, -22 + 15.5 * k, 0, -78 - 6 * (k % 2))
        m.add(f"Houses/Far{k}", far, ("stucco", "ashlar", "trim")[k % 3])
    profile = [(0.07, 0.2), (0.09, 0.3), (0.12, 0.45), (0.06, 0.65), (0.09, 0.85)]
    row = [lathe(profile, 7).at(0, 0, 0.3 * k) for k in range(26)] + [
        box(0.32, 0.22, 8.2, 0, 0, 3.9),
        box(0.34, 0.14, 8.2, 0, 0.85, 3.9),
        box(0.46, 1.15, 0.46, 0, 0, -0.1),
    ]
    shape = merged(row)
    for k in range(9):
        m.add(f"Balustrade/run{k}", shape, "trim", (15.2, 0, -54 + 8.2 * k))


def furniture(m: GltfStage) -> None:
    for k in range(6):
        tree(m, f"Trees/Tree{k}", (14.4, 0, 9.5 - 8.6 * k), 1.12 + 0.1 * (k % 3), k)
    for k, z in enumerate((-3.4, -14.6)):
        tree(m, f"Trees/Plane{k}", (4.0 + 0.1 * k, 0, z - 6.5), 0.95 - 0.05 * k, 10 + k)
    for k in range(7):
        tub(m, f"Tubs/Tub{k}", (-8.1, 0, 10.2 - 4.4 * (k + (k > 2))), k)
    for k, (x, z) in enumerate(((4.5, 6.5), (4.5, -5.0), (4.5, -16.5), (-6.0, -8.5), (-6.0, -21.0), (-6.0, 4.2), (4.5, -28))):
        lamp(m, f"Lamps/Lamp{k}", (x, 0, z))
    for k, (x, z, turn) in enumerate(
        ((-4.8, 0.6, 62), (4.1, 1.9, -80), (-5.4, -13.0, 90), (3.6, -11.5, -90), (-5.2, -6.0, 82))
    ):
        bench(m, f"Benches/Bench{k}", (x, 0, z), turn)
    kiosk(m, (1.9, 0, -12.5), -28)
    column(m, (-4.4, 0, -17.5))
    stop(m, (4.7, 0, -22.0))
    posts = [
        lathe([(0.11, 0), (0.11, 0.05), (0.075, 0.1), (0.065, 0.72), (0.09, 0.76), (0.085, 0.84), (0.03, 0.92), (0, 0.93)], 10)
        for _ in range(1)
    ]
    for k in range(16):
        m.add(f"Bollards/bollard{k}", posts[0], "iron", (5.0, 0, 15 - 2.2 * k))
    bins = merged(
        [
            lathe([(0.2, 0.15), (0.24, 0.2), (0.25, 0.85), (0.28, 0.88), (0.2, 0.9)], 14),
            tube([(0, 0, -0.27), (0, 1.1, -0.27)], 0.03, 6),
        ]
    )
    for k, (x, z) in enumerate(((-5.3, 2.3), (4.75, 0.2), (-5.6, -10.6))):
        m.add(f"Bins/bin{k}", bins, "green_paint", (x, 0, z), 90)


def write(m: GltfStage) -> None:
    for part in (ground, furniture, wires, backdrop, pigeons):
        part(m)
    tram(m, "Tram1", TRACKS[1], -58.0, 5.5)
    tram(m, "Tram2", TRACKS[0], HALL + 2.5, 0.9)
