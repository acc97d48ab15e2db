"""A sampling seen from above: the scene shaded by height, its paths coloured by split, where they go and where they look."""

import io

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from .files import SPLITS, Sampling

COLOURS = {"train": "#e8590c", "val": "#1c7ed6", "test": "#9c36b5"}
WIDTH_INCHES = 9.0
KINDS = ("svg", "png")


def plot_paths(sampling: Sampling, kind: str) -> bytes:
    """The picture file, 'svg' or 'png'. Equal samplings give equal bytes."""
    low, high = sampling.map_low, sampling.map_high
    span = high - low
    file = sampling.file
    title = f"{file.scene}: {len(file.paths)} paths, {file.coverage:.1%} of {file.cells} cells seen"
    with rc_context({"svg.hashsalt": "framepairs", "font.size": 8}):
        height = float(np.clip(WIDTH_INCHES * span[1] / span[0], 3, 12)) + 0.6
        figure = Figure(figsize=(WIDTH_INCHES, height), layout="constrained")
        axes = figure.add_subplot()
        extent = (low[0], high[0], high[1], low[1])
        axes.imshow(sampling.map, cmap="Greys_r", extent=extent, interpolation="nearest", alpha=0.75)
        for record, cameras in zip(sampling.file.paths, sampling.cameras, strict=True):
            _draw(axes, cameras, sampling.axes, COLOURS[record.split], float(span.max()))
        _draw_scale(axes, sampling, span)
        names = ["XYZ"[axis].lower() for axis in sampling.axes]
        axes.set(
            xlim=(low[0], high[0]), ylim=(high[1], low[1]), xlabel=f"{names[0]}, scene units", ylabel=f"{names[1]}, scene units"
        )
        axes.set_title(title, fontsize=9)
        axes.legend(handles=_legend(sampling), fontsize=7, loc="upper right", framealpha=0.9)
        stream = io.BytesIO()
        figure.savefig(stream, format=kind, dpi=110, metadata={"Date": None} if kind == "svg" else {"Software": None})
    return stream.getvalue()


def _draw(axes, cameras: np.ndarray, across: tuple[int, int], colour: str, size: float) -> None:
    """The path, a dot where it begins, an arrow where it ends, and short strokes along the viewing direction."""
    place = cameras[:, across, 3]
    axes.plot(*place.T, color=colour, linewidth=1.3)
    axes.plot(*place[0], "o", color=colour, markersize=3)
    last = np.linalg.norm(place - place[-1], axis=1) > 0.004 * size
    if last.any():
        start = place[np.flatnonzero(last)[-1]]
        arrow = {"arrowstyle": "-|>", "color": colour, "shrinkA": 0, "shrinkB": 0, "mutation_scale": 9}
        axes.annotate("", xy=tuple(place[-1]), xytext=tuple(start), arrowprops=arrow)
    for index in range(0, len(cameras), max(len(cameras) // 6, 1)):
        tip = place[index] - 0.02 * size * cameras[index, across, 2]
        axes.plot(*np.stack([place[index], tip]).T, color=colour, linewidth=0.5, alpha=0.8)


def _draw_scale(axes, sampling: Sampling, span: np.ndarray) -> None:
    """A bar of a round number of metres."""
    wanted = 0.2 * float(span[0]) * sampling.metres_per_unit
    power = 10.0 ** np.floor(np.log10(wanted))
    metres = max(step * power for step in (1, 2, 5) if step * power <= wanted)
    length = metres / sampling.metres_per_unit
    left, bottom = sampling.map_low[0] + 0.03 * span[0], sampling.map_high[1] - 0.03 * span[1]
    axes.plot([left, left + length], [bottom, bottom], color="black", linewidth=3, solid_capstyle="butt")
    axes.text(left + length / 2, bottom - 0.01 * span[1], f"{metres:g} m", ha="center", va="bottom")


def _legend(sampling: Sampling) -> list[Line2D]:
    counts = {split: sum(record.split == split for record in sampling.file.paths) for split in SPLITS}
    shown = [(split, COLOURS[split], f"{split}: {count}") for split, count in counts.items() if count]
    lines = [Line2D([], [], color=colour, label=label) for _, colour, label in shown]
    return [*lines, Line2D([], [], color="black", linewidth=0.5, label="where it looks")]
