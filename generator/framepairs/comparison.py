"""`raster` and `path` side by side: the same frame in both shading modes, to be looked at."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from .camera_path import CameraPath
from .engine import Engine
from .frame import Shoot, check_frames
from .manifest import make_folder
from .metrics import psnr, to_display
from .plan import RenderPlan, make_plan, plan_streams
from .preview import grid, labelled
from .scene.description import SceneDescription

DIFFERENCE_GAIN = 2.0


@dataclass(frozen=True, kw_only=True)
class ComparedFrame:
    """HR colour of one frame in two modes, as display codes in [0, 1] [height, width, 3], and how far they are apart."""

    frame: int
    shown: tuple[NDArray, NDArray]
    psnr: float
    mean_ratio: float


def compare_modes(
    scene: SceneDescription, path: CameraPath, plan: RenderPlan, modes: tuple[str, str], frames: Sequence[int]
) -> list[ComparedFrame]:
    """Render HR colour of `frames` in both `modes` ('raster', 'path'). mean_ratio: mean radiance of the second over the
    first's. Raises InputError for frames that the path has not."""
    shoot = Shoot(scene, path, plan.display[0] / plan.display[1])
    check_frames(frames, len(shoot))
    plans = [make_plan(plan.model_dump() | {"shading": mode}) for mode in modes]
    engines = [Engine(scene, each) for each in plans]
    compared = []
    for frame in frames:
        state = shoot.state(frame)
        first, second = (
            engine.render(state, plan_streams(each)[0], frozenset({"color"}), 0).arrays["color"]
            for engine, each in zip(engines, plans, strict=True)
        )
        shown = to_display(first, state.exposure_ev), to_display(second, state.exposure_ev)
        ratio = float(second.mean(dtype=np.float64) / max(first.mean(dtype=np.float64), 1e-30))
        compared.append(ComparedFrame(frame=frame, shown=shown, psnr=psnr(*shown), mean_ratio=ratio))
    return compared


def write_comparison(compared: Sequence[ComparedFrame], modes: tuple[str, str], file: Path) -> Path:
    """One row per frame: the first mode, the second, and twice their difference around grey (brighter: the second is)."""
    rows = []
    for item in compared:
        first, second = item.shown
        size = (first.shape[1], first.shape[0])
        difference = np.clip(0.5 + DIFFERENCE_GAIN * (second - first), 0, 1)
        gain = f"{DIFFERENCE_GAIN:g} x difference + 0.5"
        texts = (f"{modes[0]}  frame {item.frame}", f"{modes[1]}  {item.psnr:.1f} dB", gain)
        pictures = [np.round(picture * 255).astype(np.uint8) for picture in (first, second, difference)]
        rows.append([labelled(picture, text, size) for picture, text in zip(pictures, texts, strict=True)])
    make_folder(file.parent)
    sheet: Image.Image = grid(rows)
    sheet.save(file)
    return file
