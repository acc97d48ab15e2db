"""Small USD stages as text, for the tests of the scene readers."""

import numpy as np
from PIL import Image

from framepairs.scene import load_scene

POINTS = "point3f[] points = [(0,0,0), (2,0,0), (2,1,0), (0,1,0), (1,3,0)]"
QUAD = f"int[] faceVertexCounts = [4]\nint[] faceVertexIndices = [0, 1, 2, 3]\n{POINTS}"
BINDING = 'prepend apiSchemas = ["MaterialBindingAPI"]'


def prim(kind, name, *lines, metadata=""):
    """A prim whose properties and children are `lines`."""
    body = "\n".join(lines)
    return f'def {kind} "{name}" ({metadata})\n{{\n{body}\n}}\n'


def usd(folder, *prims, header='upAxis = "Y"', name="scene.usda"):
    """The file of a stage."""
    file = folder / name
    file.write_text(f"#usda 1.0\n(\n{header}\n)\n" + "\n".join(prims))
    return file


def load(folder, *prims, **keys):
    return load_scene(usd(folder, *prims, **keys))


def placed(kind, value):
    """The two lines that give a prim one transform: placed("double3 xformOp:translate", "(1, 2, 3)")."""
    return f"{kind} = {value}", f'uniform token[] xformOpOrder = ["{kind.split()[1]}"]'


def image(file, width=7, height=5, seed=1, channels=3):
    """Writes random pixels and gives them back, [height, width, channels] uint8."""
    pixels = np.random.default_rng(seed).integers(0, 256, (height, width, channels), dtype=np.uint8)
    Image.fromarray(pixels).save(file)
    return pixels
