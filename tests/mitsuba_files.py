"""A small Mitsuba scene on disk, with everything in it that scenes of this kind usually have."""

import json
from pathlib import Path

import numpy as np
from PIL import Image

OBJ = """v 0 0 0
v 2 0 0
v 2 1 0
v 0 1 0
v 0 0 3
vt 0.1 0.2
vt 0.9 0.2
vt 0.9 0.7
vt 0.1 0.7
f 1/1 2/2 3/3
f 1/1 3/3 4/4
f 1/1 4/2 5/3
"""

SCENE = """<scene version="3.0.0">
    <default name="spp" value="16"/>
    <default name="width" value="160"/>
    <integrator type="path"><integer name="max_depth" value="4"/></integrator>
    <sensor type="perspective" id="eye">
        <float name="fov" value="40"/>
        <transform name="to_world"><lookat origin="1, 2, 9" target="0 0.5 0" up="0 1 0"/></transform>
        <sampler type="independent"><integer name="sample_count" value="$spp"/></sampler>
        <film type="hdrfilm"><integer name="width" value="$width"/><integer name="height" value="90"/></film>
    </sensor>
    <emitter type="envmap" id="sky"><string name="filename" value="sky.exr"/><float name="scale" value="2"/></emitter>
    <emitter type="point" id="bulb"><point name="position" value="1 4 2"/><rgb name="intensity" value="3 2 1"/></emitter>
    <bsdf type="twosided" id="paint">
        <bsdf type="principled">
            <texture type="bitmap" name="base_color"><string name="filename" value="colors.png"/></texture>
            <float name="roughness" value="0.25"/>
        </bsdf>
    </bsdf>
    <bsdf type="normalmap" id="bumpy">
        <texture type="bitmap" name="normalmap">
            <boolean name="raw" value="true"/><string name="filename" value="colors.png"/>
        </texture>
        <bsdf type="diffuse"><rgb name="reflectance" value="0.2 0.4 0.6"/></bsdf>
    </bsdf>
    <bsdf type="dielectric" id="glass"><float name="int_ior" value="1.5"/></bsdf>
    <shape type="rectangle" id="floor">
        <transform name="to_world"><rotate x="1" angle="-90"/><scale value="5"/></transform>
        <ref id="bumpy"/>
    </shape>
    <shape type="obj" id="thing">
        <string name="filename" value="thing.obj"/>
        <transform name="to_world"><scale value="0.75"/><rotate y="1" angle="30"/><translate x="-2" y="0.5"/></transform>
        <ref id="paint"/>
    </shape>
    <shape type="sphere" id="lamp">
        <point name="center" value="2.5 1.5 0"/><float name="radius" value="0.5"/>
        <emitter type="area"><rgb name="radiance" value="5 4 3"/></emitter>
    </shape>
    <shape type="cube" id="block">
        <transform name="to_world"><scale value="0.4"/><rotate x="0.6" y="0.8" angle="20"/>
            <translate x="0.5" y="1"/></transform>
        <ref id="glass"/>
    </shape>
</scene>
"""

ANIMATION = {
    "version": 1,
    "objects": {
        "thing": {
            "keyframes": [
                {"time": 0, "translation": [-2, 0.5, 0]},
                {"time": 2, "translation": [0, 0.5, 0], "rotation": [0, 0, 1, 0]},
            ]
        },
        "block": {"visibility": [{"time": 1, "visible": False}]},
    },
}


def mitsubas_hits(scene, origins, directions) -> list[dict | None]:
    """What Mitsuba finds along rays [n, 3]: position, normal and uv as arrays and the shape's index; None without a hit."""
    from framepairs.backend import mi

    points, vectors = (mi.Float(np.ascontiguousarray(a, np.float32).ravel()) for a in (origins, directions))
    si = scene.ray_intersect(mi.Ray3f(_triples(points, len(origins)), _triples(vectors, len(origins))))
    shapes = [list(np.array(si.shape == shape)) for shape in scene.shapes()]
    columns = [np.array(value).T.astype(float) for value in (si.p, si.sh_frame.n, si.uv)]
    return [
        None if not valid else {"place": place, "normal": normal, "uv": uv, "shape": [s[k] for s in shapes].index(True)}
        for k, (valid, place, normal, uv) in enumerate(zip(np.array(si.is_valid()), *columns, strict=True))
    ]


def _triples(values, count: int):
    from framepairs.backend import dr, mi

    return dr.gather(mi.Vector3f, values, dr.arange(mi.UInt32, count))


def nearest_hit(scene, origin, direction):
    """(object, position, normal, Mitsuba's uv) by all triangles, Moeller and Trumbore 1997; None without a hit."""
    best, found = np.inf, None
    for index, (item, matrix) in enumerate(zip(scene.objects, scene.world_from_object(0.0), strict=True)):
        mesh = scene.meshes[item.mesh]
        world = mesh.positions @ matrix[:3, :3].T + matrix[:3, 3]
        p0, p1, p2 = (world[mesh.faces[:, k].astype(int)] for k in range(3))
        e1, e2 = p1 - p0, p2 - p0
        across = np.cross(direction, e2)
        with np.errstate(all="ignore"):
            scale = 1 / (e1 * across).sum(-1)
            u = ((origin - p0) * across).sum(-1) * scale
            q = np.cross(origin - p0, e1)
            v = (direction * q).sum(-1) * scale
            t = (e2 * q).sum(-1) * scale
            t = np.where((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 1e-6), t, np.inf)
        k = int(np.argmin(t))
        if t[k] < best:
            best = t[k]
            weights = np.array([1 - u[k] - v[k], u[k], v[k]])
            corners = mesh.faces[k].astype(int)
            outward = np.cross(e1[k], e2[k]) * np.sign(np.linalg.det(matrix[:3, :3]))  # mirrors keep the outside
            cofactor = np.linalg.inv(matrix[:3, :3]).T
            normal = outward if mesh.normals is None else cofactor @ (weights @ mesh.normals[corners])
            uv = np.full(2, np.nan) if mesh.uv is None else weights @ mesh.uv[corners]
            place = origin + best * direction
            found = index, place, normal / np.linalg.norm(normal), np.array([uv[0], 1 - uv[1]])
    return found


def write_scene(folder: Path, scene: str = SCENE, *, animated: bool = False) -> Path:
    """scene.xml and the files that it names."""
    import OpenEXR

    random = np.random.default_rng(3)
    (folder / "thing.obj").write_text(OBJ)
    Image.fromarray(random.integers(0, 256, (5, 7, 3), dtype=np.uint8)).save(folder / "colors.png")
    sky = random.uniform(0.1, 1, (8, 16, 3)).astype(np.float32)
    OpenEXR.File({}, {"RGB": np.ascontiguousarray(sky)}).write(str(folder / "sky.exr"))
    (folder / "scene.xml").write_text(scene)
    if animated:
        (folder / "scene.animation.json").write_text(json.dumps(ANIMATION))
    return folder / "scene.xml"
