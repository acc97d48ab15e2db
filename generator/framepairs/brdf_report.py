"""How precise the table of A and B is, and what it costs: what `framepairs brdf` writes, tells and plots.

The reference is float64 and shares nothing with the table but the equations: adaptive Gauss-Kronrod quadrature over the half
vector's tilt, Gauss-Legendre quadrature over its azimuth as far as light is above the horizon.
"""

import io
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import quad_vec

from .backend import dr
from .brdf import MIN_ALPHA
from .brdf_tables import Method, brdf_table, table_channel, tabulate
from .conventions import BrdfModel
from .errors import InputError
from .exr import encode
from .manifest import make_folder, write_atomically

RUNS: tuple[tuple[Method, tuple[int, ...]], ...] = (
    ("hammersley", (16, 64, 256, 1024, 4096)),
    ("quadrature", (4, 6, 8, 12, 16, 24)),
)
PLOT_KINDS = ("png", "svg")


@dataclass(frozen=True)
class Row:
    """One way to make the table. seconds: wall time after a first run that compiled. Errors of A and B: against `reference`
    over `reference_nodes`."""

    method: Method
    samples: int
    seconds: float
    max_error: float
    rms_error: float


def report(
    model: BrdfModel,
    size: int = 512,
    *,
    table_file: Path | None = None,
    plot_file: Path | None = None,
    runs: Sequence[tuple[Method, Sequence[int]]] = RUNS,
) -> list[Row]:
    """Measure every method and number of samples; write the table that renders (EXR, A and B) and the plot where asked.

    Raises InputError for a size or for a plot's ending that cannot be.
    """
    if size < 8:
        raise InputError(f"must be at least 8, not {size}", field="size")
    kind = plot_file.suffix.removeprefix(".").lower() if plot_file else "svg"
    if kind not in PLOT_KINDS:
        raise InputError(f"a plot ends in .{' or .'.join(PLOT_KINDS)}", file=plot_file)
    if table_file:
        _write(table_file, encode(table_channel(model), brdf_table(model, size).numpy(), attributes={}).data)
    rows = measure(model, size, runs)
    if plot_file:
        _write(plot_file, plot(rows, model, size, kind))
    return rows


def measure(model: BrdfModel, size: int, runs: Sequence[tuple[Method, Sequence[int]]] = RUNS) -> list[Row]:
    """A row for every number of samples of every method."""
    rows, columns = reference_nodes(model, size)
    expected = reference(model, alphas(model, rows, size), (columns / (size - 1)) ** 2)
    found = []
    for method, counts in runs:
        _timed(model, size, method, 1)
        for samples in counts:
            table, seconds = _timed(model, size, method, samples)
            error = np.abs(table[rows, columns] - expected)
            found.append(Row(method, samples, seconds, float(error.max()), float(np.sqrt(np.mean(error**2)))))
    return found


