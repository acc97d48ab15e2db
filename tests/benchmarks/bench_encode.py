"""What would another compression of the files cost and save?   python tests/benchmarks/bench_encode.py [WIDTH HEIGHT]

All channels of the market's HR frame, each encoded and decoded with every codec of the OpenEXR binding that keeps what is
stored, or 24 bits of each float (PXR24), in CPU time, over ZIP at its default level. B44 and DWA are left out: they are made
for pictures, not for data. The binding has no setting for levels (an attribute is stored and not heeded); they are set here
through the C functions of the library inside it, for the whole process. All take turns; the least of three rounds counts.
"""

import ctypes
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import OpenEXR
from history import record

from framepairs.bundled import find_camera_path, find_scene
from framepairs.camera_path import read_camera_path
from framepairs.channels import CHANNEL
from framepairs.engine import Engine
from framepairs.exr import DTYPE, decode, encode
from framepairs.frame import Shoot
from framepairs.plan import make_plan, plan_streams
from framepairs.scene import light_scene, load_scene

ROUNDS = 3
NAMES = ("NO", "RLE", "ZIPS", "ZIP", "PIZ", "PXR24", "HTJ2K32", "HTJ2K256", "ZSTD")
LEVELS = {"ZIP": (1, 2, 3, 6, 9), "ZSTD": (1, 3, 9)}
LIBRARY = ctypes.CDLL(OpenEXR.__file__)


def codecs() -> dict[str, tuple[str, int | None]]:
    """Title: (codec, level), as the installed binding has them."""
    there = [name for name in NAMES if hasattr(OpenEXR, f"{name}_COMPRESSION")]
    titles = {name: (name, None) for name in there}
    for name, levels in LEVELS.items():
        if name in there and hasattr(LIBRARY, f"exr_set_default_{name.lower()}_compression_level"):
            titles |= {f"{name} at level {level}": (name, level) for level in levels}
    return titles


@contextmanager
def at_level(name: str, level: int | None) -> Iterator[None]:
    """The library's default level of a codec, for the time of the block."""
    if level is None:
        yield
        return
    get, put = (getattr(LIBRARY, f"exr_{verb}_default_{name.lower()}_compression_level") for verb in ("get", "set"))
    before = ctypes.c_int()
    get(ctypes.byref(before))
    put(level)
    try:
        yield
    finally:
        put(before)


def market_frame(size: tuple[int, int]) -> dict[str, np.ndarray]:
    """Every channel of HR of frame 10, as the engine gives it."""
    scene, _ = light_scene(load_scene(find_scene("market")), None)
    plan = make_plan({"display": size, "scales": (2,), "channels": "all"})
    state = Shoot(scene, read_camera_path(find_camera_path("market")), size[0] / size[1]).state(10)
    return Engine(scene, plan).render(state, plan_streams(plan)[0], frozenset(CHANNEL), 0).arrays


def once(title: str, arrays: dict[str, np.ndarray]) -> dict[str, tuple[float, float, int, float]]:
    """By channel: CPU seconds to encode and to decode, bytes, and the largest error of what was decoded."""
    name, level = codecs()[title]
    found = {}
    for channel, array in arrays.items():
        row, start = CHANNEL[channel], time.process_time()
        with at_level(name, level):
            data = encode(row, array, attributes={"compression": getattr(OpenEXR, f"{name}_COMPRESSION")}).data
        written = time.process_time()
        back, _ = decode(data, row.exr, Path(channel))
        read = time.process_time()
        stored = array.astype(DTYPE[row.dtype])
        differs = back != stored
        off = np.abs(back[differs].astype(np.float64) - stored[differs].astype(np.float64))
        found[channel] = (written - start, read - written, len(data), float(off.max()) if off.size else 0.0)
    return found


def main() -> None:
    size = tuple(int(value) for value in sys.argv[1:3]) if len(sys.argv) > 2 else (960, 540)
    arrays, titles = market_frame(size), codecs()
    rounds = [{title: once(title, arrays) for title in titles} for _ in range(ROUNDS + 1)][1:]
    table = {}  # title: [channels, 4]
    for title in titles:
        table[title] = np.array([list(each[title].values()) for each in rounds]).min(axis=0)
    sums = {title: rows.sum(axis=0) for title, rows in table.items()}
    zip_write, zip_read, zip_bytes, _ = sums["ZIP"]
    pixels = size[0] * size[1]
    print(f"{size[0]}x{size[1]}, {len(arrays)} channels of HR, OpenEXR {OpenEXR.__version__}; ZIP: {zip_bytes / pixels:.1f} "
          f"bytes per pixel, {1000 * zip_write:.0f} ms to encode, {1000 * zip_read:.0f} ms to decode")  # fmt: skip
    print(f"{'over ZIP':<20}{'encode':>8}{'size':>8}{'decode':>8}   largest error")
    ratios, errors = {}, {}
    for title, (write, read, count, _) in sums.items():
        wrong = {channel: row[3] for channel, row in zip(arrays, table[title], strict=True) if row[3]}
        told = ", ".join(f"{channel} {error:.2g}" for channel, error in wrong.items()) or "none"
        print(f"{title:<20}{write / zip_write:8.2f}{count / zip_bytes:8.3f}{read / zip_read:8.2f}   {told}")
        ratios |= {f"{title}: encode": write / zip_write, f"{title}: size": count / zip_bytes}
        ratios[f"{title}: decode"] = read / zip_read
        errors |= {title: wrong} if wrong else {}
    plain = [title for title, (_, level) in titles.items() if level is None]
    print(f"\n{'size over ZIP':<18}{'bytes/pixel':>12}" + "".join(f"{title:>10}" for title in plain))
    for index, channel in enumerate(arrays):
        base = table["ZIP"][index, 2]
        print(f"{channel:<18}{base / pixels:12.2f}" + "".join(f"{table[title][index, 2] / base:10.2f}" for title in plain))
    facts = {"size": list(size), "openexr": OpenEXR.__version__, "errors": errors}
    record("encode", ratios, zip_ms=1000 * zip_write, zip_bytes_per_pixel=zip_bytes / pixels, **facts)


if __name__ == "__main__":
    main()
