"""The table of A and B: against its anchors, against adaptive float64 quadrature, and between its nodes."""

from functools import lru_cache

import numpy as np
import pytest

from framepairs.backend import mi
from framepairs.brdf import Brdf, alpha_of, look_up
from framepairs.brdf_report import alphas, reference, reference_nodes
from framepairs.brdf_tables import brdf_table, integrate, table_channel, tabulate
from framepairs.conventions import BrdfModel

VISIBILITIES = ("separable_smith", "height_correlated", "schlick_k")
MODELS = [BrdfModel(visibility, mapping) for visibility in VISIBILITIES for mapping in ("squared", "linear")]
SIZE = 512
COS_V = (np.arange(SIZE) / (SIZE - 1)) ** 2
ROUNDING = 2.0**-24

@lru_cache
def finer(model: BrdfModel) -> np.ndarray:
    """The whole table from 24 nodes per axis, within 5e-6."""
    return np.array(tabulate(model, SIZE, "quadrature", 24))


@lru_cache
def expected_nodes(model: BrdfModel) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows, columns, and A and B there."""
    rows, columns = reference_nodes(model, SIZE)
    return rows, columns, reference(model, alphas(model, rows, SIZE), COS_V[columns], tolerance=1e-6)


every_model = pytest.mark.parametrize("model", MODELS, ids=lambda model: f"{model.visibility}-{model.mapping}")


@lru_cache
def values(model: BrdfModel) -> np.ndarray:
    return np.array(brdf_table(model, SIZE))


@every_model
def test_rough_normal_incidence_is_one_minus_log_two(model):
    assert values(model)[-1, -1].sum() == pytest.approx(1 - np.log(2), abs=2e-5)  # 12 nodes; float32 sums of 288


@every_model
def test_energy_is_never_gained(model):
    table = values(model)
    assert np.isfinite(table).all() and table.min() >= 0 and table.sum(-1).max() <= 1 + 4 * ROUNDING


@pytest.mark.parametrize("visibility", VISIBILITIES[:2])
def test_smooth_limit_is_schlick(visibility):
    """From n.v = 0.1 on, alpha 0.001 blurs (1 - n.v)^5 by alpha^2 times a curvature below 20 times the logarithm of GGX's tail,
    some 7: 1.4e-4; it shadows by (alpha / n.v)^2 / 2 = 5e-5."""
    columns = COS_V > 0.1
    bias = (1 - COS_V[columns]) ** 5
    smooth = values(BrdfModel(visibility))[0, columns]
    assert np.abs(smooth[:, 0] - (1 - bias)).max() < 2e-4 and np.abs(smooth[:, 1] - bias).max() < 2e-4


def test_schlick_k_has_no_such_limit():
    """A mirror of G = G1(n.v)^2 with k = 1/8: at n.v = 0.3, A + B is (0.3 / (0.3 * 7/8 + 1/8))^2 = 0.5994 instead of 1."""
    column = np.abs(COS_V - 0.3).argmin()
    cosine, k = COS_V[column], (1.001**2) / 8
    expected = (cosine / (cosine * (1 - k) + k)) ** 2
    assert values(BrdfModel("schlick_k"))[0, column].sum() == pytest.approx(expected, abs=2e-4)


@pytest.mark.parametrize(
    "model", [*MODELS[::2], BrdfModel(mapping="linear")], ids=lambda model: f"{model.visibility}-{model.mapping}"
)
def test_quadrature_is_within_2e_4_of_adaptive_float64_quadrature(model):
    """At some 290 nodes: corners, edges, both sides of alpha = 0.001, the cone n.v ~ alpha. Measured: 5.3e-5."""
    rows, columns, expected = expected_nodes(model)
    error = np.abs(values(model)[rows, columns] - expected)
    assert error.max() < 1e-4  # the requirement is 2e-4


def test_quadrature_of_8_would_do_for_5e_4():
    model = BrdfModel()
    rows, columns, expected = expected_nodes(model)
    error = np.abs(np.array(tabulate(model, SIZE, "quadrature", 8))[rows, columns] - expected)
    assert error.max() < 5e-4


@pytest.mark.parametrize("visibility", VISIBILITIES[:2])
def test_no_node_is_far_from_that_of_twice_the_nodes(visibility):
    """All 262144 nodes, so that no region escapes the reference's grid: measured 5.8e-5."""
    model = BrdfModel(visibility)
    assert np.abs(values(model) - finer(model)).max() < 1e-4


