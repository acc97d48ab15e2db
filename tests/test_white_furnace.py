"""A convex object under constant light of radiance 1 shows its albedo: F_beta, the integral of the BRDF.

The object is a prism whose facets, all flat, are seen at ten angles; slabs of it have different materials. The reference is
a float64 quadrature of the BRDF itself (`reference`), not our table.
"""

import numpy as np
import pytest

from analytic import Stage, at, constant_sky, make_scene, path_of
from framepairs.scene.description import Material, Mesh
from reference import albedo_terms, f0_of

ROUGHNESSES = (0.0, 0.01, 0.1, 0.5, 1.0)
METALLICS = (0.0, 0.5, 1.0)
BASE = (0.9, 0.3, 0.005)
COSINES = (1.0, 0.98, 0.9, 0.75, 0.6, 0.45, 0.3, 0.2, 0.12, 0.06)  # of the facets' normals to the axis of view
DISTANCE, SIZE = 100.0, (41, 61)
MATERIALS = [
    Material(name=f"{roughness} {metallic}", base_color=BASE, roughness=roughness, metallic=metallic)
    for roughness in ROUGHNESSES
    for metallic in METALLICS
]


def prism() -> list[tuple[Mesh, Material, np.ndarray]]:
    """Facets side by side, each as wide as the others as seen along -z, bending away; in y one slab for each material."""
    width, height = 2 / len(COSINES), 3 / len(MATERIALS)
    parts, x, z = [], -1.0, 0.0
    for cosine in COSINES:
        end = x + width, z - width * np.sqrt(1 - cosine**2) / cosine
        for k, material in enumerate(MATERIALS):
            low, high = 1.5 - (k + 1) * height, 1.5 - k * height
            corners = np.float32([[x, low, z], [end[0], low, end[1]], [end[0], high, end[1]], [x, high, z]])
            parts.append((Mesh(name="facet", positions=corners, faces=np.uint32([[0, 1, 2], [0, 2, 3]])), material, np.eye(4)))
        x, z = end
    return parts


def stage(**plan) -> Stage:
    camera = path_of(at(0, 0, DISTANCE), fov_y_deg=float(np.degrees(2 * np.arctan(1.55 / DISTANCE))), far=2 * DISTANCE)
    scene = make_scene(*prism(), sky=constant_sky((1, 1, 1)))
    return Stage(scene, camera, display=SIZE, scales=(1,), variants=("native",), brdf_table=512, **plan)


def expected_albedo(arrays) -> tuple[np.ndarray, np.ndarray]:
    """(pixels that show the prism, their F_beta [n, 3] in float64)."""
    seen = arrays["object_id"][..., 0] > 0
    width, height = SIZE
    tangent = 1.55 / DISTANCE
    x, y = np.meshgrid((2 * (np.arange(width) + 0.5) / width - 1) * width / height, 1 - 2 * (np.arange(height) + 0.5) / height)
    towards = -np.stack([x * tangent, y * tangent, -np.ones_like(x)], axis=-1)
    towards /= np.linalg.norm(towards, axis=-1, keepdims=True)
    cos_v = (towards * arrays["normal"]).sum(-1)[seen]
    number = (arrays["object_id"][..., 0][seen] - 1) % len(MATERIALS)
    albedo = np.zeros((len(cos_v), 3))
    for roughness in ROUGHNESSES:
        rows = np.array([MATERIALS[k].roughness == roughness for k in number])
        places, back = np.unique(cos_v[rows].round(5), return_inverse=True)
        a, b = (column[back][:, None] for column in albedo_terms(roughness, places))
        metallic = np.array([MATERIALS[k].metallic for k in number[rows]])[:, None]
        albedo[rows] = (1 - metallic) * np.array(BASE) + f0_of(BASE, metallic) * a + b
    return seen, albedo


@pytest.fixture(scope="module")
def expected():
    arrays = stage().arrays(0, "lr_x1", frozenset({"object_id", "normal"}))
    return expected_albedo(arrays)


def test_the_reference_is_converged():
    cosines = np.array([0.03, 0.06, 0.3, 0.9, 1.0])
    for roughness in ROUGHNESSES:
        coarse, fine = (np.array(albedo_terms(roughness, cosines, nodes)) for nodes in (200, 400))
        assert np.abs(coarse - fine).max() < 1e-4, roughness


def test_raster_shows_the_integral_of_the_brdf(expected):
    seen, albedo = expected
    arrays = stage().arrays(0, "lr_x1", frozenset({"color", "brdf"}))
    assert seen.sum() > 2000 and albedo.min() < 0.01 < albedo.max()
    bright = albedo > 0.01
    for name in ("color", "brdf"):
        error = np.abs(arrays[name][seen] / np.where(bright, albedo, 1) - 1)[bright]
        assert error.max() < 2e-3, name


def test_path_converges_to_the_integral_of_the_brdf(expected):
    seen, albedo = expected
    arrays = stage(shading="path", samples_per_pixel=1024).arrays(0, "lr_x1", frozenset({"color", "color_variance"}))
    excess = np.abs(arrays["color"][seen] - albedo) - 2e-3
    error = np.sqrt(arrays["color_variance"][seen])
    assert (excess > 3 * error).any(axis=1).mean() <= 0.005
    assert not (excess > 6 * error).any()
    assert np.median(error) < 0.02  # so that the above says something
