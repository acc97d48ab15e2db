"""The BRDF that shades: against its equations in float64, its symmetry, its bounds, and what its samples stand for."""

import numpy as np
import pytest

from framepairs.backend import dr, mi
from framepairs.brdf import (
    LEAST_CHANCE,
    Brdf,
    density,
    evaluate,
    f0_of,
    ggx,
    look_up,
    pre_integrated,
    sample,
    sample_specular,
    schlick,
    specular_chance,
    specular_density,
)
from framepairs.brdf_tables import brdf_table
from framepairs.conventions import BrdfModel

VISIBILITIES = ("separable_smith", "height_correlated", "schlick_k")
MODELS = [BrdfModel(visibility, mapping) for visibility in VISIBILITIES for mapping in ("squared", "linear")]
MODEL = BrdfModel()
TABLE = Brdf(MODEL, brdf_table(MODEL, 512))
VALUES = np.array(TABLE.table)
ROUNDINGS = 64 * 2.0**-24  # some tens of float32 operations

every_model = pytest.mark.parametrize("model", MODELS, ids=lambda model: f"{model.visibility}-{model.mapping}")


def directions(count: int, seed: int) -> np.ndarray:
    """[3, count] unit vectors all around, float32."""
    xyz = np.random.default_rng(seed).normal(size=(3, count))
    return (xyz / np.linalg.norm(xyz, axis=0)).astype(np.float32)


def above(normal: np.ndarray, towards: np.ndarray) -> np.ndarray:
    return np.where((normal * towards).sum(0) < 0, -towards, towards)


def expected_brdf(model: BrdfModel, base, metallic: float, roughness: float, f0, n, v, l) -> np.ndarray:
    """[3, count]: BRDF times cosine, equations 1 to 10 in float64, from the terms' usual forms (G over 4 n.v n.l)."""
    n, v, l = (np.asarray(d, dtype=np.float64) for d in (n, v, l))
    base, f0 = np.asarray(base)[:, None], np.asarray(f0)[:, None]
    alpha = max(roughness**2 if model.mapping == "squared" else roughness, 1e-3)
    h = (v + l) / np.linalg.norm(v + l, axis=0)
    n_v, n_l, n_h, v_h = ((a * b).sum(0) for a, b in ((n, v), (n, l), (n, h), (v, h)))
    sine2 = (np.cross(n, h, axis=0) ** 2).sum(0)
    d = alpha**2 / (np.pi * (alpha**2 * n_h**2 + sine2) ** 2)  # equation 5 without 1 - cos^2
    if model.visibility == "schlick_k":
        k = (alpha + 1) ** 2 / 8
        g = n_v / (n_v * (1 - k) + k) * n_l / (n_l * (1 - k) + k)
    else:
        lambda_v, lambda_l = ((np.sqrt(1 + alpha**2 * (1 / c**2 - 1)) - 1) / 2 for c in (n_v, n_l))
        together = 1 + lambda_v + lambda_l
        g = 1 / (together if model.visibility == "height_correlated" else together + lambda_v * lambda_l)
    f = f0 + (1 - f0) * (1 - v_h) ** 5
    return ((1 - metallic) * base / np.pi + d * f * g / (4 * n_v * n_l)) * n_l


