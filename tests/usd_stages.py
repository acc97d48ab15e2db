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


def load(folder, *prims, subdivision=2, allow_outside=False, **keys):
    return load_scene(usd(folder, *prims, **keys), subdivision=subdivision, allow_outside=allow_outside)


def placed(kind, value):
    """The two lines that give a prim one transform: placed("double3 xformOp:translate", "(1, 2, 3)")."""
    return f"{kind} = {value}", f'uniform token[] xformOpOrder = ["{kind.split()[1]}"]'


def image(file, width=7, height=5, seed=1, channels=3):
    """Writes random pixels and gives them back, [height, width, channels] uint8."""
    pixels = np.random.default_rng(seed).integers(0, 256, (height, width, channels), dtype=np.uint8)
    Image.fromarray(pixels).save(file)
    return pixels


def matrix(rows):
    """A USD matrix value from [4, 4] in column-vector convention."""
    return "(" + ", ".join("(" + ", ".join(repr(float(x)) for x in row) + ")" for row in np.transpose(rows)) + ")"


def values(array):
    """A USD array value, of numbers or of tuples."""
    items = (str(tuple(row)) if np.ndim(row) else str(row) for row in np.asarray(array).tolist())
    return "[" + ", ".join(items) + "]"


def triangles(points, faces=((0, 1, 2),)):
    """The topology and points of a triangle mesh; points: text after `point3f[] points`, or [P, 3]."""
    text = points if isinstance(points, str) else f" = {values(points)}"
    flat = values(np.reshape(faces, -1))
    return f"int[] faceVertexCounts = {[3] * len(faces)}\nint[] faceVertexIndices = {flat}\npoint3f[] points{text}"


def figure(joints, binds, animation, *meshes, rests=None, skeleton=()):
    """A SkelRoot /fig with skeleton, animation and meshes. binds, rests: [joints, 4, 4]; animation: lines."""
    rests = binds if rests is None else rests
    names = "[" + ", ".join(f'"{name}"' for name in joints) + "]"
    lines = (
        f"uniform token[] joints = {names}",
        f"uniform matrix4d[] bindTransforms = [{', '.join(map(matrix, binds))}]",
        f"uniform matrix4d[] restTransforms = [{', '.join(map(matrix, rests))}]",
        "rel skel:animationSource = </fig/anim>",
        *skeleton,
    )
    bones = prim("Skeleton", "bones", *lines, metadata='prepend apiSchemas = ["SkelBindingAPI"]')
    return prim("SkelRoot", "fig", bones, prim("SkelAnimation", "anim", *animation), *meshes)


def skinned(name, *lines):
    """A mesh bound to the skeleton of `figure`."""
    return prim("Mesh", name, "rel skel:skeleton = </fig/bones>", *lines, metadata='prepend apiSchemas = ["SkelBindingAPI"]')


def influences(joints, weights, interpolation="vertex"):
    """Joint indices and weights [points, influences] of a mesh; constant ones are [1, influences]."""
    width = np.shape(joints)[1]
    note = f'(elementSize = {width}\ninterpolation = "{interpolation}")'
    return (
        f"int[] primvars:skel:jointIndices = {values(np.ravel(joints))} {note}",
        f"float[] primvars:skel:jointWeights = {values(np.ravel(weights))} {note}",
    )
