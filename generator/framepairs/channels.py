"""The channel table: what each channel of a corpus is called, holds, and means. Everything else iterates it."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal


@dataclass(frozen=True, kw_only=True)
class Channel:
    """One row of the table.

    exr: names of the components inside the EXR file, in the order of the array's last axis. dtype: as stored.
    averaged: in HR, the mean over the AA samples (otherwise one sample at the pixel centre). background: its value where
    no surface is hit, per component, or None where the sky has a value of its own. needed_by: which scenes need it.
    """

    name: str
    exr: tuple[str, ...]
    dtype: Literal["half", "float", "uint"]
    unit: str
    frame_of_reference: str
    meaning: str
    needed_by: str
    averaged: bool = False
    background: tuple[float, ...] | None = None

    @property
    def components(self) -> int:
        return len(self.exr)

    @property
    def bytes_per_pixel(self) -> int:
        return self.components * (2 if self.dtype == "half" else 4)


RGB, XYZ, XY, V, I = ("R", "G", "B"), ("X", "Y", "Z"), ("X", "Y"), ("V",), ("I",)

CHANNELS: tuple[Channel, ...] = (
    Channel(
        name="color", exr=RGB, dtype="half", unit="radiance, scene-linear Rec. 709", frame_of_reference="none",
        averaged=True, meaning="unexposed colour of everything that is drawn", needed_by="every scene",
    ),
    Channel(
        name="color_variance", exr=RGB, dtype="float", unit="squared radiance", frame_of_reference="none", averaged=True,
        background=(0, 0, 0), meaning="variance of color as a mean over light paths", needed_by="path shading",
    ),
    Channel(
        name="emission", exr=RGB, dtype="half", unit="radiance, scene-linear Rec. 709", frame_of_reference="none",
        averaged=True, meaning="emitted radiance; the sky's radiance in the background",
        needed_by="scenes with a visible sky or an emissive material",
    ),
    Channel(
        name="albedo", exr=RGB, dtype="half", unit="reflectance, linear Rec. 709", frame_of_reference="none",
        background=(0, 0, 0), meaning="base colour", needed_by="scenes whose base colour is not one constant",
    ),
    Channel(
        name="normal", exr=XYZ, dtype="half", unit="unit vector", frame_of_reference="world", background=(0, 0, 0),
        meaning="shading normal, turned towards the camera", needed_by="every scene",
    ),
    Channel(
        name="depth", exr=V, dtype="float", unit="scene units", frame_of_reference="camera",
        background=(float("inf"),), meaning="linear z along the viewing axis, positive", needed_by="every scene",
    ),
    Channel(
        name="roughness", exr=V, dtype="half", unit="0 to 1", frame_of_reference="none", background=(0,),
        meaning="perceptual roughness; alpha = roughness^2, or roughness (plan)",
        needed_by="scenes whose roughness is not one constant",
    ),
    Channel(
        name="metallic", exr=V, dtype="half", unit="0 to 1", frame_of_reference="none", background=(0,),
        meaning="0 dielectric, 1 metal", needed_by="scenes with metal",
    ),
    Channel(
        name="specular", exr=V, dtype="half", unit="0 to 1", frame_of_reference="none", background=(0,),
        meaning="dielectric F0 = 0.08 * specular", needed_by="scenes whose specular is not one constant",
    ),
    Channel(
        name="object_id", exr=I, dtype="uint", unit="index", frame_of_reference="none", background=(0,),
        meaning="1 + index of the leaf instance, constant over a sequence", needed_by="every scene",
    ),
    Channel(
        name="motion", exr=XY, dtype="float", unit="pixels of its own buffer, y down", frame_of_reference="image",
        meaning="previous minus current place of the surface point, without jitter, not dilated",
        needed_by="sequences in which the camera or an object moves",
    ),
    Channel(
        name="dual_motion", exr=XY, dtype="float", unit="pixels of its own buffer, y down", frame_of_reference="image",
        meaning="y - z: y = x + motion(x), z = present place of the surface that was visible at y before",
        needed_by="sequences in which an object moves or the camera translates",
    ),
    Channel(
        name="visibility", exr=I, dtype="uint", unit="bits", frame_of_reference="previous image",
        meaning="bit 0 inside the previous frame, 1 in front of the previous camera, 2 seen by it",
        needed_by="sequences in which the camera or an object moves",
    ),
    Channel(
        name="brdf", exr=RGB, dtype="half", unit="reflectance, linear Rec. 709", frame_of_reference="none",
        averaged=True, background=(0, 0, 0), meaning="pre-integrated F_beta = (1 - metallic) albedo + F0 A + F90 B",
        needed_by="every scene",
    ),
    Channel(
        name="transparency", exr=V, dtype="half", unit="0 to 1", frame_of_reference="none", averaged=True,
        background=(0,), meaning="1 - transmittance of the blended layers in front of the G-buffer's surface",
        needed_by="scenes with blended materials",
    ),
    Channel(
        name="overlay", exr=V, dtype="half", unit="0 to 1", frame_of_reference="none", averaged=True, background=(0,),
        meaning="coverage by text and images that are drawn without depth or motion", needed_by="scenes with overlays",
    ),
)

CHANNEL = {channel.name: channel for channel in CHANNELS}


def motion_name(offset: int) -> str:
    """The channel that leads to the frame `offset` frames later: `motion` for -1, `motion_m2` for -2, `motion_p1` for 1."""
    return "motion" if offset == -1 else f"motion_{'m' if offset < 0 else 'p'}{abs(offset)}"


def channels_with(offsets: Sequence[int]) -> tuple[Channel, ...]:
    """The table, and a row for motion to each further frame offset."""
    return CHANNELS + tuple(_motion_row(offset) for offset in offsets)


def channel_named(name: str) -> Channel | None:
    """The row of a name, also of motion to any frame offset; None where there is none."""
    further = re.fullmatch(r"motion_([mp])([1-9][0-9]{0,3})", name)
    if further and name != "motion_m1":
        return _motion_row(int(further[2]) * (-1 if further[1] == "m" else 1))
    return CHANNEL.get(name)


def _motion_row(offset: int) -> Channel:
    frames = f"{abs(offset)} frame{'s' if abs(offset) > 1 else ''} {'before' if offset < 0 else 'after'}"
    meaning = f"place of the surface point {frames} minus its current place, without jitter, not dilated"
    needed_by = "plans that ask for it, of sequences in which the camera or an object moves"
    return replace(CHANNEL["motion"], name=motion_name(offset), meaning=meaning, needed_by=needed_by)


MOTION_CHANNELS = ("motion", "dual_motion", "visibility")
INSIDE_PREVIOUS_FRAME, IN_FRONT_OF_PREVIOUS_CAMERA, SEEN_BY_PREVIOUS_CAMERA = 1, 2, 4


def seen_before(bits):
    """Where `visibility` says that the previous frame shows the surface: inside it, and seen. NumPy's arrays and Dr.Jit's."""
    wanted = INSIDE_PREVIOUS_FRAME | SEEN_BY_PREVIOUS_CAMERA
    return (bits & wanted) == wanted
