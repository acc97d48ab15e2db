"""Builds the bundled scene `crowd`, people before a station on a clear morning, into a folder (default: this one), from the
top of the checkout: `python -m scenes.crowd.build [FOLDER]`.

Everything is made from numbers with fixed seeds: skeleton.py, body.py, head.py and gait.py have the figures, people.py who
goes where in which clothes; station.py, hall.py and square.py the place; textures.py and sky.py the images. Metres, y up.
"""

import sys
from pathlib import Path

from scenes.making.gltf_stage import GltfStage

from . import hall, people, square, station, textures
from .looks import looks
from .sky import TO_SUN, write_sky


def build(folder: Path) -> None:
    textures.write_all(folder / "textures")
    write_sky(folder)
    crowd = GltfStage(folder, "crowd", looks(), seconds=people.SECONDS)
    people.write(crowd)
    station.arcade(crowd)
    hall.write(crowd)
    square.write(crowd)
    crowd.light("Sun", "directional", (1.0, 0.84, 0.62), 6.8, towards=-TO_SUN)
    crowd.save()
    print(f"{crowd.objects} meshes, {crowd.triangles} triangles")


if __name__ == "__main__":
    build(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
