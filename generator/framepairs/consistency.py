"""Whether motion leads to where a surface was: the previous frame's position, id, albedo and normal, warped to the present.

Judged are pixels that the previous frame saw, away from the edges of objects by a band of pixels in both frames. Position is
reprojected from depth with the stored matrices. Albedo is held against the range of the four pixels around the place, normals
against the most alike of them: samples of a texture or of an edge differ from a bilinear look-up without any fault.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .backend import dr, jit
from .channels import IN_FRONT_OF_PREVIOUS_CAMERA, INSIDE_PREVIOUS_FRAME, SEEN_BY_PREVIOUS_CAMERA
from .corpus import Corpus
from .errors import InputError
from .manifest import CameraRecord
from .reprojection import residuals
from .warp import Image, bilinear, corners, fetch, nearest, pixel_centres, range_around, to_image

TOLERANCE_PX = 0.05
# albedo and normal: past these the code of DFASR 2024 takes surfaces for different (its masks of equations 4 and 5)
TOLERANCES = {"object_id": 0.0, "position": TOLERANCE_PX, "albedo": 0.1, "normal": float(np.degrees(np.arccos(0.9)))}
UNITS = {
    "object_id": "1 where another object is found",
    "position": "px",
    "albedo": "mean distance from the range",
    "normal": "degrees",
}
PERCENTILES = (50, 90, 99, 100)
BAND = 1  # pixels
NEEDED = ("object_id", "depth", "motion", "visibility")
ALL_SEEN = INSIDE_PREVIOUS_FRAME | IN_FRONT_OF_PREVIOUS_CAMERA | SEEN_BY_PREVIOUS_CAMERA
GREY, RED, DARK = (128, 128, 128), (220, 40, 40), (24, 24, 24)


@dataclass(frozen=True, kw_only=True)
class WarpConsistency:
    """Over pixels that the previous frame saw, away from edges of objects by one pixel: how many there are, the share that
    lands on its own object, the share that lands within 0.05 px of its surface point, and the residuals' percentiles."""

    pixels: int
    same_object: float
    same_place: float
    residual_median: float
    residual_p99: float


@dataclass(frozen=True, kw_only=True)
class Measure:
    """One measure of one frame, or of many.

    name: of TOLERANCES; errors are in UNITS[name]. pixels: judged ones. consistent: share within the tolerance (1 without any).
    percentiles: at PERCENTILES, errors that occur (the next higher); NaN without pixels, infinite behind the previous camera.
    """

    name: str
    pixels: int
    consistent: float
    percentiles: tuple[float, float, float, float]


@dataclass(frozen=True, kw_only=True)
class FrameConsistency:
    """The measures of one frame, by name."""

    frame: int
    measures: dict[str, Measure]


def warp_consistency(
    now: dict[str, NDArray],
    before: dict[str, NDArray],
    camera: CameraRecord,
    jitter: tuple[float, float],
    previous_jitter: tuple[float, float],
    moving: list[int],
    deforming: list[int] = (),
) -> WarpConsistency:
    """`now` and `before`: object_id, depth, motion and visibility of one stream in two frames that follow each other.
    moving, deforming: the ids of animated objects, and of those among them whose vertices move."""
    now, before = ({name: arrays[name] for name in NEEDED} for arrays in (now, before))
    errors = warp_errors(now, before, camera, jitter, previous_jitter, moving, deforming)
    other_object = errors["object_id"][~np.isnan(errors["object_id"])]
    if not len(other_object):
        return WarpConsistency(pixels=0, same_object=1.0, same_place=1.0, residual_median=0.0, residual_p99=0.0)
    residual = errors["position"][np.isfinite(errors["position"])]
    residual = residual if len(residual) else np.zeros(1)
    return WarpConsistency(
        pixels=len(other_object),
        same_object=float((other_object == 0).mean()),
        same_place=float((residual <= TOLERANCE_PX).mean()),
        residual_median=float(np.median(residual)),
        residual_p99=float(np.percentile(residual, 99)),
    )