def reference_nodes(model: BrdfModel, size: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """(rows, columns) of the nodes that are compared: all corners and edges, and the cone n.v ~ alpha, finely.

    Rows and columns grow like squares from the edges, so that half of them lie where A and B change fastest; two rows
    stand on either side of alpha = 0.001.
    """
    last = size - 1
    steps = np.round(last * np.linspace(0, 1, 15) ** 2)
    bend = (MIN_ALPHA**0.5 if model.mapping == "squared" else MIN_ALPHA) * last
    rows = np.unique(np.concatenate([steps, [int(bend), int(bend) + 1]])).astype(np.intp)
    columns = np.unique(np.concatenate([steps, [1, last - 1]])).astype(np.intp)
    grid = np.meshgrid(rows, columns, indexing="ij")
    return grid[0].ravel(), grid[1].ravel()


def alphas(model: BrdfModel, rows: NDArray, size: int) -> NDArray[np.float64]:
    """Alpha of rows of a table, in float64."""
    roughness = rows / (size - 1)
    return np.maximum(roughness**2 if model.mapping == "squared" else roughness, MIN_ALPHA)


def reference(
    model: BrdfModel, alpha: NDArray, cos_v: NDArray, *, azimuths: int = 64, tolerance: float = 1e-8
) -> NDArray[np.float64]:
    """[n, 2]: A and B at alpha [n] and cos_v [n], to some 1e-8.

    With tan(tilt) = alpha tan(q), D cos is the density sin(2 q) / (2 pi) of (q, azimuth). Light is above the horizon all
    around for tilts up to (90 degrees - theta_v) / 2, nowhere beyond (90 degrees + theta_v) / 2, and within
    cos(azimuth) > (cos_v / (2 cos(tilt)) - cos(tilt) cos_v) / (sin(tilt) sin_v) between.
    """
    alpha, cos_v = (np.asarray(values, dtype=np.float64)[:, None] for values in (alpha, cos_v))
    sine_v, theta_v = np.sqrt((1 - cos_v) * (1 + cos_v)), np.arccos(cos_v)
    nodes, weights = np.polynomial.legendre.leggauss(azimuths)
    ends = [np.arctan(np.tan((np.pi / 2 + side * theta_v) / 2) / alpha) for side in (-1, 1)]

    def ring(low: NDArray, high: NDArray, place: float) -> NDArray:
        q = low + (high - low) * place
        tilt = np.arctan(alpha * np.tan(q))
        cos_h, across = np.cos(tilt), np.sin(tilt) * sine_v
        horizon = cos_v / (2 * cos_h) - cos_h * cos_v
        least = np.divide(horizon, across, out=np.where(horizon > 0, 1.0, -1.0), where=across > 0)
        end = np.arccos(np.clip(least, -1, 1))
        v_h = across * np.cos(end * (nodes + 1) / 2) + cos_h * cos_v
        cos_l = np.maximum(2 * v_h * cos_h - cos_v, 0)
        weight = 4 * _visibility(model, cos_v, cos_l, alpha) * cos_l * v_h / cos_h
        weight *= np.sin(2 * q) / (2 * np.pi) * end * weights * (high - low)
        fresnel = np.clip(1 - v_h, 0, 1) ** 5
        return np.stack([(weight * (1 - fresnel)).sum(1), (weight * fresnel).sum(1)], axis=1)

    def both(place: float) -> NDArray:
        return ring(np.zeros_like(alpha), ends[0], place) + ring(*ends, place)

    return quad_vec(both, 0, 1, epsabs=tolerance, epsrel=0, norm="max", limit=4000)[0]


def plot(rows: Sequence[Row], model: BrdfModel, size: int, kind: str = "svg") -> bytes:
    """The picture file: error against time, a line for every method, log axes. SVG of the same rows has the same bytes."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    with rc_context({"svg.hashsalt": "framepairs", "font.size": 9}):
        figure = Figure(figsize=(6.4, 4), layout="constrained")
        axes = figure.add_subplot()
        for method, colour in (("hammersley", "tab:orange"), ("quadrature", "tab:blue")):
            chosen = [row for row in rows if row.method == method]
            seconds = [row.seconds for row in chosen]
            axes.plot(seconds, [row.max_error for row in chosen], "o-", color=colour, label=f"{method}, largest error")
            axes.plot(seconds, [row.rms_error for row in chosen], "o:", color=colour, label=f"{method}, RMS error")
            for row in chosen:
                place = {"textcoords": "offset points", "xytext": (4, 4), "fontsize": 7}
                axes.annotate(str(row.samples), (row.seconds, row.max_error), **place)
        axes.set(xscale="log", yscale="log", xlabel=f"seconds for {size} x {size} nodes", ylabel="error of A and B")
        axes.set_title(f"{model.visibility}, roughness {model.mapping}; numbers: samples", fontsize=9)
        axes.grid(alpha=0.3)
        axes.legend(fontsize=8)
        stream = io.BytesIO()
        figure.savefig(stream, format=kind, dpi=120, metadata={"Date": None} if kind == "svg" else {"Software": None})
    return stream.getvalue()


def _visibility(model: BrdfModel, n_v: NDArray, n_l: NDArray, alpha: NDArray) -> NDArray[np.float64]:
    """G / (4 n_v n_l) in float64, written without `brdf`; n_l may be 0."""
    if model.visibility == "schlick_k":
        k = (alpha + 1) ** 2 / 8
        return 1 / (4 * (n_v * (1 - k) + k) * (n_l * (1 - k) + k))
    root_v, root_l = (np.sqrt(alpha**2 * (1 - c * c) + c * c) for c in (n_v, n_l))
    if model.visibility == "separable_smith":
        return 1 / ((n_v + root_v) * (n_l + root_l))
    return 1 / (2 * np.maximum(n_v * root_l + n_l * root_v, 1e-300))


def _timed(model: BrdfModel, size: int, method: Method, samples: int) -> tuple[NDArray[np.float32], float]:
    dr.sync_thread()
    start = time.perf_counter()
    table = tabulate(model, size, method, samples)
    dr.eval(table)
    dr.sync_thread()
    seconds = time.perf_counter() - start
    return table.numpy(), seconds


def _write(file: Path, data: bytes) -> None:
    make_folder(file.parent)
    write_atomically(file, data)
