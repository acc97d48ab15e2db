"""Renders the pictures of what is bundled: `python -m framepairs.pictures [NAME ...]` (`make pictures`).

Of each scene its README's frame, of each camera path a strip of frames, and of all scenes the sheet in docs/, whose last cell
has a frame at 3x with jitter and mip bias, its normals, depth and motion.
"""

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from .bundled import bundled_folder, camera_path_names, find_scene, scene_names
from .engine import Engine
from .job import Job
from .listings import pictured_frame, scene_of_path
from .options import make_job
from .plan import make_plan, plan_streams
from .preview import picture_of

SIZE, STRIP_SIZE, STRIP_FRAMES, COLUMNS, QUALITY = (960, 540), (320, 180), 6, 2, 86
SHOWN_IN_PARTS, PARTS = "crowd", ("normal", "depth", "motion")


def stream_pictures(job: Job, engine: Engine, frame: int, stream: int, channels: Sequence[str]) -> list[Image.Image]:
    """Channels of one frame as `preview` shows them; stream: index into the plan's."""
    state = job.shoot.state(frame)
    arrays = engine.render(state, plan_streams(job.plan)[stream], frozenset(channels), frame).arrays
    return [Image.fromarray(picture_of(name, arrays[name], state.exposure_ev)) for name in channels]


def scene_picture(scene: str) -> Image.Image:
    """The frame that the README of a bundled scene names, with all overlays."""
    job = _job(scene, SIZE)
    return stream_pictures(job, Engine(job.scene, job.plan, job.overlay), pictured_frame(scene), 0, ["color"])[0]


def path_strip(name: str) -> Image.Image:
    """Frames of a bundled camera path at equal distances."""
    job = _job(scene_of_path(name), STRIP_SIZE, name)
    engine = Engine(job.scene, job.plan, job.overlay)
    picks = np.unique(np.linspace(0, len(job.shoot) - 1, STRIP_FRAMES).round().astype(int)).tolist()
    return sheet([stream_pictures(job, engine, frame, 0, ["color"])[0] for frame in picks], STRIP_FRAMES)


def parts_picture(scene: str) -> Image.Image:
    """The same frame as `scene_picture` at 3x, pixels enlarged, and channels of the truth; all at half the size."""
    job, half = _job(scene, SIZE), (SIZE[0] // 2 - 2, SIZE[1] // 2 - 2)
    engine, frame = Engine(job.scene, job.plan, job.overlay), pictured_frame(scene)
    low = stream_pictures(job, engine, frame, -1, ["color"])[0].resize(half, Image.Resampling.NEAREST)
    parts = stream_pictures(job, engine, frame, 0, PARTS)
    return sheet([low, *(part.resize(half, Image.Resampling.BOX) for part in parts)], COLUMNS)


def sheet(pictures: Sequence[Image.Image], columns: int, gap: int = 4) -> Image.Image:
    """Pictures of one size in rows, with dark lines between them."""
    width, height = pictures[0].size
    rows = -(-len(pictures) // columns)
    out = Image.new("RGB", (columns * (width + gap) - gap, rows * (height + gap) - gap), (22, 24, 27))
    for k, picture in enumerate(pictures):
        out.paste(picture, (k % columns * (width + gap), k // columns * (height + gap)))
    return out


def _job(scene: str, size: tuple[int, int], camera: str | None = None) -> Job:
    plan = make_plan({"display": size, "channels": "all", "scales": (3,), "variants": ("jittered_mip",)})
    return make_job(scene, find_scene(scene), camera, plan, Path())


def main(names: Sequence[str]) -> None:
    pictures = {name: scene_picture(name) for name in scene_names() if not names or name in names}
    for name, picture in pictures.items():
        picture.save(find_scene(name).with_name(f"{name}.jpg"), quality=QUALITY)
    for name in names or camera_path_names():
        path_strip(name).save(bundled_folder("camera_paths") / f"{name}.jpg", quality=QUALITY)
    if not names:
        cells = [*pictures.values(), parts_picture(SHOWN_IN_PARTS)]
        sheet(cells, COLUMNS).save(bundled_folder("scenes").parent / "docs" / "scenes.jpg", quality=QUALITY)


if __name__ == "__main__":
    main(sys.argv[1:])
