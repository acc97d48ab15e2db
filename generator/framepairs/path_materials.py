"""Materials in Mitsuba's terms, for `path` shading: BSDFs, opacity and emission that mean what `raster` draws."""

import numpy as np
from numpy.typing import NDArray

from .backend import dr, mi
from .scene.description import Material, Mesh, SceneDescription, Slot
from .scene.images import linear_texels


class MitsubaSurface:
    """A Material in Mitsuba's terms, for any number of meshes: BSDF, opacity, and emission / gain (None for gain 0)."""

    def __init__(self, scene: SceneDescription, material: Material):
        base = _texels(scene, material.base_texture) * np.float32((*material.base_color, material.opacity))
        packed = _texels(scene, material.surface_texture)[..., :3]
        packed = np.clip(packed * np.float32((material.specular, material.roughness, material.metallic)), 0, 1)
        metallic = packed[..., 2:]
        bsdf = {
            "type": "principled",
            "base_color": _texture(scene, material.base_texture, np.clip(base[..., :3], 0, 1)),
            "specular": float(packed[..., 0].mean(dtype=np.float64)),  # F0 = 0.08 specular, too; it takes no texture
            "roughness": _texture(scene, material.surface_texture, packed[..., 1:2]),
            "metallic": _texture(scene, material.surface_texture, metallic) if metallic.any() else 0.0,
        }
        bsdf = {"type": "twosided", "front": bsdf}
        if material.normal_texture:
            scale = np.float32((material.normal_scale, material.normal_scale, 1))
            encoded = _texels(scene, material.normal_texture)[..., :3] * scale / 2 + np.float32(0.5)
            bent = _Changed(_texture(scene, material.normal_texture, encoded), _along_v)
            bsdf = {"type": "normalmap", "normalmap": bent, "use_shadowing_function": False, "on": bsdf}
        self.opacity = mi.load_dict({"type": "uniform", "value": 1.0})
        if material.alpha != "opaque":
            self.opacity = _texture(scene, material.base_texture, np.clip(base[..., 3:], 0, 1))
            if material.alpha == "mask":
                cutoff = dr.opaque(mi.Float, material.alpha_cutoff)
                self.opacity = _Changed(self.opacity, lambda si, value: dr.select(value >= cutoff, mi.Float(1), 0))
            bsdf = {"type": "mask", "opacity": self.opacity, "on": bsdf}
        self.bsdf = mi.load_dict(bsdf)
        emission = _texels(scene, material.emission_texture)[..., :3] * np.float32(material.emission)
        emission = np.maximum(emission, 0)
        self.gain = float(emission.max())
        self.emission = _texture(scene, material.emission_texture, emission / self.gain) if self.gain else None

    def on(self, mesh: Mesh) -> mi.Mesh:
        """A mesh of this material; `PathTracer.pose` places it."""
        properties = mi.Properties()
        properties["bsdf"] = self.bsdf
        if self.emission:
            properties["emitter"] = _Glow(self, _shape(mesh, mi.Properties(), False))
        return _shape(mesh, properties, mesh.normals is not None)


def _shape(mesh: Mesh, properties: mi.Properties, smooth: bool) -> mi.Mesh:
    shape = mi.Mesh(mesh.name, len(mesh.positions), len(mesh.faces), properties, smooth, True)
    uv = np.zeros((len(mesh.positions), 2), np.float32) if mesh.uv is None else mesh.uv
    parameters = mi.traverse(shape)
    for name, array in (("vertex_positions", mesh.positions), ("vertex_texcoords", uv), ("faces", mesh.faces)):
        parameters[name] = np.ascontiguousarray(array).ravel()
    parameters.update()
    return shape


def _texels(scene: SceneDescription, slot: Slot | None) -> NDArray[np.float32]:
    """[h, w, 4], linear; white where the slot is empty."""
    return np.ones((1, 1, 4), np.float32) if slot is None else linear_texels(scene.textures[slot.texture])


def _texture(scene: SceneDescription, slot: Slot | None, values: NDArray[np.float32]) -> mi.Texture:
    """`values` [h, w, 1 or 3], first row at v = 1 (Mitsuba's lies at v = 0), in half precision as in `raster`.

    Mitsuba wraps u and v alike: where they should differ, repeating goes before mirroring before clamping.
    """
    if slot is None:
        value = values[0, 0].tolist()
        return mi.load_dict({"type": "rgb", "value": value} if len(value) == 3 else {"type": "uniform", "value": value[0]})
    for axis in (0, 1):
        values = values.repeat(2, axis) if values.shape[axis] == 1 else values  # Mitsuba wants 2 x 2 at least
    return mi.load_dict(
        {
            "type": "bitmap",
            "bitmap": mi.Bitmap(np.ascontiguousarray(values[::-1], dtype=np.float16)),
            "raw": True,
            "accel": False,  # CUDA's texture units interpolate with 8 bits
            "wrap_mode": min(scene.textures[slot.texture].wrap, key=("repeat", "mirror", "clamp").index),
            "to_uv": mi.ScalarTransform3f(np.array([*slot.uv, (0, 0, 1)])),
        }
    )


def _along_v(si: mi.SurfaceInteraction3f, encoded: mi.Color3f) -> mi.Color3f:
    """A normal map's texel for Mitsuba's frame: its bitangent is n x tangent, also where uv are mirrored."""
    mirrored = dr.dot(dr.cross(si.sh_frame.n, si.dp_du), si.dp_dv) < 0
    return mi.Color3f(encoded.x, dr.select(mirrored, 1 - encoded.y, encoded.y), encoded.z)


class _Changed(mi.Texture):
    """Another texture with its values replaced by `change(si, value)`."""

    def __init__(self, inner: mi.Texture, change):
        super().__init__(mi.Properties())
        self.inner, self.change = inner, change

    def eval_1(self, si, active=True):
        return self.change(si, self.inner.eval_1(si, active))

    def eval_3(self, si, active=True):
        return self.change(si, self.inner.eval_3(si, active))

    def is_spatially_varying(self):
        return True


class _Glow(mi.Emitter):
    """Emission of a surface, from both sides (Mitsuba's `area` has one) and thinned by its opacity.

    Points are drawn uniformly by area, so uv may overlap or repeat. Mitsuba takes the shading normal for where a point
    faces, which costs 5 % of the light of a box with smooth normals. So a sample is divided by the density on `flat`, the
    mesh without normals; the shape's own density weighs it against other strategies, where all that counts is that
    they agree.
    """

    def __init__(self, surface: MitsubaSurface, flat: mi.Mesh):
        super().__init__(mi.Properties())
        self.surface, self.flat, self.gain = surface, flat, dr.opaque(mi.Float, surface.gain)
        self.m_flags = mi.EmitterFlags.Surface

    def eval(self, si, active=True):
        return self.gain * self.surface.emission.eval(si, active) * self.surface.opacity.eval_1(si, active)

    def sample_direction(self, it, sample, active=True):
        ds = self.get_shape().sample_direction(it, sample, active)
        ds.emitter = mi.EmitterPtr(self)
        density = self.flat.sample_direction(it, sample, active).pdf
        usable = active & (ds.pdf > 0) & (density > 0)
        value = self.eval(mi.SurfaceInteraction3f(ds, it.wavelengths), usable)
        return ds, dr.select(usable, value / density, 0)

    def pdf_direction(self, it, ds, active=True):
        return self.get_shape().pdf_direction(it, ds, active)
