"""The A, B table against its anchors and against an integral written without it."""

import numpy as np
import pytest

from framepairs.backend import dr, mi
from framepairs.brdf import Brdf, brdf_table, evaluate, f0_of, look_up, pre_integrated
from framepairs.conventions import BrdfModel

MODEL = BrdfModel()
TABLE = Brdf(MODEL, brdf_table(MODEL, 512))
VALUES = np.array(TABLE.table)
SAMPLING_ERROR = 0.01  # DESIGN's figure for 1024 Hammersley samples: 0.009


def test_rough_normal_incidence_is_one_minus_log_two():
    assert VALUES[-1, -1].sum() == pytest.approx(1 - np.log(2), abs=1e-5)


def test_smooth_limit_is_schlick():
    columns = slice(64, None)  # from n.v = 0.016 on, alpha = 0.001 shadows by less than (alpha / n.v)^2 = 4.1e-3
    bias = (1 - ((np.arange(512) / 511) ** 2)[columns]) ** 5
    assert np.abs(VALUES[0, columns, 0] - (1 - bias)).max() < 4.1e-3
    assert np.abs(VALUES[0, columns, 1] - bias).max() < 4.1e-3


def test_energy_is_never_gained():
    assert np.isfinite(VALUES).all() and VALUES.min() >= 0 and VALUES.sum(-1).max() <= 1 + 2.0**-22


@pytest.mark.parametrize("roughness", [0.3, 0.6, 1.0])
@pytest.mark.parametrize("cos_v", [0.15, 0.5, 0.95])
def test_table_equals_a_midpoint_quadrature_of_the_brdf_that_shades(roughness, cos_v):
    """900 x 1800 midpoints in (cos, azimuth) of the light; converged to 1e-4 for these roughnesses (halving checked)."""
    rows, columns = 900, 1800
    index = dr.arange(mi.UInt32, rows * columns)
    cosine = (mi.Float(index // columns) + 0.5) / rows
    phi = (mi.Float(index % columns) + 0.5) * (2 * np.pi / columns)
    sine = dr.sqrt(1 - cosine * cosine)
    light = mi.Vector3f(sine * dr.cos(phi), sine * dr.sin(phi), cosine)
    view = mi.Vector3f(float(np.sqrt(1 - cos_v**2)), 0, cos_v)
    n = mi.Vector3f(0, 0, 1)

    def albedo(f0: float) -> float:
        value = evaluate(MODEL, mi.Color3f(0), mi.Float(1), mi.Float(roughness), mi.Color3f(f0), n, view, light)
        return float(np.array(value.x, dtype=np.float64).sum()) * 2 * np.pi / (rows * columns)

    a_plus_b, b = albedo(1.0), albedo(0.0)
    a, from_table = look_up(TABLE, mi.Float(cos_v), mi.Float(roughness), mi.Bool(True))
    assert a[0] + from_table[0] == pytest.approx(a_plus_b, abs=SAMPLING_ERROR)
    assert from_table[0] == pytest.approx(b, abs=SAMPLING_ERROR)


def specular_albedo(roughness: float, cos_v: float, f0: float) -> float:
    """Equations 4 to 8 of the NSRD supplement in float64, alpha = roughness^2, over 600 x 1200 midpoints of the light."""
    cosine, phi = np.meshgrid((np.arange(600) + 0.5) / 600, (np.arange(1200) + 0.5) * np.pi / 600)
    sine, alpha2 = np.sqrt(1 - cosine**2), roughness**4
    view = np.array([np.sqrt(1 - cos_v**2), 0, cos_v])
    half = np.stack([sine * np.cos(phi), sine * np.sin(phi), cosine]) + view[:, None, None]
    half /= np.linalg.norm(half, axis=0)
    v_h = np.tensordot(view, half, 1)
    d = alpha2 / (np.pi * (half[2] ** 2 * (alpha2 - 1) + 1) ** 2)
    g = np.prod([2 * c / (c + np.sqrt(alpha2 + (1 - alpha2) * c * c)) for c in (cosine, np.full_like(cosine, cos_v))], axis=0)
    f = f0 + (1 - f0) * (1 - v_h) ** 5
    return float((d * f * g / (4 * cos_v)).mean() * 2 * np.pi)


@pytest.mark.parametrize(("roughness", "cos_v"), [(0.4, 0.3), (0.5, 0.8), (0.8, 0.5)])
def test_table_equals_the_papers_equations_in_float64(roughness, cos_v):
    a, b = look_up(TABLE, mi.Float(cos_v), mi.Float(roughness), mi.Bool(True))
    assert a[0] + b[0] == pytest.approx(specular_albedo(roughness, cos_v, 1.0), abs=SAMPLING_ERROR)
    assert b[0] == pytest.approx(specular_albedo(roughness, cos_v, 0.0), abs=SAMPLING_ERROR)


def test_look_up_hits_nodes_and_clamps():
    for row, column in ((0, 0), (511, 511), (100, 37)):
        a, b = look_up(TABLE, mi.Float((column / 511) ** 2), mi.Float(row / 511), mi.Bool(True))
        assert np.abs(np.array([a[0], b[0]]) - VALUES[row, column]).max() < 1e-4  # sqrt and products in float32, steep
    for cos_v, roughness in ((-0.1, 0.5), (1.2, 2.0), (0.0, 0.0)):
        a, b = look_up(TABLE, mi.Float(cos_v), mi.Float(roughness), mi.Bool(True))
        assert np.isfinite([a[0], b[0]]).all()


def test_f0_and_f_beta_by_hand():
    base = mi.Color3f(0.5, 0.25, 1.0)
    f0 = f0_of(base, mi.Float(0.25), mi.Float(0.5))
    assert np.allclose(np.array(f0).ravel(), 0.75 * 0.04 + 0.25 * np.array([0.5, 0.25, 1.0]), atol=1e-7)
    value = pre_integrated(base, mi.Float(0.25), f0, mi.Float(0.6), mi.Float(0.1))
    expected = 0.75 * np.array([0.5, 0.25, 1.0]) + (0.03 + 0.25 * np.array([0.5, 0.25, 1.0])) * 0.6 + 0.1
    assert np.allclose(np.array(value).ravel(), expected, atol=1e-6)


def test_the_brdf_is_reciprocal():
    rng = np.random.default_rng(5)
    v, l = (rng.normal(size=(3, 50)) for _ in range(2))
    v, l = (np.abs(d) / np.linalg.norm(d, axis=0) for d in (v, l))
    arguments = MODEL, mi.Color3f(0.4), mi.Float(0.3), mi.Float(0.4), mi.Color3f(0.2), mi.Vector3f(0, 0, 1)
    forth = np.array(evaluate(*arguments, mi.Vector3f(v), mi.Vector3f(l))) / l[2]
    back = np.array(evaluate(*arguments, mi.Vector3f(l), mi.Vector3f(v))) / v[2]
    assert np.abs(forth / back - 1).max() < 64 * 2.0**-24
