"""The light of a varied scene: its hour and weather, its own sky turned, and its lamps."""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .daylight import NOON_DEG, irradiance, luminance, sky, sun_direction, sun_irradiance
from .description import Environment, Light, SceneDescription, rotation_from_y_up
from .mitsuba_spectra import emission_of_spectrum
from .variation_draws import Draws, matching
from .variation_file import Daylight, EnvironmentRule, LightRule, Variation

WHITE_KELVIN = 6500.0
LEAST_SHARE = 1e-3  # of a clear noon's light: adaptation takes darker hours for this
Change = Callable[[Light], Light]


def vary_light(scene: SceneDescription, variation: Variation, seed: int, file: Path | None) -> SceneDescription:
    """The scene in another light. Raises InputError for patterns that match nothing."""
    if variation.daylight is not None:
        scene = _in_daylight(scene, variation.daylight, seed, file)
    if variation.environment is not None:
        scene = _turned(scene, variation.environment, seed)
    for number, rule in enumerate(variation.lights):
        scene = _relit(scene, rule, Draws(seed, "lights", number), file, f"lights.{number}.lights")
    return scene


def black_body_tint(kelvin: float) -> NDArray[np.float64]:
    """[3] that tints white light of 6500 K like a black body of `kelvin`, luminance 1, linear Rec. 709 (Planck's law)."""
    tint = _black_body(kelvin) / _black_body(WHITE_KELVIN)
    return tint / luminance(tint)


def _black_body(kelvin: float) -> NDArray[np.float64]:
    micrometres = np.arange(0.38, 0.781, 0.01)
    spectrum = micrometres**-5 / np.expm1(14387.77 / (micrometres * kelvin))  # second radiation constant, CODATA 2018
    return np.array(emission_of_spectrum(np.stack([1000 * micrometres, spectrum / spectrum.max()], axis=1)))


def _in_daylight(scene: SceneDescription, rule: Daylight, seed: int, file: Path | None) -> SceneDescription:
    draws = Draws(seed, "daylight")
    azimuth, elevation, turbidity, clouds, gain = (
        draws.within(getattr(rule, key), "", key) for key in ("azimuth_deg", "elevation_deg", "turbidity", "clouds", "gain")
    )
    to_sun = sun_direction(azimuth, elevation)
    texels = sky(to_sun, turbidity, clouds, int(draws.number("", "cloud_seed") * 2**31), ground=rule.ground)
    sun = sun_irradiance(elevation, turbidity, clouds)
    noon = _level(sky(sun_direction(0, NOON_DEG), height=32), sun_irradiance(NOON_DEG), NOON_DEG)
    gain *= max(_level(texels, sun, elevation) / noon, LEAST_SHARE) ** -rule.adaptation
    world_from_y_up = rotation_from_y_up(scene.up_axis)
    environment = Environment(name="daylight", texels=texels * np.float32(gain), world_from_environment=world_from_y_up)
    shining = {"radiance": tuple((gain * sun).tolist()), "direction": tuple((-world_from_y_up @ to_sun).tolist())}
    scene = replace(scene, environment=environment)
    if rule.sun is None:
        return _with_light(scene, Light(name="daylight", kind="directional", **shining))
    index = _sun_of(scene, rule.sun, file)
    return _changed(scene, {index: partial(_moved_sun, scene.lights[index], replace(scene.lights[index], **shining))})


def _moved_sun(before: Light, after: Light, light: Light) -> Light:
    """`light`, one time of a sun that is `before` at time 0, as it goes on from `after`: it turns and changes alike."""
    first, now = np.array(before.direction), np.array(light.direction)
    axis = np.cross(first, now)
    sine = float(np.linalg.norm(axis))
    turn = rotation_about(axis / sine, math.atan2(sine, float(first @ now))) if sine > 0 else np.eye(3)
    share = np.array(light.radiance) / np.maximum(np.array(before.radiance), 1e-30)
    radiance = tuple((share * np.array(after.radiance)).tolist())
    return replace(light, radiance=radiance, direction=tuple((turn @ np.array(after.direction)).tolist()))


def _level(texels: NDArray, sun: NDArray, elevation_deg: float) -> float:
    """Luminance of what sun and sky give a level surface."""
    return float(luminance(irradiance(texels) + sun * max(np.sin(np.radians(elevation_deg)), 0)))


def _sun_of(scene: SceneDescription, pattern: str, file: Path | None) -> int:
    names = [light.name for light in scene.lights]
    found = [k for k in matching([pattern], names, file, "daylight.sun") if scene.lights[k].kind == "directional"]
    if len(found) != 1:
        raise InputError(f"{pattern!r} matches {len(found)} directional lights, not one", file=file, field="daylight.sun")
    return found[0]


def _with_light(scene: SceneDescription, light: Light) -> SceneDescription:
    lights_at = scene.lights_at
    changing = (lambda time_s: (*lights_at(time_s), light)) if lights_at else None
    return replace(scene, lights=(*scene.lights, light), lights_at=changing)


def _turned(scene: SceneDescription, rule: EnvironmentRule, seed: int) -> SceneDescription:
    draws = Draws(seed, "environment")
    gain, angle = draws.within(rule.gain, "", "gain"), np.radians(draws.within(rule.turn_deg, "", "turn_deg"))
    tint = black_body_tint(draws.within(rule.temperature_k, "", "temperature_k")) if rule.temperature_k else np.ones(3)
    turn = rotation_about(scene.up, float(angle))
    if scene.environment is not None:
        old = scene.environment
        texels = (old.texels * (gain * tint)).astype(np.float32)
        turned = replace(old, texels=texels, world_from_environment=turn @ old.world_from_environment)
        scene = replace(scene, environment=turned)

    def with_sky(light: Light) -> Light:
        return replace(light, direction=tuple((turn @ np.array(light.direction)).tolist()))

    return _changed(scene, {k: with_sky for k, light in enumerate(scene.lights) if light.kind == "directional"})


def rotation_about(axis: NDArray, angle: float) -> NDArray[np.float64]:
    """[3, 3] about a unit axis, radians (Rodrigues)."""
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def _relit(scene: SceneDescription, rule: LightRule, draws: Draws, file: Path | None, field: str) -> SceneDescription:
    names = [light.name for light in scene.lights]
    return _changed(scene, {k: _lamp(rule, draws, names[k]) for k in matching(rule.lights, names, file, field)})


def _lamp(rule: LightRule, draws: Draws, name: str) -> Change:
    gain = 0.0 if draws.number(name, "dark") < rule.dark else draws.within(rule.gain, name, "gain")
    tint = None if rule.temperature_k is None else black_body_tint(draws.within(rule.temperature_k, name, "temperature_k"))

    def change(light: Light) -> Light:
        color = np.array(light.radiance, dtype=float)
        if tint is not None and color.any():
            color = color * tint * (luminance(color) / luminance(color * tint))
        return replace(light, radiance=tuple((gain * color).tolist()))

    return change


def _changed(scene: SceneDescription, changes: dict[int, Change]) -> SceneDescription:
    """The scene with some of its lights changed, at every time."""

    def changed(lights: tuple[Light, ...]) -> tuple[Light, ...]:
        return tuple(changes[k](light) if k in changes else light for k, light in enumerate(lights))

    lights_at = scene.lights_at
    changing = (lambda time_s: changed(lights_at(time_s))) if lights_at else None
    return replace(scene, lights=changed(scene.lights), lights_at=changing)
