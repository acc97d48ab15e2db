"""What the upscalers can be told: one frozen dataclass. Every published figure was made with its defaults."""

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True, kw_only=True)
class UpscaleSettings:
    """Lengths are in display pixels where nothing else is said; a weight of 1 is that of a sample at the pixel's centre.

    The spread of one sample
        kernel: `gaussian`, or `radial_lanczos`, which is FSR 2's (0.1 to 0.4 dB less on the bundled scenes, 2x and 3x).
        still_sigma, moving_sigma: of the Gaussian for a surface that stands, and for one that moves by a pixel a frame or
        more: what is resampled each frame loses detail anyway, and wider samples are less noisy.
        wide: weight of a second Gaussian as wide as the LR pixel, which fills places where no sample fell.
        least_weight: that a sample counts with at least, so that no place is left without any.

    What is remembered, as a weight
        most_still, most_moving: of `temporal`, for surfaces that stand and that move; `oracle` remembers what stands without
        end. accumulate_most_moving, guided_most_moving: of these methods.
        current: weight, in what is shown only, of the present frame's bicubic, falling to 0 at `current_until`.

    When history is believed
        separation: least relative depth, per pixel of the LR diagonal, between an occluder and what it hid (Akeley and Su
        2006, as in FSR 2). slope, most_slope: how many times the depth's own change between neighbours is added, and the
        most that change may be, relative to depth. least_parting: pixels per frame by which an occluder must move otherwise
        than what it hid, to count in full.
        light_step, light_share: relative change of luminance that counts, and the share of 7x7 LR pixels that must change by it
        the same way, before history of what stands still is doubted.
        still_sigmas, moving_sigmas: half-size of the ellipsoid of colours, in deviations of the 3x3 neighbourhood, for
        surfaces that stand, and for those that move by `fast` or that were hidden; luma_factor: its luma axis is longer.
        temporal_sigmas: half-size added per deviation over time of surfaces that stand: thin things stay where a frame
        misses them. oracle_sigmas: of `oracle`, share of that for surfaces that move, too. memory: of that deviation.
        compression: colours of what moves are blended as c / (1 + compression max(c)), after exposure (Karis 2014); 0: linear.

    Guides (HR G-buffers)
        depth_tolerance: relative distance to the HR pixel's plane at which a sample counts exp(-1). normal_power: of the
        cosine between normals. other_object: factor for samples of another object. lighting_sigma: LR pixels, of the spatial
        weight. antialiasing_sigma: of the Gaussian over 3x3 that gives edges both sides' lighting. guided_moving_sigma: as
        moving_sigma, of lighting. guided: weight of the bilateral lighting against accumulated samples, falling as
        1 / (1 + guided_decay weight).
    """

    kernel: Literal["gaussian", "radial_lanczos"] = "gaussian"
    still_sigma: float = 0.35
    moving_sigma: float = 1.0
    wide: float = 2e-3
    least_weight: float = 1e-3

    most_still: float = 16.0
    most_moving: float = 1.0
    accumulate_most_moving: float = 6.0
    guided_most_moving: float = 2.0
    current: float = 0.05
    current_until: float = 1.0

    separation: float = 1.37e-5
    slope: float = 2.0
    most_slope: float = 0.1
    least_parting: float = 0.1
    light_step: float = 0.1
    light_share: float = 0.5
    still_sigmas: float = 3.0
    moving_sigmas: float = 2.0
    fast: float = 20.0
    luma_factor: float = 1.7
    temporal_sigmas: float = 4.0
    oracle_sigmas: float = 0.5
    memory: float = 0.1
    compression: float = 1.0

    depth_tolerance: float = 0.02
    normal_power: float = 32.0
    other_object: float = 0.01
    lighting_sigma: float = 0.6
    antialiasing_sigma: float = 0.5
    guided_moving_sigma: float = 0.6
    guided: float = 0.3
    guided_decay: float = 4.0


DEFAULTS = UpscaleSettings()
