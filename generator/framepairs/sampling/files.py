"""What sampled camera paths are as files: the options, `cameras.json`, and the split into train, val and test."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from ..camera.keys import LARGEST, Finite, Rate
from ..errors import InputError
from ..manifest import Sha256, from_json
from ..scene.containment import reach_of, within
from ..transforms import Vector
from .styles import STYLES

Split = Literal["train", "val", "test"]
SPLITS: tuple[Split, ...] = ("train", "val", "test")
Positive = Annotated[float, Field(gt=0, le=LARGEST, allow_inf_nan=False)]
Share = Annotated[float, Field(ge=0, le=1)]
LONGEST_S = 10_000.0  # of a path


Bounds = tuple[Finite, Finite, Finite, Finite, Finite, Finite]


class _Model(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


def _in_order(bounds: Bounds | None) -> Bounds | None:
    if bounds is not None and not all(a < b for a, b in zip(bounds[:3], bounds[3:], strict=True)):
        raise ValueError("the first corner must lie below the second on every axis")
    return bounds


class SamplingOptions(_Model):
    """What is asked of `framepairs cameras sample`. Equal options give equal files."""

    count: int = Field(54, ge=1, le=10_000, description="paths")
    frames: int = Field(100, ge=2, le=100_000, description="of each path")
    styles: tuple[str, ...] = Field(("calm",), min_length=1, description="of the paths, in turn")
    seed: int = Field(0, ge=0, lt=2**63, description="with a path's number, decides its random choices")
    fps: Rate = Field(24, description="frames per second")
    clearance_m: Positive | None = Field(
        None, description="metres that no path comes closer to any surface; null: 0.3, less in scenes smaller than 4 m"
    )
    cell_m: Positive | None = Field(None, description="metres, horizontal size of the cells; null: fitted to the scene")
    view_distance_m: Positive | None = Field(
        None, description="metres up to which a surface counts as seen; null: 20, less in scenes smaller than 4 m"
    )
    bounds: Bounds | None = Field(
        None, description="least and greatest corner of where cameras may go, scene units; null: fitted to the scene"
    )
    split: tuple[Share, Share, Share] = Field((0.8, 0.1, 0.1), description="shares of train, val and test")
    rays: int = Field(96, ge=16, le=4096, description="per cell, to find free space and surfaces")
    check_rays: int = Field(512, ge=64, le=8192, description="per point of a path, to check its clearance")

    @field_validator("styles")
    @classmethod
    def _known(cls, styles: tuple[str, ...]) -> tuple[str, ...]:
        for name in styles:
            if name not in STYLES:
                raise ValueError(f"must be of {', '.join(STYLES)}, not {name!r}")
        return styles

    @field_validator("split")
    @classmethod
    def _whole(cls, split: tuple[float, float, float]) -> tuple[float, float, float]:
        if abs(sum(split) - 1) > 1e-6:
            raise ValueError(f"the shares add up to {sum(split):g}, not 1")
        return split

    @model_validator(mode="after")
    def _ends(self) -> "SamplingOptions":
        seconds = (self.frames - 1) / self.fps
        if seconds > LONGEST_S:
            raise ValueError(f"{self.frames} frames at {self.fps:g} fps last {seconds:g} s: at most {LONGEST_S:g}")
        return self

    _ordered = field_validator("bounds")(_in_order)


class SamplingHints(_Model):
    """`<stem>.sampling.json` beside a scene: what `framepairs cameras sample` should know of it."""

    version: Literal[1]
    bounds: Bounds = Field(description="least and greatest corner of where cameras may go, scene units; --bounds goes before")

    _ordered = field_validator("bounds")(_in_order)


class PathRecord(_Model):
    """One path of a sampling."""

    file: str = Field(pattern=r"^[A-Za-z0-9_-]+_[0-9]+\.json$", description="camera path, in the same folder")
    style: str
    split: Split
    frames: int
    length_m: float = Field(description="metres along the path")
    speed_m_s: float = Field(description="mean while it moves")
    clearance_m: float = Field(description="least distance to a surface that a ray found, at most 4 times what was asked for")
    turn_deg_s: float = Field(description="largest turn of the viewing direction between two frames, times fps")
    motion_px: float = Field(description="median motion a frame of what stands still, pixels at 960x540")
    cells_seen: int = Field(description="of the cells that count")


class CamerasFile(_Model):
    """`cameras.json`."""

    format: Literal["framepairs-cameras"] = "framepairs-cameras"
    version: Literal[1] = 1
    scene: str = Field(description="bundled name or file, as given")
    scene_sha256: Sha256 = Field(description="over all files of the scene")
    options: SamplingOptions = Field(description="as asked for")
    clearance_m: float = Field(description="that every path keeps")
    cell_m: tuple[float, float, float] = Field(description="size of the cells along the world's axes")
    view_distance_m: float = Field(description="up to which a surface counts as seen")
    has_ground: bool = Field(description="whether heights are over a ground")
    moving_checked: int = Field(description="times of the animation at which every path was checked")
    reachable_cells: int = Field(description="free cells that a camera of these styles can come to")
    cells: int = Field(description="that count: with a surface near a reachable cell")
    cells_seen: int = Field(description="of these, by at least one frame of any path")
    coverage: float = Field(description="cells_seen / cells")
    coverage_of: dict[Split, float] = Field(description="the same for the paths of each split alone")
    paths: list[PathRecord]


@dataclass(frozen=True)
class Sampling:
    """Paths and what is known of them.

    values: JSON of each path file, in the order of `file.paths`. cameras: of each path, [frames, 4, 4] in world space. map:
    [rows, columns] height of the highest surface seen from above, scene units, NaN where there is none, from map_low to
    map_high, [2] in world space along `axes`, the world's axes to the right and down on the map.
    """

    file: CamerasFile
    values: tuple[dict[str, Any], ...]
    cameras: tuple[NDArray[np.float64], ...]
    map: NDArray[np.float32]
    map_low: Vector
    map_high: Vector
    axes: tuple[int, int]
    metres_per_unit: float


def make_options(**values: Any) -> SamplingOptions:
    """Raises InputError naming the option; None stands for its default."""
    try:
        return SamplingOptions.model_validate({key: value for key, value in values.items() if value is not None})
    except ValidationError as error:
        first = error.errors()[0]
        field = ".".join(str(part) for part in first["loc"]) or None
        raise InputError(first["msg"].removeprefix("Value error, "), field=field) from None


def parse_numbers(text: str | None, example: str, field: str) -> tuple[float, ...] | None:
    """Numbers with commas between, as many as `example` has; None for None. Raises InputError naming the option."""
    if text is None:
        return None
    try:
        numbers = tuple(float(part) for part in text.split(","))
    except ValueError:
        numbers = ()
    if len(numbers) != len(example.split(",")):
        raise InputError(f"must look like {example}, not {text!r}", field=field)
    return numbers


def read_cameras(file: Path) -> CamerasFile:
    """Raises InputError naming file and field."""
    return from_json(CamerasFile, file)


def hinted_bounds(scene: Path) -> Bounds | None:
    """Where cameras may go, by the file `<stem>.sampling.json` beside a scene file; None where there is none.

    Raises InputError naming that file and the field, also where it is a link out of the scene's folder.
    """
    file = scene.with_name(f"{scene.stem}.sampling.json")
    if not (file.is_file() or file.is_symlink()):
        return None
    return from_json(SamplingHints, within(reach_of(scene), file.name, file=file)).bounds


def split_paths(middles: NDArray, shares: tuple[float, float, float], seed: int) -> list[Split]:
    """The split of each path by its middle [n, 2] on the map. Neighbours on a walk over the map fall into different splits,
    so that each split has paths all over the scene. With 3 paths or more, each share above 0 has at least one."""
    count = len(middles)
    wanted = np.array(shares) * count
    numbers = np.floor(wanted + 1e-9).astype(int)
    for index in np.argsort(-(wanted - numbers), kind="stable")[: count - numbers.sum()]:
        numbers[index] += 1
    for index in range(3):
        if shares[index] > 0 and numbers[index] == 0 and count >= 3:
            numbers[np.argmax(numbers)] -= 1
            numbers[index] += 1
    order = _walk_over_map(middles)
    result: list[Split] = ["train"] * count
    left = list(order)
    rng = np.random.default_rng([seed, count])
    for name, number in (("test", numbers[2]), ("val", numbers[1])):
        places = np.floor((np.arange(number) + rng.uniform()) * len(left) / max(number, 1)).astype(int)
        for place in places:
            result[left[place]] = name
        left = [index for place, index in enumerate(left) if place not in set(places.tolist())]
    if numbers[0] == 0:  # what is left by rounding
        for index in left:
            result[index] = "val" if shares[1] > 0 else "test"
    return result


def _walk_over_map(middles: NDArray) -> list[int]:
    """Order of points [n, 2] that goes to and fro over the map in about sqrt(n / 2) strips."""
    count = len(middles)
    strips = max(round((count / 2) ** 0.5), 1)
    rank = np.argsort(np.argsort(middles[:, 0], kind="stable"), kind="stable")
    strip = rank * strips // count
    along = np.where(strip % 2 == 0, middles[:, 1], -middles[:, 1])
    return np.lexsort((along, strip)).tolist()
