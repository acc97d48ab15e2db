"""Image-based light: `raster` is the split sum, `path` is the integral, and what lies between them is the split sum's error.

Both references are float64 midpoint sums over the directions of the sky, 512 x 1024, written from the equations.
"""

import numpy as np
import pytest

from analytic import Stage, make_scene, path_of, quad
from framepairs.scene.description import Environment, Material
from framepairs.transforms import look_at
from reference import albedo_terms, reflect

ROWS, COLUMNS = 512, 1024
NORMAL = np.array([0, 0, 1.0])
DISTANCE = 1000.0


def sky_along(directions: np.ndarray) -> np.ndarray:
    """A smooth sky of two broad lights over grey [..., 3]."""
    first, second = np.array([0.6, 0.64, 0.48]), np.array([-0.48, 0.1, 0.872])
    bright = np.exp(6 * (directions @ (first / np.linalg.norm(first)) - 1))
    second_bright = np.exp(20 * (directions @ (second / np.linalg.norm(second)) - 1))
    return 0.3 + bright[..., None] * np.array([2.0, 1.0, 0.5]) + second_bright[..., None] * np.array([0.5, 1.5, 4.0])


def directions(rows: int, columns: int) -> tuple[np.ndarray, np.ndarray]:
    """Unit vectors [rows, columns, 3] at the middles of a latitude-longitude image, y up, and their solid angles."""
    theta = ((np.arange(rows) + 0.5) / rows * np.pi)[:, None]
    azimuth = ((0.5 - (np.arange(columns) + 0.5) / columns) * 2 * np.pi)[None]
    unit = [np.sin(theta) * np.sin(azimuth), np.cos(theta) * np.ones_like(azimuth), np.sin(theta) * np.cos(azimuth)]
    return np.stack(unit, axis=-1), np.sin(theta) * (np.pi / rows) * (2 * np.pi / columns)


LIGHT, SOLID_ANGLE = directions(ROWS, COLUMNS)
SKY = Environment(name="lights", texels=sky_along(directions(256, 512)[0]).astype(np.float32))


def seen(roughness: float, cosine: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Colour of a white metal plane seen from far away: (raster [3], path [3], standard error of path [3])."""
    metal = Material(name="metal", base_color=(1, 1, 1), metallic=1.0, roughness=roughness)
    eye = DISTANCE * np.array([0, np.sqrt(1 - cosine**2), cosine])
    camera = path_of(look_at(eye, np.zeros(3), np.array([0, 1.0, 0])), fov_y_deg=0.01, far=2 * DISTANCE)
    scene = make_scene((quad(50, 50), metal, np.eye(4)), sky=SKY)
    keys = {"display": (8, 8), "scales": (1,), "brdf_table": 512, "max_depth": 2, "samples_per_pixel": 1024}
    raster, path = (Stage(scene, camera, shading=mode, **keys).arrays(0, "lr_x1") for mode in ("raster", "path"))
    pixels = path["color"].reshape(-1, 3).astype(float)
    return raster["color"][4, 4], pixels.mean(axis=0), pixels.std(axis=0, ddof=1) / np.sqrt(len(pixels))


def split_sum(roughness: float, view: np.ndarray) -> np.ndarray:
    """[3]: the sky's mean under the lobe seen along its own axis, times A + B (Karis 2013)."""
    axis = 2 * (NORMAL @ view) * NORMAL - view
    half = LIGHT + axis
    half /= np.linalg.norm(half, axis=-1, keepdims=True)
    alpha2, cos_h, cos_l = max(roughness**2, 1e-3) ** 2, half @ axis, np.maximum(LIGHT @ axis, 0)
    weight = alpha2 / (cos_h**2 * (alpha2 - 1) + 1) ** 2 * cos_l * SOLID_ANGLE
    mean = (sky_along(LIGHT) * weight[..., None]).sum((0, 1)) / weight.sum()
    a, b = albedo_terms(roughness, np.array(NORMAL @ view))
    return mean * (a + b)


def integral(roughness: float, view: np.ndarray) -> np.ndarray:
    """[3]: the sky under the BRDF."""
    upper = LIGHT[..., 2] > 0
    reflected = reflect((1, 1, 1), 1.0, roughness, NORMAL, view, LIGHT[upper])
    angles = np.broadcast_to(SOLID_ANGLE, LIGHT.shape[:2])[upper]
    return (sky_along(LIGHT[upper]) * reflected * angles[:, None]).sum(0)


@pytest.mark.parametrize("cosine", [0.95, 0.5])
@pytest.mark.parametrize("roughness", [0.25, 0.5, 0.75, 1.0])
def test_raster_is_the_split_sum_and_path_the_integral(roughness, cosine):
    view = np.array([0, np.sqrt(1 - cosine**2), cosine])
    raster, path, error = seen(roughness, cosine)
    approximate, exact = split_sum(roughness, view), integral(roughness, view)
    # Levels lie at roughness k / 8, so no interpolation between them; each is 64 x 128 texels of 1024 filtered samples.
    assert np.abs(raster / approximate - 1).max() < 0.01
    assert np.abs(path - exact).max() < 5 * error.max() and error.max() < 0.01 * exact.max()
    # so the distance between the modes is the split sum's own error, to what the two lines above leave
    assert np.abs((raster - path) - (approximate - exact)).max() < 0.01 * approximate.max() + 5 * error.max()


@pytest.mark.parametrize("mode", ["raster", "path"])
def test_a_sun_beyond_half_precision_keeps_its_light(mode):
    """One texel of 64 x 128 shines: what it lights is proportional to its radiance, whatever textures can hold."""
    metal = Material(name="metal", base_color=(1, 1, 1), metallic=1.0, roughness=0.75)
    camera = path_of(look_at(np.array([0, 0, 10.0]), np.zeros(3), np.array([0, 1.0, 0])), fov_y_deg=1)
    keys = {"display": (8, 8), "scales": (1,), "max_depth": 2, "samples_per_pixel": 64, "shading": mode}
    means = []
    for peak in (1e3, 1e8):
        texels = np.zeros((64, 128, 3), np.float32)
        texels[20, 64] = peak
        sky = Environment(name="sun", texels=texels)
        stage = Stage(make_scene((quad(50, 50), metal, np.eye(4)), sky=sky), camera, **keys)
        means.append(stage.arrays(0, "lr_x1")["color"].mean(dtype=float))
    assert means[0] > 0 and means[1] / means[0] == pytest.approx(1e5, rel=2e-3)  # texels are halves: 2^-11 each