@every_model
@pytest.mark.parametrize("roughness", [0.0, 0.02, 0.1, 0.4, 1.0])
def test_it_is_the_papers_equations(model, roughness):
    """In the surface's own frame, half of the pairs near the mirror direction: a few tens of roundings, also at alpha 0.001.

    v + l is no shorter than 0.2, where the directions' own lengths, off by 6e-8, count five times in (1 - v.h)^5.
    """
    v, l = (directions(2000, seed) for seed in (1, 2))
    v[2], l[2] = abs(v[2]) + 0.12, abs(l[2]) + 0.12
    l[:, ::2] = v[:, ::2] * np.float32([-1, -1, 1])[:, None] + np.float32(0.003) * l[:, ::2]
    v, l = (d / np.linalg.norm(d, axis=0) for d in (v, l))
    n = np.broadcast_to(np.float32([0, 0, 1])[:, None], v.shape)
    base, f0 = (0.5, 0.3, 0.1), (0.04, 0.4, 1.0)
    surface = mi.Color3f(base), mi.Float(0.3), mi.Float(roughness), mi.Color3f(f0)
    found = evaluate(model, *surface, *(mi.Vector3f(d) for d in (n, v, l)))
    expected = expected_brdf(model, base, 0.3, roughness, f0, n, v, l)
    assert np.abs(np.array(found) / expected - 1).max() < 2 * ROUNDINGS


def test_the_peak_keeps_its_digits_in_any_frame():
    """At alpha 0.001, roundings of 2^-24 in some nine coordinates turn the half vector by up to 3e-7: 3e-4 of the lobe's width,
    so some 1e-3 of D. 1 - cos^2 in float32 would be off by 6e-8 / 1e-6 = 6 % and more."""
    n, v = directions(3000, 3), directions(3000, 4)
    v = above(n, v) + np.float32(0.3) * n
    v /= np.linalg.norm(v, axis=0)
    l = 2 * (n * v).sum(0) * n - v + np.float32(0.0015) * directions(3000, 5)
    l /= np.linalg.norm(l, axis=0)
    surface = mi.Color3f(0), mi.Float(1), mi.Float(0), mi.Color3f(1)
    found = evaluate(MODEL, *surface, *(mi.Vector3f(d) for d in (n, v, l)))
    expected = expected_brdf(MODEL, (0, 0, 0), 1.0, 0.0, (1, 1, 1), n, v, l)
    assert np.abs(np.array(found) / expected - 1).max() < 2e-3


def test_ggx_integrates_to_one():
    """The integral of D cos over the hemisphere, by midpoints of u = cdf (sin^2 = alpha^2 u / (1 - u (1 - alpha^2)))."""
    for alpha in (1e-3, 0.1, 1.0):
        u = (np.arange(4000) + 0.5) / 4000
        sine2 = alpha**2 * u / (1 - u * (1 - alpha**2))
        per_u = alpha**2 / (1 - u * (1 - alpha**2)) ** 2  # d(sin^2)/du; d omega cos = pi d(sin^2)
        total = np.mean(np.array(ggx(mi.Float(sine2), mi.Float(alpha)), dtype=np.float64) * np.pi * per_u)
        assert total == pytest.approx(1, abs=1e-5)


@every_model
@pytest.mark.parametrize("roughness", [0.0, 0.4, 1.0])
def test_it_is_reciprocal(model, roughness):
    n, v, l = (directions(500, seed) for seed in (5, 6, 7))
    v, l = above(n, v), above(n, l)
    n, v, l = mi.Vector3f(n), mi.Vector3f(v), mi.Vector3f(l)
    arguments = model, mi.Color3f(0.4), mi.Float(0.3), mi.Float(roughness), mi.Color3f(0.2), n
    forth = np.array(evaluate(*arguments, v, l)) * np.array(dr.dot(n, v))
    back = np.array(evaluate(*arguments, l, v)) * np.array(dr.dot(n, l))
    assert np.abs(forth / back - 1).max() < ROUNDINGS


