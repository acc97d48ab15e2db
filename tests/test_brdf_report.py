"""What `framepairs brdf` measures, writes and plots."""

import numpy as np
import pytest

from framepairs.brdf_report import RUNS, Row, alphas, measure, plot, reference, reference_nodes, report
from framepairs.brdf_tables import DEFAULT_SAMPLES, brdf_table
from framepairs.conventions import BrdfModel
from framepairs.errors import InputError
from framepairs.exr import decode

MODEL = BrdfModel()
ROWS = [Row("hammersley", 16, 0.03, 0.1, 0.05), Row("hammersley", 64, 0.1, 0.08, 0.03), Row("quadrature", 8, 0.2, 2e-4, 4e-5)]


@pytest.mark.parametrize("visibility", ["separable_smith", "height_correlated", "schlick_k"])
def test_the_reference_stands_when_it_is_refined(visibility):
    alpha, cos_v = (v.ravel() for v in np.meshgrid([1e-3, 3e-3, 0.05, 1.0], [0.0, 1e-5, 1e-3, 0.05, 0.6, 1.0]))
    model = BrdfModel(visibility)
    coarse, fine = reference(model, alpha, cos_v), reference(model, alpha, cos_v, azimuths=160, tolerance=1e-11)
    assert np.abs(coarse - fine).max() < 1e-8


def test_the_reference_meets_what_is_known_in_closed_form():
    """alpha 1, n.v = 1: A + B = 1 - ln 2 in all three. And without Fresnel, 1 - A - B of a smooth mirror goes like alpha^2."""
    for visibility in ("separable_smith", "height_correlated", "schlick_k"):
        found = reference(BrdfModel(visibility), [1.0], [1.0])
        assert found.sum() == pytest.approx(1 - np.log(2), abs=1e-9)
    grazing = reference(BrdfModel("height_correlated"), [1e-3, 0.1, 1.0], [0.0, 0.0, 0.0])
    assert grazing.sum(1) == pytest.approx(np.ones(3), abs=1e-7)


def test_the_reference_is_an_integral_over_light():
    """600 x 1200 midpoints of (cos, azimuth) of the light and equations 4 to 10, which know nothing of half vectors' tilts."""
    alpha, cos_v = 0.3, 0.4
    cosine, phi = np.meshgrid((np.arange(600) + 0.5) / 600, (np.arange(1200) + 0.5) * np.pi / 600)
    sine = np.sqrt(1 - cosine**2)
    half = np.stack([sine * np.cos(phi) + np.sqrt(1 - cos_v**2), sine * np.sin(phi), cosine + cos_v])
    half /= np.linalg.norm(half, axis=0)
    v_h = np.sqrt(1 - cos_v**2) * half[0] + cos_v * half[2]
    d = alpha**2 / (np.pi * (half[2] ** 2 * (alpha**2 - 1) + 1) ** 2)
    lambda_l, lambda_v = ((np.sqrt(1 + alpha**2 * (1 / c**2 - 1)) - 1) / 2 for c in (cosine, cos_v))
    k = (alpha + 1) ** 2 / 8
    terms = {
        "separable_smith": 1 / ((1 + lambda_l) * (1 + lambda_v)),
        "height_correlated": 1 / (1 + lambda_l + lambda_v),
        "schlick_k": cosine / (cosine * (1 - k) + k) * cos_v / (cos_v * (1 - k) + k),
    }
    for visibility, g in terms.items():
        whole = d * g / (4 * cos_v) * 2 * np.pi
        bias = (whole * (1 - v_h) ** 5).mean()
        found = reference(BrdfModel(visibility), [alpha], [cos_v])[0]
        assert found[1] == pytest.approx(bias, abs=1e-5) and found.sum() == pytest.approx(whole.mean(), abs=1e-5)


@pytest.mark.parametrize("mapping", ["squared", "linear"])
@pytest.mark.parametrize("size", [8, 64, 512])
def test_nodes_of_the_reference_cover_corners_edges_and_the_bend(mapping, size):
    model = BrdfModel(mapping=mapping)
    rows, columns = reference_nodes(model, size)
    nodes = set(zip(rows.tolist(), columns.tolist(), strict=True))
    last = size - 1
    assert {(0, 0), (0, last), (last, 0), (last, last), (0, 1), (last, last - 1)} <= nodes
    assert rows.min() == 0 and rows.max() == last and columns.min() == 0 and columns.max() == last
    alpha = alphas(model, np.unique(rows), size)
    assert alpha[0] == 1e-3 and alpha[-1] == 1
    bend = np.flatnonzero(alpha > 1e-3)[0]
    assert np.unique(rows)[bend] - np.unique(rows)[bend - 1] == 1


def test_rows_tell_methods_samples_seconds_and_errors():
    rows = measure(MODEL, 32, (("hammersley", (16, 256)), ("quadrature", (6, 16))))
    assert [(row.method, row.samples) for row in rows] == [
        ("hammersley", 16), ("hammersley", 256), ("quadrature", 6), ("quadrature", 16),
    ]  # fmt: skip
    assert all(0 < row.seconds < 60 and 0 < row.rms_error < row.max_error for row in rows)
    assert 0.02 < rows[0].max_error < 0.5 and rows[1].rms_error < rows[0].rms_error
    assert 1e-4 < rows[2].max_error < 2e-3 and rows[3].max_error < 5e-5


def test_the_report_writes_the_table_that_renders_and_a_plot(tmp_path):
    model = BrdfModel("height_correlated", "linear")
    table_file, plot_file = tmp_path / "new" / "table.exr", tmp_path / "plot.svg"
    runs = (("hammersley", (16,)), ("quadrature", (4, 12)))
    rows = report(model, 24, table_file=table_file, plot_file=plot_file, runs=runs)
    assert len(rows) == 3 and plot_file.read_bytes().startswith(b"<?xml")
    table, header = decode(table_file.read_bytes(), ("A", "B"), table_file)
    assert np.array_equal(table, np.array(brdf_table(model, 24)))
    assert header["framepairs:meaning"].startswith("height_correlated, alpha = max(roughness, 0.001)")


def test_the_table_that_renders_is_among_what_is_measured():
    assert all(DEFAULT_SAMPLES[method] in counts for method, counts in RUNS)


def test_plots_of_the_same_rows_are_the_same_bytes():
    first, again = (plot(ROWS, MODEL, 512) for _ in range(2))
    assert first == again and b"<svg" in first and len(first) < 150_000
    assert plot(ROWS[:2], MODEL, 512) != first
    assert plot(ROWS, MODEL, 512, "png").startswith(b"\x89PNG")


def test_bad_sizes_and_plots_are_refused_before_anything_is_measured(tmp_path):
    with pytest.raises(InputError, match="at least 8, not 4"):
        report(MODEL, 4)
    with pytest.raises(InputError, match="a plot ends in .png or .svg"):
        report(MODEL, 64, table_file=tmp_path / "table.exr", plot_file=tmp_path / "plot.pdf")
    assert not list(tmp_path.iterdir())
