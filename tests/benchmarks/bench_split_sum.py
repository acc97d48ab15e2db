"""How far is the split sum from the truth, per roughness?   python tests/benchmarks/bench_split_sum.py [PLOT.svg] [PATHS]

A white metal ball and a black dielectric one (F0 = 0.04) under the default sky, alone, so that nothing is occluded: `raster`
against `path` with 4096 paths per pixel. Printed per roughness: mean and largest relative difference over the ball's pixels,
and the standard error of `path` in the same units.
"""

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
from history import record

from analytic import Stage, at, make_scene, path_of, uv_sphere
from framepairs.scene.default_sky import default_environment
from framepairs.scene.description import Material

ROUGHNESS = [0.0, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0]
MATERIALS = {
    "metal": {"base_color": (1.0, 1.0, 1.0), "metallic": 1.0},
    "dielectric": {"base_color": (0.0, 0.0, 0.0), "metallic": 0.0},
}
SIZE = (48, 48)


def images(roughness: float, values: dict, paths: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(raster, path, standard error of path) at the ball's pixels [n, 3]."""
    ball = (uv_sphere(128, 64), Material(name="ball", roughness=roughness, **values), at(0, 0, -3))
    scene = make_scene(ball, sky=default_environment("Y"))
    keys = {"display": SIZE, "scales": (1,), "brdf_table": 512, "max_depth": 2, "samples_per_pixel": paths}
    found = {}
    for mode in ("raster", "path"):
        stage = Stage(scene, path_of(np.eye(4), fov_y_deg=40), shading=mode, **keys)
        found[mode] = stage.arrays(0, "lr_x1")
    inside = (found["raster"]["object_id"][..., 0] == 1) & (found["raster"]["brdf"].min(-1) > 0.01)
    error = np.sqrt(found["path"]["color_variance"])
    return found["raster"]["color"][inside], found["path"]["color"][inside], error[inside]


def measure(paths: int) -> dict[str, np.ndarray]:
    """Per material, [roughness, 4]: roughness, mean and largest relative difference, mean standard error."""
    curves = {}
    for name, values in MATERIALS.items():
        rows = []
        for roughness in ROUGHNESS:
            raster, path, error = images(roughness, values, paths)
            scale = path.mean(axis=0)
            off = np.abs(raster - path) / scale
            rows.append((roughness, off.mean(), off.max(), (error / scale).mean()))
            print(f"{name:10s} roughness {roughness:4.2f}: mean {off.mean():.4f}  largest {off.max():.4f}  "
                  f"standard error {(error / scale).mean():.4f}", flush=True)  # fmt: skip
        curves[name] = np.array(rows)
    return curves


def plot(curves: dict[str, np.ndarray], file: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    matplotlib.rcParams["svg.hashsalt"] = "framepairs"
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(6.4, 3.6), layout="constrained")
    for name, rows in curves.items():
        (line,) = axes.plot(rows[:, 0], rows[:, 1], marker="o", label=f"{name}, mean")
        axes.plot(rows[:, 0], rows[:, 2], linestyle="--", color=line.get_color(), label=f"{name}, largest")
        axes.plot(rows[:, 0], rows[:, 3], linestyle=":", color=line.get_color(), label=f"{name}, noise of path")
    axes.set(yscale="log", xlabel="roughness", ylabel="difference / mean radiance", title="raster (split sum) against path")
    axes.grid(True, which="both", alpha=0.3)
    axes.legend(fontsize="small")
    figure.savefig(file, metadata={"Date": None} if file.suffix == ".svg" else None)


def main() -> None:
    paths = int(sys.argv[2]) if len(sys.argv) > 2 else 4096
    curves = measure(paths)
    if len(sys.argv) > 1:
        plot(curves, Path(sys.argv[1]))
    means = {f"{name}, roughness {r:g}: mean difference": mean for name, rows in curves.items() for r, mean, *_ in rows}
    record("split_sum", means, paths=paths)


if __name__ == "__main__":
    main()