@every_model
@pytest.mark.parametrize("roughness", [0.0, 1e-3, 0.3, 1.0])
def test_everything_is_finite_everywhere(model, roughness):
    tilted = [float(x) for x in directions(1, 8)[:, 0]]
    for n in ([0, 0, 1], tilted):
        side = np.cross(n, [0.3, 0.9, 0.2])
        side /= np.linalg.norm(side)
        some = [np.array(n), -np.array(n), side, -side, side * 0.8 + np.array(n) * 0.6, side * 0.8 - np.array(n) * 0.6]
        some += [side + e * np.array(n) for e in (1e-3, 1e-7, 1e-20, -1e-7)]
        some = np.array([d / np.linalg.norm(d) for d in some]).T
        v, l = np.repeat(some, some.shape[1], axis=1), np.tile(some, some.shape[1])
        n_, v_, l_ = mi.Vector3f(n), mi.Vector3f(v), mi.Vector3f(l)
        surface = mi.Color3f(0.5), mi.Float(0.5), mi.Float(roughness), mi.Color3f(0.5), n_, v_
        value = np.array(evaluate(model, *surface, l_))
        assert np.isfinite(value).all() and value.min() >= 0
        below = np.array(dr.dot(n_, l_)) <= 0
        assert (value[:, below] == 0).all()
        chances = np.array(density(model, *surface, l_))
        assert np.isfinite(chances).all() and (chances[below] == 0).all() and (chances[~below] > 0).all()
        for u in (0.0, 0.5, 1 - 2.0**-24):
            drawn = np.array(sample(model, *surface, mi.Float(u), mi.Point2f(u, u)))
            assert np.isfinite(drawn).all() and np.abs(np.linalg.norm(drawn, axis=0) - 1).max() < ROUNDINGS


def test_a_view_below_the_surface_is_taken_at_the_horizon():
    surface = MODEL, mi.Color3f(0.5), mi.Float(0.5), mi.Float(0.4), mi.Color3f(0.5), mi.Vector3f(0, 0, 1)
    low, level, l = mi.Vector3f(0.8, 0, -0.6), mi.Vector3f(1, 0, 0), mi.Vector3f(-0.6, 0, 0.8)
    assert np.array(evaluate(*surface, low, l)) == pytest.approx(np.array(evaluate(*surface, level, l)), rel=ROUNDINGS)
    assert np.array(evaluate(*surface, low, l)).min() > 0.01
    assert density(*surface, low, l)[0] == pytest.approx(density(*surface, level, l)[0], rel=ROUNDINGS)


@every_model
@pytest.mark.parametrize("roughness", [0.05, 0.3, 1.0])
def test_samples_are_never_worth_more_than_the_least_chance_allows(model, roughness):
    """Colours up to 1: each lobe is at most its density, and its chance at least LEAST_CHANCE."""
    rng = np.random.default_rng(9)
    n, v = directions(4000, 10), directions(4000, 11)
    n, v = mi.Vector3f(n), mi.Vector3f(above(n, v))
    base, metallic, specular = mi.Color3f(rng.random((3, 4000))), mi.Float(rng.random(4000)), mi.Float(rng.random(4000))
    surface = model, base, metallic, mi.Float(roughness), f0_of(base, metallic, specular), n, v
    l = sample(*surface, mi.Float(rng.random(4000)), mi.Point2f(rng.random((2, 4000))))
    value, chance = np.array(evaluate(*surface, l)), np.array(density(*surface, l))
    weight = value[:, chance > 0] / chance[chance > 0]
    assert (chance > 0).mean() > 0.6 and weight.max() <= 1 / LEAST_CHANCE


