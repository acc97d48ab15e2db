"""Styles of camera movement: how fast, how high, how it turns. All figures are limits that the sampled path is held to."""

from dataclasses import dataclass

from ..errors import InputError


@dataclass(frozen=True, kw_only=True)
class Shake:
    """Of a hand-held camera: RMS of the place in metres and of the angles in degrees, within a band of frequencies."""

    position_m: float
    rotation_deg: float
    low_hz: float
    high_hz: float


@dataclass(frozen=True, kw_only=True)
class Style:
    """One way to move a camera.

    speed_m_s: range that a path's mean speed while moving is drawn from, where the free space is wide enough. height_m:
    range over the ground. follows_ground: keeps one height over the smoothed ground; else the height is the route's. step_m:
    highest step of the ground; None: any. turn_deg_s: largest turn rate of the viewing direction. gaze_s: seconds between
    chosen viewing directions. off_heading_deg: farthest that the view turns away from where the camera goes. pitch_deg:
    range of the view's elevation. restless: share of turning that is worth as much as seeing new cells. fov_y_deg: range.
    stop_s: range of the holds between moves, seconds; None: it never stops. move_s: range of the moves between holds.
    """

    name: str
    speed_m_s: tuple[float, float]
    height_m: tuple[float, float]
    follows_ground: bool
    step_m: float | None
    turn_deg_s: float
    gaze_s: float
    off_heading_deg: float
    pitch_deg: tuple[float, float]
    restless: float
    fov_y_deg: tuple[float, float]
    stop_s: tuple[float, float] | None = None
    move_s: tuple[float, float] = (0.8, 1.4)
    shake: Shake | None = None


STYLES = {
    style.name: style
    for style in (
        Style(
            name="calm", speed_m_s=(0.7, 1.5), height_m=(0.9, 2.2), follows_ground=True, step_m=0.6,
            turn_deg_s=30, gaze_s=1.2, off_heading_deg=120, pitch_deg=(-15, 15), restless=0, fov_y_deg=(40, 55),
        ),
        Style(
            name="fast", speed_m_s=(5, 10), height_m=(0.5, 6), follows_ground=False, step_m=None,
            turn_deg_s=150, gaze_s=0.6, off_heading_deg=180, pitch_deg=(-30, 25), restless=0.5, fov_y_deg=(50, 70),
        ),
        Style(
            name="stop-and-go", speed_m_s=(2, 4), height_m=(0.9, 2.2), follows_ground=True, step_m=0.6,
            turn_deg_s=150, gaze_s=0.5, off_heading_deg=180, pitch_deg=(-20, 20), restless=0.1, fov_y_deg=(45, 60),
            stop_s=(0.5, 0.9),
        ),
        Style(
            name="hand-held", speed_m_s=(1, 1.8), height_m=(1.3, 1.9), follows_ground=True, step_m=0.6,
            turn_deg_s=75, gaze_s=0.9, off_heading_deg=100, pitch_deg=(-20, 15), restless=0, fov_y_deg=(45, 60),
            shake=Shake(position_m=0.012, rotation_deg=0.35, low_hz=0.5, high_hz=3),
        ),
        Style(
            name="vehicle", speed_m_s=(8, 15), height_m=(1, 2), follows_ground=True, step_m=0.4,
            turn_deg_s=75, gaze_s=0.6, off_heading_deg=30, pitch_deg=(-8, 5), restless=0, fov_y_deg=(45, 60),
        ),
    )
}  # fmt: skip


def styles_of(names: tuple[str, ...]) -> tuple[Style, ...]:
    """The styles of those names, in their order. Raises InputError for a name that is none."""
    for name in names:
        if name not in STYLES:
            raise InputError(f"must be one of {', '.join(STYLES)}, not {name!r}", field="style")
    return tuple(STYLES[name] for name in names)
