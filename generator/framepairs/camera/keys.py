"""What camera paths are written with: keyframes, poses, and what follows or shakes. The meaning is in docs/camera_paths.md."""

import math
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag, model_validator

LARGEST, SMALLEST = 1e12, 1e-12  # so that no product of them overflows or vanishes
Finite = Annotated[float, Field(ge=-LARGEST, le=LARGEST, allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, ge=SMALLEST, le=LARGEST, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, le=LARGEST, allow_inf_nan=False)]
Point = tuple[Finite, Finite, Finite]
Row = tuple[Finite, Finite, Finite, Finite]
FieldOfView = Annotated[float, Field(gt=0, ge=1e-6, lt=180)]
Exposure = Annotated[float, Field(ge=-32, le=32)]
Shift = tuple[Finite, Finite]
Rate = Annotated[float, Field(gt=0, ge=1e-6, le=1000)]

SHORTEST_S = 1e-9  # of a hold

TAGS = ("as a point", "as an object", "as a word")  # of the forms of look_at; pydantic puts them into its locations


class Keys(BaseModel):
    """Unknown keys are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class ObjectPoint(Keys):
    """A point that goes along with an object of the scene."""

    object: str = Field(description="name of an object, or of a group of objects NAME/...")
    offset: Point = Field((0, 0, 0), description="from the middle of its bounds, scene units, world axes")


def _form(value: object) -> str:
    return TAGS[1] if isinstance(value, dict | ObjectPoint) else TAGS[2] if isinstance(value, str) else TAGS[0]


AsPoint, AsObject = Annotated[Point, Tag(TAGS[0])], Annotated[ObjectPoint, Tag(TAGS[1])]
Target = Annotated[AsPoint | AsObject, Discriminator(_form)]
Look = Annotated[AsPoint | AsObject | Annotated[Literal["ahead"], Tag(TAGS[2])], Discriminator(_form)]

OwnFov = Annotated[FieldOfView | None, Field(description="vertical field of view, degrees; null: the path's")]
OwnFocal = Annotated[Positive | None, Field(description="focal length in millimetres instead; null: the path's")]
OwnHeight = Annotated[Positive | None, Field(description="of an orthographic view, scene units; null: the path's")]
OwnShift = Annotated[Shift | None, Field(description="of the image, fractions of the frame; null: the path's")]
OwnExposure = Annotated[Exposure | None, Field(description="display = colour * 2^exposure_ev; null: the path's")]
OwnRate = Annotated[Rate | None, Field(description="frames per second from here on; null: as before")]
Cut = Annotated[bool, Field(description="a new shot begins here")]


class Keyframe(Keys):
    """One keyframe: a place and exactly one of `look_at` and `quaternion`; where the path has `follow`, neither is needed."""

    time: Finite = Field(description="seconds")
    position: Point | None = Field(None, description="scene units; null: where `follow` is")
    look_at: Target | None = Field(None, description="what is at the image's centre: a point, or an object with an offset")
    quaternion: Row | None = Field(None, description="world_from_camera rotation as w, x, y, z")
    speed: NotNegative | None = Field(None, description="of the camera here, scene units per second; null: a smooth one")
    roll_deg: Finite = Field(0, description="about the viewing axis; positive: the camera turns clockwise, seen from behind")
    fov_y_deg: OwnFov = None
    focal_length_mm: OwnFocal = None
    height: OwnHeight = None
    lens_shift: OwnShift = None
    exposure_ev: OwnExposure = None
    hold: NotNegative = Field(0, description="seconds to stand still from here")
    animation: Literal["stops", "runs"] = Field("stops", description="what the scene's time does during the hold")
    cut: Cut = False
    fps: OwnRate = None

    @model_validator(mode="after")
    def _consistent(self) -> "Keyframe":
        if self.look_at is not None and self.quaternion is not None:
            raise ValueError("give exactly one of look_at and quaternion")
        if self.quaternion is not None and math.hypot(*self.quaternion) < SMALLEST:
            raise ValueError("quaternion has length zero")
        if self.look_at is not None and self.look_at == self.position:
            raise ValueError("look_at is the position itself")
        if 0 < self.hold < SHORTEST_S:
            raise ValueError(f"hold: is 0 or at least {SHORTEST_S:g} s")
        if self.hold > 0 and self.speed:
            raise ValueError("speed is not 0 where the camera holds")
        return refuse_two_lenses(self)


class Pose(Keys):
    """One explicit pose."""

    time: Finite = Field(description="seconds")
    world_from_camera: tuple[Row, Row, Row, Row] = Field(description="rigid 4x4 matrix, row major")
    fov_y_deg: OwnFov = None
    focal_length_mm: OwnFocal = None
    height: OwnHeight = None
    lens_shift: OwnShift = None
    exposure_ev: OwnExposure = None
    cut: Cut = False
    fps: OwnRate = None

    @model_validator(mode="after")
    def _rigid(self) -> "Pose":
        matrix = np.array(self.world_from_camera)
        rotation = matrix[:3, :3]
        if not np.allclose(rotation.T @ rotation, np.eye(3), atol=1e-4) or np.linalg.det(rotation) < 0:
            raise ValueError("world_from_camera is not a rotation and translation")
        if not np.array_equal(matrix[3], [0, 0, 0, 1]):
            raise ValueError("the last row of world_from_camera is not 0 0 0 1")
        return refuse_two_lenses(self)


class Shake(Keys):
    """Seeded noise of place and direction in a band of frequencies, in camera axes."""

    position: NotNegative = Field(0, description="root mean square of the displacement, scene units")
    rotation_deg: NotNegative = Field(0, description="root mean square of the angle of turn, degrees")
    low_hz: NotNegative = Field(0.5, description="lower end of the band")
    high_hz: Positive = Field(6, description="upper end of the band")
    seed: Annotated[int, Field(ge=0, lt=2**63)] = Field(0, description="another seed, other noise of the same kind")
    fade_s: Positive = Field(0.25, description="seconds in which it fades before and after a hold")

    @model_validator(mode="after")
    def _band(self) -> "Shake":
        if self.low_hz > self.high_hz:
            raise ValueError("low_hz is greater than high_hz")
        return self


class Follow(Keys):
    """The camera hangs behind an object on a damped spring; keyframes then give direction and lens alone."""

    object: str = Field(description="name of an object, or of a group of objects NAME/...")
    offset: Point = Field((0, 0, 0), description="of the camera's target from the middle of its bounds, scene units")
    offset_space: Literal["object", "world"] = Field("object", description="axes of the offset")
    stiffness: Annotated[float, Field(gt=0, le=1e15)] = Field(20, description="of the spring, 1 / seconds^2")
    damping_ratio: Annotated[float, Field(gt=0, le=1e6)] = Field(1, description="1: as fast as it goes without overshoot")


def refuse_two_lenses(keys):
    if keys.fov_y_deg is not None and keys.focal_length_mm is not None:
        raise ValueError("give one of fov_y_deg and focal_length_mm")
    return keys