@pytest.mark.parametrize("visibility", VISIBILITIES)
@pytest.mark.parametrize("degrees", [10.0, 75.0, 90.0, 100.0])
def test_the_mean_worth_of_samples_is_the_table(visibility, degrees):
    """In a tilted frame, also below the horizon: F_beta of 2^17 samples; the standard error is the samples' own."""
    model, count = BrdfModel(visibility), 2**17
    n, side = np.array([0.48, 0.6, 0.64]), np.array([0.8, 0, -0.6])
    theta = np.radians(degrees)
    v = mi.Vector3f(np.cos(theta) * n + np.sin(theta) * side)
    rng = np.random.default_rng(12)
    u1, u = mi.Float(rng.random(count, dtype=np.float32)), mi.Point2f(rng.random((2, count), dtype=np.float32))
    base, metallic = mi.Color3f(0.2, 0.5, 0.9), mi.Float(0.4)
    f0 = f0_of(base, metallic, mi.Float(0.5))
    surface = model, base, metallic, mi.Float(0.35), f0, mi.Vector3f(n), v
    l = sample(*surface, u1, u)
    chance = density(*surface, l)
    worth = np.array(dr.select(chance > 0, evaluate(*surface, l) / chance, 0), dtype=np.float64)
    a, b = look_up(Brdf(model, brdf_table(model)), mi.Float(np.cos(theta)), mi.Float(0.35), mi.Bool(True))
    expected = np.array(pre_integrated(base, metallic, f0, a, b)).ravel()
    error = worth.std(axis=1) / np.sqrt(count)
    assert (np.abs(worth.mean(axis=1) - expected) < 4 * error + 4e-4).all()  # 4e-4: the look-up


def test_the_specular_lobe_alone_is_sampled_alike():
    """E[D-weighted estimator] of 1: the density integrates to the share of samples that stay above the surface."""
    n, v = mi.Vector3f(0.48, 0.6, 0.64), dr.normalize(mi.Vector3f(0.9, -0.3, 0.4))
    rng = np.random.default_rng(13)
    u = mi.Point2f(rng.random((2, 2**17), dtype=np.float32))
    for roughness in (0.4, 1.0):
        l = sample_specular(MODEL, mi.Float(roughness), n, v, u)
        share = np.mean(np.array(dr.dot(n, l)) > 0)
        uniform = mi.warp.square_to_uniform_hemisphere(u)
        inside = specular_density(MODEL, mi.Float(roughness), n, v, mi.Frame3f(n).to_world(uniform)) * (2 * dr.pi)
        values = np.array(inside, dtype=np.float64)
        assert values.mean() == pytest.approx(share, abs=4 * values.std() / 2**8.5 + 4 / 2**9.5)


def test_chances_follow_fresnel_and_colour():
    def chance(base, metallic, f0, n_v):
        return specular_chance(mi.Color3f(base), mi.Float(metallic), mi.Color3f(f0), mi.Float(n_v))[0]

    assert chance(0.8, 1.0, 0.8, 1.0) == 1  # no diffuse part
    assert chance(0.0, 0.0, 0.04, 1.0) == 1
    assert chance(0.9, 0.0, 0.0, 1.0) == 0  # specular 0 has no lobe
    assert chance(0.9, 0.0, 0.001, 1.0) == pytest.approx(LEAST_CHANCE)  # Fresnel is small at n.v, but not elsewhere
    assert chance(1e-4, 0.0, 1.0, 1.0) == pytest.approx(1 - LEAST_CHANCE)
    assert chance(0.4, 0.0, 0.4, 1.0) == pytest.approx(0.5)
    assert chance(0.4, 0.5, 0.1, 1.0) == pytest.approx(1 / 3, rel=1e-6)
    assert chance(0.5, 0.0, 0.04, 0.2) > chance(0.5, 0.0, 0.04, 0.9)


