"""What does a frame cost, in units of its own primary rays?   python tests/benchmarks/bench_frame.py [WIDTH HEIGHT]

Ratios within one run, so that machines and commits compare: frame 10 of the market, each cost the least of seven after two
warm-up rounds, all of them taken in turns. The rays are one per pixel of HR, `ray_intersect_preliminary`, in the tiles in
which the passes have them.
"""

import sys
import time
from types import SimpleNamespace

import numpy as np
from history import print_ratios, record

from framepairs.backend import dr, mi
from framepairs.bundled import find_camera_path, find_scene
from framepairs.camera_path import read_camera_path
from framepairs.channels import CHANNEL, CHANNELS
from framepairs.engine import Engine, fetch
from framepairs.exr import encode
from framepairs.frame import Shoot
from framepairs.gbuffer import camera_ray, gbuffers, pixel_of
from framepairs.lanes import lanes_of
from framepairs.plan import make_plan, plan_streams
from framepairs.projection import view_of
from framepairs.scene import light_scene, load_scene

ONE_SAMPLE = frozenset({"albedo", "normal", "depth", "roughness", "metallic", "specular", "object_id"})
MOTION = frozenset({"motion", "dual_motion", "visibility"})
AVERAGED = frozenset({"color", "emission", "brdf", "transparency"})
ALL = frozenset(channel.name for channel in CHANNELS)
VARIANTS = ("native", "jittered", "mip", "jittered_mip")
PAIR = ("lr_x2", "lr_x2_mip-1")  # one scale, the same places


def least(runs: dict, rounds: int = 7) -> dict[str, float]:
    """Seconds of the quickest of `rounds` runs of each after two warm-ups, everything synchronised; on LLVM those of all
    threads together, so that what else the machine does counts less."""
    clock = time.process_time if mi.variant().startswith("llvm") else time.perf_counter
    best = dict.fromkeys(runs, float("inf"))
    for turn in range(rounds + 2):
        for name, run in runs.items():
            start = clock()
            run()
            dr.sync_thread()
            if turn > 1:
                best[name] = min(best[name], clock() - start)
    return best


def ratios_of(width: int, height: int) -> dict[str, float]:
    scene, _ = light_scene(load_scene(find_scene("market")), None)
    plan = make_plan({"display": (width, height), "scales": (2, 3), "variants": VARIANTS, "channels": "all"})
    shoot = Shoot(scene, read_camera_path(find_camera_path("market")), width / height)
    engine, state = Engine(scene, plan), shoot.state(10)
    streams = {stream.name: stream for stream in plan_streams(plan)}
    hr, everything = [streams["hr"]], list(streams.values())
    view, (pose, _) = view_of(state.camera, state.render_origin), engine.shading.geometry.pose(state)
    lanes, index = lanes_of((width, height)), dr.arange(mi.UInt32, width * height)
    rows = mi.Float(index % width), mi.Float(index // width)

    def rays(x, y) -> None:
        ray = camera_ray(view, (x + 0.5) / width, (y + 0.5) / height)
        dr.eval(pose.scene.ray_intersect_preliminary(ray, coherent=True).t)

    shading, flags = engine.shading, {"hides": False, "culls": False}
    surfaces = shading.geometry.tables, shading.materials, shading.brdf, pose, view, lanes.x, lanes.y
    size = dr.opaque(mi.Float, width), dr.opaque(mi.Float, height)

    def traced(tables, materials, brdf, pose, view, x, y, size) -> tuple:
        geometry, pixel = SimpleNamespace(tables=tables, **flags), pixel_of(view, size, mi.Float(0))
        place = pose, view, (x + 0.5) / size[0], (y + 0.5) / size[1]
        sample = gbuffers(geometry, materials, brdf, *place, pixel, (pixel.bias,))[0][0]
        return sample.depth, sample.normal, sample.object_id, sample.f_beta, sample.surface.roughness

    def render(streams, channels):
        return lambda: fetch(engine.launch(state, streams, channels, 0))

    def each_alone() -> None:
        for stream in everything:
            engine.render(state, stream, ALL, 0)

    frozen = dr.freeze(traced)
    dr.eval(rows, lanes.x, lanes.y)
    arrays = engine.render(state, hr[0], ALL, 0).arrays
    pair = [streams[name] for name in PAIR]
    seconds = least(
        {
            "rays": lambda: rays(lanes.x, lanes.y),
            "rays in rows": lambda: rays(*rows),
            "G-buffers": render(hr, ONE_SAMPLE),
            "G-buffers and motion": render(hr, ONE_SAMPLE | MOTION),
            "one stream": render(pair[:1], ONE_SAMPLE | MOTION),
            "two streams": render(pair, ONE_SAMPLE | MOTION),
            "color": render(hr, AVERAGED),
            "frame": render(everything, ALL),
            "frame alone": each_alone,
            "traced": lambda: dr.eval(traced(*surfaces, size)),
            "frozen": lambda: dr.eval(frozen(*surfaces, size)),
            "encoding": lambda: [encode(CHANNEL[n], a, attributes={}) for n, a in arrays.items()],
        }
    )
    print(f"{width}x{height}, {mi.variant()}, frame 10 of market; rays {1000 * seconds['rays']:.1f} ms")
    pairs = {
        "rays in rows / rays": ("rays in rows", "rays"),
        "G-buffers / rays": ("G-buffers", "rays"),
        "G-buffers, motion, dual motion, visibility / rays": ("G-buffers and motion", "rays"),
        "G-buffers and motion of native and mip / of native": ("two streams", "one stream"),
        "colour, 16 samples / rays": ("color", "rays"),
        "all channels of HR and eight LR streams / rays": ("frame", "rays"),
        "all streams at once / each alone": ("frame", "frame alone"),
        "frozen G-buffers / traced": ("frozen", "traced"),
        "encoding all channels of HR / rays": ("encoding", "rays"),
    }
    ratios = {name: seconds[above] / seconds[below] for name, (above, below) in pairs.items()}
    assert all(np.isfinite(list(ratios.values())))
    return ratios


def main() -> None:
    given = [tuple(int(value) for value in sys.argv[1:3])] if len(sys.argv) > 2 else [(960, 540), (1920, 1080)]
    for width, height in given:
        ratios = ratios_of(width, height)
        print_ratios(ratios)
        record(f"frame {width}x{height}", ratios, variant=mi.variant())


if __name__ == "__main__":
    main()