def warp_errors(
    now: dict[str, NDArray],
    before: dict[str, NDArray],
    camera: CameraRecord,
    jitter: tuple[float, float],
    previous_jitter: tuple[float, float],
    moving: list[int],
    deforming: list[int] = (),
    band: int = BAND,
) -> dict[str, NDArray]:
    """[height, width] float64 per measure, in UNITS; NaN where a pixel is not judged.

    `now` and `before`: of two frames that follow each other, one stream's object_id, depth, motion, visibility and, to be
    measured, albedo and normal. moving: the ids of animated objects; not judged are their normals, which may turn with them,
    and positions of those with fewer than 32 pixels or that are `deforming`, too. band: pixels around a judged one that hold
    the same object.
    """
    motion = to_image(now["motion"])
    identity, old_identity = to_image(now["object_id"]), to_image(before["object_id"])
    width, height = motion.width, motion.height
    centre_x, centre_y = pixel_centres(width, height)
    x, y = centre_x - dr.opaque(jit.Float, jitter[0]), centre_y - dr.opaque(jit.Float, jitter[1])
    old_x, old_y = x + motion.planes[0], y + motion.planes[1]
    # the pixel of the previous buffer that holds the place p is the one whose centre is nearest to p + J
    in_old_x = old_x + dr.opaque(jit.Float, previous_jitter[0])
    in_old_y = old_y + dr.opaque(jit.Float, previous_jitter[1])
    inside = (centre_x > band) & (centre_x < width - band) & (centre_y > band) & (centre_y < height - band)
    inside &= _uniform(identity, centre_x, centre_y, band) & _uniform(old_identity, in_old_x, in_old_y, band)
    judged = inside & ((to_image(now["visibility"]).planes[0] & ALL_SEEN) == ALL_SEEN)
    same = nearest(old_identity, in_old_x, in_old_y)[0] == identity.planes[0]
    warped = {"inverse_depth": bilinear(to_image(1 / before["depth"]), in_old_x, in_old_y)}
    if "normal" in now and "normal" in before:
        warped["chord"] = _chord(to_image(now["normal"]), to_image(before["normal"]), in_old_x, in_old_y)
    if "albedo" in now and "albedo" in before:
        warped["albedo"] = _out_of_range(to_image(now["albedo"]), to_image(before["albedo"]), in_old_x, in_old_y)
    dr.eval(judged, same, old_x, old_y, warped, x, y)
    pick = np.flatnonzero(np.array(judged))
    ids = now["object_id"].ravel()[pick]
    old = {name: np.stack([np.array(p)[pick] for p in planes], axis=-1).astype(float) for name, planes in warped.items()}
    fractions = [np.array(v)[pick] / extent for v, extent in ((x, width), (y, height), (old_x, width), (old_y, height))]
    residual = residuals(
        ids=ids,
        inverse_depth=1 / now["depth"].ravel()[pick].astype(np.float64),
        old_inverse_depth=old["inverse_depth"][:, 0],
        place=np.stack(fractions[:2], axis=1).astype(np.float64),
        old_place=np.stack(fractions[2:], axis=1).astype(np.float64),
        camera=camera,
        moving=moving,
        deforming=deforming,
        size=np.array([width, height]),
    )
    errors = {"object_id": 1.0 - np.array(same)[pick], "position": residual}
    if "albedo" in old:
        errors["albedo"] = old["albedo"].mean(axis=1)
    if "chord" in old:
        angle = np.degrees(2 * np.arcsin(np.minimum(old["chord"][:, 0] / 2, 1)))
        errors["normal"] = np.where(np.isin(ids, moving), np.nan, angle)
    maps = {name: np.full((height, width), np.nan) for name in errors}
    for name, values in errors.items():
        maps[name].flat[pick] = values
    return maps


def summarise_errors(name: str, errors: NDArray) -> Measure:
    """The Measure of a map of errors (or of several, stacked); NaN is not judged."""
    known = errors[~np.isnan(errors)]
    if not len(known):
        return Measure(name=name, pixels=0, consistent=1.0, percentiles=(np.nan,) * 4)
    share = float((known <= TOLERANCES[name]).mean())
    percentiles = tuple(float(value) for value in np.percentile(known, PERCENTILES, method="higher"))
    return Measure(name=name, pixels=len(known), consistent=share, percentiles=percentiles)