@pytest.mark.parametrize("roughness", [0.3, 0.6, 1.0])
@pytest.mark.parametrize("cos_v", [0.15, 0.5, 0.95])
@pytest.mark.parametrize("visibility", VISIBILITIES)
def test_table_equals_a_midpoint_quadrature_of_the_brdf_that_shades(visibility, roughness, cos_v):
    """900 x 1800 midpoints in (cos, azimuth) of the light; converged to 1e-4 for these roughnesses (halving checked)."""
    model, rows, columns = BrdfModel(visibility), 900, 1800
    index = dr.arange(mi.UInt32, rows * columns)
    cosine = (mi.Float(index // columns) + 0.5) / rows
    phi = (mi.Float(index % columns) + 0.5) * (2 * np.pi / columns)
    sine = dr.sqrt(1 - cosine * cosine)
    light = mi.Vector3f(sine * dr.cos(phi), sine * dr.sin(phi), cosine)
    view = mi.Vector3f(float(np.sqrt(1 - cos_v**2)), 0, cos_v)
    n = mi.Vector3f(0, 0, 1)

    def albedo(f0: float) -> float:
        value = evaluate(model, mi.Color3f(0), mi.Float(1), mi.Float(roughness), mi.Color3f(f0), n, view, light)
        return float(np.array(value.x, dtype=np.float64).sum()) * 2 * np.pi / (rows * columns)

    a_plus_b, least = albedo(1.0), 0.02  # from F0 = 0.02 on, F90 is 1
    b = (albedo(least) - least * a_plus_b) / (1 - least)
    a, from_table = look_up(Brdf(model, brdf_table(model)), mi.Float(cos_v), mi.Float(roughness), mi.Bool(True))
    assert a[0] + from_table[0] == pytest.approx(a_plus_b, abs=2e-4)
    assert from_table[0] == pytest.approx(b, abs=2e-4)


def test_look_up_hits_nodes_and_clamps():
    for row, column in ((0, 0), (511, 511), (100, 37)):
        a, b = look_up(TABLE, mi.Float((column / 511) ** 2), mi.Float(row / 511), mi.Bool(True))
        assert np.abs(np.array([a[0], b[0]]) - VALUES[row, column]).max() < 1e-4  # sqrt and products in float32, steep
    for cos_v, roughness in ((-0.1, 0.5), (1.2, 2.0), (0.0, 0.0)):
        a, b = look_up(TABLE, mi.Float(cos_v), mi.Float(roughness), mi.Bool(True))
        assert np.isfinite([a[0], b[0]]).all()


def test_a_surface_of_specular_0_is_lambert_alone():
    rng = np.random.default_rng(3)
    v, l = (mi.Vector3f((d / np.linalg.norm(d, axis=0)).astype(np.float32)) for d in np.abs(rng.normal(size=(2, 3, 500))))
    n, base = mi.Vector3f(0, 0, 1), mi.Color3f(0.7, 0.4, 0.1)
    value = evaluate(MODEL, base, mi.Float(0), mi.Float(0.2), mi.Color3f(0), n, v, l)
    lambert = base * (l.z * dr.inv_pi)
    assert np.array_equal(np.array(value), np.array(lambert))
    assert np.allclose(np.array(pre_integrated(base, mi.Float(0), mi.Color3f(0), mi.Float(0.6), mi.Float(0.3))), np.array(base))


@pytest.mark.parametrize("f0, f90", [(0.0, 0.0), (0.01, 0.5), (0.02, 1.0), (0.04, 1.0), (1.0, 1.0)])
def test_grazing_reflectance_falls_with_f0_below_any_real_material(f0, f90):
    assert schlick(mi.Color3f(f0), mi.Float(0)).x[0] == pytest.approx(f90, rel=1e-6)
    assert schlick(mi.Color3f(0, f0, 0), mi.Float(0)).y[0] == pytest.approx(f90, rel=1e-6)  # of its greatest component


def test_f0_and_f_beta_by_hand():
    base = mi.Color3f(0.5, 0.25, 1.0)
    f0 = f0_of(base, mi.Float(0.25), mi.Float(0.5))
    assert np.allclose(np.array(f0).ravel(), 0.75 * 0.04 + 0.25 * np.array([0.5, 0.25, 1.0]), atol=1e-7)
    value = pre_integrated(base, mi.Float(0.25), f0, mi.Float(0.6), mi.Float(0.1))
    expected = 0.75 * np.array([0.5, 0.25, 1.0]) + (0.03 + 0.25 * np.array([0.5, 0.25, 1.0])) * 0.6 + 0.1
    assert np.allclose(np.array(value).ravel(), expected, atol=1e-6)
