"""What does a frame cost, in units of its own primary rays?   python tests/benchmarks/bench_frame.py [WIDTH HEIGHT]

Ratios within one run, so that machines and commits compare: each pass of the market's HR frame over the traversal of the same
rays, after two warm-up rounds, the least of five.
"""

import sys
import time

import numpy as np

from framepairs.backend import dr, mi
from framepairs.bundled import find_camera_path, find_scene
from framepairs.camera_path import read_camera_path
from framepairs.channels import CHANNEL, CHANNELS
from framepairs.engine import Engine
from framepairs.exr import encode
from framepairs.frame import Shoot
from framepairs.gbuffer import camera_ray
from framepairs.plan import make_plan, plan_streams
from framepairs.projection import view_of
from framepairs.scene import light_scene, load_scene

ONE_SAMPLE = frozenset({"albedo", "normal", "depth", "roughness", "metallic", "specular", "object_id"})
MOTION = frozenset({"motion", "dual_motion", "visibility"})
AVERAGED = frozenset({"color", "emission", "brdf", "transparency"})


def least(run, rounds: int = 5) -> float:
    """Seconds of the quickest of `rounds` runs after two warm-ups, everything synchronised."""
    times = []
    for _ in range(rounds + 2):
        start = time.perf_counter()
        run()
        dr.sync_thread()
        times.append(time.perf_counter() - start)
    return min(times[2:])


def main() -> None:
    width, height = (int(value) for value in sys.argv[1:3]) if len(sys.argv) > 2 else (960, 540)
    scene, _ = light_scene(load_scene(find_scene("market")), None)
    plan = make_plan({"display": (width, height), "scales": (2, 3), "channels": "all"})
    shoot = Shoot(scene, read_camera_path(find_camera_path("market")), width / height)
    engine, state = Engine(scene, plan), shoot.state(10)
    hr, *lr = plan_streams(plan)
    view, (pose, _) = view_of(state.camera, state.render_origin), engine.shading.geometry.pose(state)

    def raw_rays() -> None:
        index = dr.arange(mi.UInt32, width * height)
        x, y = (mi.Float(index % width) + 0.5) / width, (mi.Float(index // width) + 0.5) / height
        dr.eval(pose.scene.ray_intersect_preliminary(camera_ray(view, x, y), coherent=True).t)

    rays = least(raw_rays)
    everything = frozenset(channel.name for channel in CHANNELS)
    rendered = engine.render(state, hr, everything, 0).arrays
    costs = {
        "raw primary rays (HR, one per pixel)": rays,
        "G-buffers": least(lambda: engine.render(state, hr, ONE_SAMPLE, 0)),
        "G-buffers, motion, dual motion, visibility": least(lambda: engine.render(state, hr, ONE_SAMPLE | MOTION, 0)),
        "colour, 16 samples": least(lambda: engine.render(state, hr, AVERAGED, 0)),
        "all channels of HR": least(lambda: engine.render(state, hr, everything, 0)),
        "all channels of four LR streams": least(lambda: [engine.render(state, stream, everything, 0) for stream in lr]),
        "encoding all channels of HR": least(lambda: [encode(CHANNEL[n], a, attributes={}) for n, a in rendered.items()]),
    }
    print(f"{width}x{height}, {mi.variant()}, frame 10 of market; over raw primary rays ({1000 * rays:.1f} ms)")
    for name, seconds in costs.items():
        print(f"{seconds / rays:8.1f} x  {name}")
    assert all(np.isfinite(list(costs.values())))


if __name__ == "__main__":
    main()
