"""Moves: how a camera travels, one after another, for those who would rather not write keyframes (docs/camera_paths.md).

Each move begins where the last one ended, unless it has `cut`. Angles are in degrees: a yaw of 0 looks along -z where y is up
(+y where z is up, +z where x is), and grows to the left; a pitch grows upwards. An orbit's angle is the yaw of the camera that
looks at the centre.
"""

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from .keys import (
    Cut,
    Exposure,
    FieldOfView,
    Finite,
    Keys,
    Look,
    OwnRate,
    Point,
    Positive,
    Shift,
    Target,
    refuse_two_lenses,
)
from .splines import catmull_rom

Turn = Annotated[float, Field(ge=-36000, le=36000)]
Pitch = Annotated[float, Field(ge=-90, le=90)]
Ease = Literal["in_out", "none"]


class _Move(Keys):
    """What every move has. Lens, roll and exposure are those of its end, reached from those of the last move's end; at the
    begin of a shot they are there at once, and "as before" is as the path has it."""

    fov_y_deg: FieldOfView | None = Field(None, description="vertical field of view at the end, degrees; null: as before")
    focal_length_mm: Positive | None = Field(None, description="focal length at the end, instead; null: as before")
    height: Positive | None = Field(None, description="of an orthographic view at the end, scene units; null: as before")
    lens_shift: Shift | None = Field(None, description="of the image at the end, fractions of the frame; null: as before")
    exposure_ev: Exposure | None = Field(None, description="at the end, display = colour * 2^exposure_ev; null: as before")
    roll_deg: Finite | None = Field(None, description="at the end; positive: clockwise, seen from behind; null: as before")
    cut: Cut = False
    fps: OwnRate = None

    @model_validator(mode="after")
    def _lens(self):
        return refuse_two_lenses(self)

    @property
    def seconds(self) -> float:
        return self.duration


class Orbit(_Move):
    """Around a point or an object, looking at it."""

    move: Literal["orbit"] = Field(description="kind of the move")
    duration: Positive = Field(description="seconds")
    center: Target = Field(description="a point, or an object with an offset, which the orbit goes along with")
    radius: Positive = Field(description="scene units")
    elevation_deg: Annotated[float, Field(gt=-90, lt=90)] = Field(0, description="of the camera above the centre at the begin")
    from_deg: Turn = Field(0, description="yaw of the camera at the begin")
    to_deg: Turn = Field(description="yaw of the camera at the end")
    rise: Finite = Field(0, description="scene units up during the move")
    ease: Ease = Field("in_out", description="in_out: from rest to rest; none: at constant speed")


class Dolly(_Move):
    """Along a straight line."""

    move: Literal["dolly"] = Field(description="kind of the move")
    duration: Positive = Field(description="seconds")
    from_position: Point | None = Field(None, description="null: where the last move ended")
    to_position: Point = Field(description="scene units")
    look_at: Target | None = Field(None, description="null: in a fixed direction")
    yaw_deg: Turn | None = Field(None, description="of the fixed direction; null: that of the last move's end")
    pitch_deg: Pitch | None = Field(None, description="of the fixed direction; null: that of the last move's end")
    ease: Ease = Field("in_out", description="in_out: from rest to rest; none: at constant speed")

    @model_validator(mode="after")
    def _one_direction(self) -> "Dolly":
        if self.look_at is not None and (self.yaw_deg is not None or self.pitch_deg is not None):
            raise ValueError("give either look_at or yaw_deg and pitch_deg")
        return self


class FlyThrough(_Move):
    """Along a smooth curve through points."""

    move: Literal["fly_through"] = Field(description="kind of the move")
    duration: Positive | None = Field(None, description="seconds")
    speed: Positive | None = Field(None, description="mean speed in scene units per second, instead of duration")
    points: Annotated[tuple[Point, ...], Field(min_length=2)] = Field(description="scene units")
    look: Look = Field("ahead", description="ahead along the curve, or at a point or object")
    look_ahead: Positive | None = Field(None, description="distance of what is looked at ahead; null: 1/20 of the curve")
    ease: Ease = Field("in_out", description="in_out: from rest to rest; none: at constant speed")

    @model_validator(mode="after")
    def _timed(self) -> "FlyThrough":
        if (self.duration is None) == (self.speed is None):
            raise ValueError("give exactly one of duration and speed")
        if len(set(self.points)) == 1:
            raise ValueError("points are all the same")
        return self

    @property
    def seconds(self) -> float:
        if self.duration is not None:
            return self.duration
        return float(catmull_rom(np.array(self.points))[0].lengths[-1]) / self.speed


class Pan(_Move):
    """Turns on the spot."""

    move: Literal["pan"] = Field(description="kind of the move")
    duration: Positive = Field(description="seconds")
    position: Point | None = Field(None, description="null: where the last move ended")
    from_yaw_deg: Turn | None = Field(None, description="null: that of the last move's end")
    from_pitch_deg: Pitch | None = Field(None, description="null: that of the last move's end")
    to_yaw_deg: Turn | None = Field(None, description="null: as at the begin")
    to_pitch_deg: Pitch | None = Field(None, description="null: as at the begin")
    ease: Ease = Field("in_out", description="in_out: from rest to rest; none: at constant rate")


class Hold(_Move):
    """Keeps the last view to the last bit."""

    move: Literal["hold"] = Field(description="kind of the move")
    duration: Positive = Field(description="seconds")
    animation: Literal["stops", "runs"] = Field("stops", description="what the scene's time does meanwhile")

    @model_validator(mode="after")
    def _keeps(self) -> "Hold":
        own = ("cut", "fov_y_deg", "focal_length_mm", "height", "lens_shift", "exposure_ev", "roll_deg")
        changed = [name for name in own if getattr(self, name) not in (None, False)]
        if changed:
            raise ValueError(f"a hold keeps the last view: it has no {changed[0]}")
        return self


MOVES = ("orbit", "dolly", "fly_through", "pan", "hold")
Move = Annotated[Orbit | Dolly | FlyThrough | Pan | Hold, Field(discriminator="move")]