def frame_errors(corpus: Corpus, sequence: str, stream: str, frame: int, band: int = BAND) -> dict[str, NDArray]:
    """`warp_errors` of a frame and the one before it.

    Raises InputError where no frame of the same shot precedes it, or the corpus lacks motion, visibility, depth or ids.
    """
    record = corpus.record(sequence, frame)
    if record.reset or frame - 1 not in corpus.frames(sequence):
        raise InputError("no frame of the same shot precedes it", file=corpus.folder, frame=frame, field=sequence)
    entry = corpus.sequence(sequence)
    optional = [name for name in ("albedo", "normal") if name in entry.channels or name in entry.constants]
    now, before = (
        {name: corpus.read(sequence, stream, name, number) for name in (*NEEDED, *optional)} for number in (frame, frame - 1)
    )
    jitters = (corpus.record(sequence, number).streams[stream].jitter for number in (frame, frame - 1))
    return warp_errors(now, before, record.camera, *jitters, entry.moving, entry.deforming, band)


def sequence_consistency(corpus: Corpus, sequence: str, stream: str, band: int = BAND) -> Iterator[FrameConsistency]:
    """The measures of every frame that another of its shot precedes, in order. Raises InputError as `frame_errors`."""
    frames = corpus.frames(sequence)
    for frame in frames:
        if frame - 1 in frames and not corpus.record(sequence, frame).reset:
            errors = frame_errors(corpus, sequence, stream, frame, band)
            yield FrameConsistency(frame=frame, measures={name: summarise_errors(name, e) for name, e in errors.items()})


def summarise_sequence(results: list[FrameConsistency]) -> list[dict]:
    """For each measure that judges a pixel of any frame: its worst frame's share and percentiles, as plain data."""
    rows = []
    for name in TOLERANCES:
        for worst in worst_frames(results, name, 1):
            measure = worst.measures[name]
            shares = dict(zip((f"p{p}" for p in PERCENTILES), measure.percentiles, strict=True))
            rows.append({"measure": name, "frame": worst.frame, "consistent": measure.consistent, **shares})
    return rows


def worst_frames(results: list[FrameConsistency], name: str, count: int = 3) -> list[FrameConsistency]:
    """Of those that judge `name`, the frames with the smallest share consistent; among equals the largest 99th percentile."""
    judged = [result for result in results if name in result.measures and result.measures[name].pixels]
    return sorted(judged, key=lambda r: (r.measures[name].consistent, -r.measures[name].percentiles[2]))[:count]


def consistency_picture(errors: dict[str, NDArray]) -> NDArray[np.uint8]:
    """[height, width, 3]: grey where a pixel is judged and every measure of `errors` is within its tolerance, red where one
    is not, dark where no measure judges it."""
    judged = np.any([~np.isnan(values) for values in errors.values()], axis=0)
    wrong = np.any([values > TOLERANCES[name] for name, values in errors.items()], axis=0)
    picture = np.where(judged[..., None], np.uint8(GREY), np.uint8(DARK))
    picture[wrong] = RED
    return picture


def _out_of_range(now: Image, before: Image, x, y) -> list:
    """How far each plane of `now` lies outside the range of the four pixels of `before` around a place; 0 inside."""
    lowest, highest = range_around(before, x, y)
    return [dr.maximum(dr.maximum(a - v, v - b), 0) for a, v, b in zip(lowest, now.planes, highest, strict=True)]


def _chord(now: Image, before: Image, x, y) -> list:
    """[1] the least distance, 0 to 2, between a unit normal and those of the four pixels of `before` around a place; NaN
    where there is no normal."""
    normal, least = _unit(now.planes), jit.Float(math.inf)
    for corner in corners(before, x, y):
        least = dr.minimum(least, dr.sqrt(sum(dr.square(a - b) for a, b in zip(normal, _unit(corner), strict=True))))
    return [dr.select(dr.isnan(normal[0]), math.nan, least)]


def _unit(vector) -> list:
    """Of stored length 1 to half precision; NaN for (0, 0, 0)."""
    length = dr.sqrt(sum(dr.square(v) for v in vector))
    return [v / length for v in vector]


def _uniform(identity: Image, x, y, band: int) -> jit.Bool:
    """Whether the pixels around a place, up to `band` away, have one id."""
    i, j = jit.Int32(dr.floor(x)), jit.Int32(dr.floor(y))
    centre = fetch(identity, i, j)[0]
    same = jit.Bool(True)
    for row in range(-band, band + 1):
        for column in range(-band, band + 1):
            same &= fetch(identity, i + column, j + row)[0] == centre
    return same
