"""What do textures cost, in units of the same pass without them?   python tests/benchmarks/bench_textures.py [WIDTH HEIGHT]

The market's HR frame, trilinear and with 4, 8 and 16 taps, over the scene with all textures taken away; once as it is, and
once with its alpha masks made solid (without its texture, a mask has no holes, and rays end earlier). All variants take
turns; the least of nine rounds after two of warm-up, in CPU time on LLVM, so that other processes disturb little.
"""

import sys
import time
from dataclasses import replace
from functools import partial

from history import record

from framepairs.backend import dr, mi
from framepairs.bundled import find_camera_path, find_scene
from framepairs.camera_path import read_camera_path
from framepairs.engine import Engine
from framepairs.frame import Shoot
from framepairs.materials import SLOTS, build_materials
from framepairs.plan import make_plan, plan_streams
from framepairs.scene import light_scene, load_scene
from framepairs.scene.description import SceneDescription
from framepairs.textures import TextureSettings

PASSES = {
    "G-buffers": frozenset({"albedo", "normal", "depth", "roughness", "metallic", "specular", "object_id"}),
    "colour, 16 samples": frozenset({"color", "emission", "brdf", "transparency"}),
}
FILTERS = {"trilinear": 1, "4 taps": 4, "8 taps": 8, "16 taps": 16}
ROUNDS, WARM_UP = 9, 2


def with_materials(scene: SceneDescription, **changes) -> SceneDescription:
    return replace(scene, materials=tuple(replace(material, **changes) for material in scene.materials))


def least(runs: dict) -> dict[str, float]:
    """Seconds of the quickest round of each."""
    clock = time.process_time if mi.variant().startswith("llvm") else time.perf_counter
    best = dict.fromkeys(runs, float("inf"))
    for k in range(ROUNDS + WARM_UP):
        for name, run in runs.items():
            start = clock()
            run()
            dr.sync_thread()
            best[name] = min(best[name], clock() - start if k >= WARM_UP else float("inf"))
    return best


def main() -> None:
    width, height = (int(value) for value in sys.argv[1:3]) if len(sys.argv) > 2 else (960, 540)
    market, _ = light_scene(load_scene(find_scene("market")), None)
    plan = make_plan({"display": (width, height), "scales": (2,), "channels": "all"})
    path, hr = read_camera_path(find_camera_path("market")), plan_streams(plan)[0]
    print(f"{width}x{height}, {mi.variant()}, frame 10 of market; over the same pass without textures")
    found = {}
    for title, scene in (("as it is", market), ("masks made solid", with_materials(market, alpha="opaque"))):
        state = Shoot(scene, path, width / height).state(10)
        engines = {"no textures": Engine(with_materials(scene, **dict.fromkeys(SLOTS)), plan)}
        for name, anisotropy in FILTERS.items():
            engine = engines[name] = Engine(scene, plan)
            materials = build_materials(scene, settings=TextureSettings(anisotropy=anisotropy))
            engine.shading = replace(engine.shading, materials=materials)
        for what, channels in PASSES.items():
            seconds = least({name: partial(engine.render, state, hr, channels, 0) for name, engine in engines.items()})
            ratios = "   ".join(f"{name} {value / seconds['no textures']:.2f}" for name, value in seconds.items())
            print(f"{title}, {what} ({1000 * seconds['no textures']:.0f} ms):   {ratios}")
            found |= {f"{title}, {what}: {name}": seconds[name] / seconds["no textures"] for name in FILTERS}
    record("textures", found, size=[width, height])


if __name__ == "__main__":
    main()