def test_quadrature_is_a_hundred_times_better_than_the_papers_1024_points():
    """And cheaper: `framepairs brdf` tells both times."""
    model = BrdfModel()
    exact = finer(model)
    points, ours = (np.array(tabulate(model, SIZE, *run)) for run in (("hammersley", 1024), ("quadrature", 12)))
    assert np.abs(ours - exact).max() < np.abs(points - exact).max() / 100


@pytest.mark.parametrize("visibility", VISIBILITIES)
def test_hammersley_points_converge_to_the_same_table(visibility):
    """From n.v = 2.5e-4 on; below, the weight's n.v in the denominator makes any number of points too few."""
    model = BrdfModel(visibility)
    exact = np.array(tabulate(model, 128, "quadrature"))[:, 2:]
    errors = [np.abs(np.array(tabulate(model, 128, "hammersley", n))[:, 2:] - exact) for n in (64, 1024)]
    assert errors[1].max() < 0.03 and errors[1].mean() < errors[0].mean() / 3


@every_model
def test_column_0_is_the_limit_of_grazing_views(model):
    """A and B change with n.v / alpha there, at a few per unit: by a few times 1e-6 / 0.001."""
    alpha = mi.Float([1e-3, 1e-3, 0.05, 0.05, 1.0, 1.0])
    a, b = integrate(model, mi.Float([0, 1e-6] * 3), alpha)
    for value in (np.array(a), np.array(b)):
        assert np.abs(value[::2] - value[1::2]).max() < 5e-3
    if model.visibility == "height_correlated":  # masking hides at grazing what shadowing would: all light comes back
        assert np.array(a + b)[::2] == pytest.approx(1, abs=1e-4)


@every_model
def test_looking_up_between_nodes_is_within_1e_3_of_the_integral(model):
    """Cells of the hard corner at nine places each, and 20000 places drawn evenly; the integral itself is within 3e-5."""
    rng = np.random.default_rng(3)
    x, y, fx, fy = np.meshgrid(np.arange(120), np.arange(24), (0.2, 0.5, 0.8), (0.15, 0.5, 0.8))
    x = np.concatenate([(x + fx).ravel() / (SIZE - 1), rng.random(20_000)])
    y = np.concatenate([(y + fy).ravel() / (SIZE - 1), rng.random(20_000)])
    cos_v, roughness = mi.Float(x.astype(np.float32) ** 2), mi.Float(y.astype(np.float32))
    expected = integrate(model, cos_v, alpha_of(model, roughness), "quadrature", 14)
    found = look_up(Brdf(model, brdf_table(model, SIZE)), cos_v, roughness, mi.Bool(True))
    error = max(np.abs(np.array(f) - np.array(e)).max() for f, e in zip(found, expected, strict=True))
    assert error < 1e-3  # measured: 3.5e-4 squared, 8.6e-4 linear


@every_model
def test_a_small_table_is_looked_up_alike(model):
    """Any size from 8 nodes on: nodes are hit, and nothing leaves 0 ... 1 between them."""
    table = Brdf(model, brdf_table(model, 8))
    nodes = np.array(table.table)
    row, column = np.meshgrid(np.arange(8), np.arange(8), indexing="ij")
    cos_v = mi.Float((column.ravel() / 7).astype(np.float32) ** 2)
    a, b = look_up(table, cos_v, mi.Float(row.ravel() / 7), mi.Bool(True))
    assert np.abs(np.stack([a, b], -1).reshape(8, 8, 2) - nodes).max() < 1e-4
    rng = np.random.default_rng(4)
    a, b = (np.array(v) for v in look_up(table, mi.Float(rng.random(4000)), mi.Float(rng.random(4000)), mi.Bool(True)))
    assert a.min() >= 0 and b.min() >= 0 and (a + b).max() <= 1 + 8 * ROUNDING


def test_tables_are_remembered_by_model_and_size():
    assert brdf_table(BrdfModel(), SIZE) is brdf_table(BrdfModel(), SIZE)
    linear, squared = (np.array(brdf_table(BrdfModel(mapping=mapping), 9)) for mapping in ("linear", "squared"))
    assert np.abs(linear - squared).max() > 0.05 and linear.shape == (9, 9, 2)
    assert np.array_equal(linear[0], squared[0]) and np.array_equal(linear[-1], squared[-1])


def test_the_stored_table_says_what_it_is():
    channel = table_channel(BrdfModel("schlick_k", "linear"))
    assert channel.exr == ("A", "B") and channel.meaning.startswith("schlick_k, alpha = max(roughness, 0.001): ")
    assert "max(roughness^2, 0.001)" in table_channel(BrdfModel()).meaning
