"""The camera on the device: rays from fractions of the frame, and points back to fractions of the frame."""

from dataclasses import dataclass

import numpy as np

from .backend import dr, mi, opaque
from .frame import CameraState
from .transforms import Vector


@dataclass(frozen=True)
class View:
    """A camera around the render origin, every number opaque so that frames share one kernel.

    The ray of (x, y), fractions of the frame, starts at origin + x origin_across + y origin_down and goes along
    corner + x across + y down, whose component along the viewing axis is 1, so that a ray's parameter is view_z. A pinhole
    has no change of origin, an orthographic camera none of direction. rows: view_from_render [3 x 4], the third row giving
    +view_z. tangent: of half the field of view in x and y, or half the orthographic view's extents. shift: of the image,
    fractions of the frame. perspective: whether it is a pinhole.
    """

    origin: mi.Point3f
    origin_across: mi.Vector3f
    origin_down: mi.Vector3f
    corner: mi.Vector3f
    across: mi.Vector3f
    down: mi.Vector3f
    rows: tuple[mi.Vector4f, mi.Vector4f, mi.Vector4f]
    tangent: mi.Vector2f
    shift: mi.Vector2f
    perspective: mi.Bool
    near: mi.Float
    far: mi.Float


@dataclass(frozen=True)
class Projected:
    """x, y: fractions of the frame, y down (meaningless where z <= 0). z: along the viewing axis. lateral: the place in
    units of tan(half field of view) before the division by z, y down."""

    x: mi.Float
    y: mi.Float
    z: mi.Float
    lateral: mi.Vector2f


def view_of(camera: CameraState, render_origin: Vector, precise: bool = False) -> View:
    """Composed in float64, then rounded once, or kept in float64 where `precise`."""
    single = (mi.Float, mi.Vector2f, mi.Vector3f, mi.Point3f, mi.Vector4f)
    scalar, vector2, vector3, point3, vector4 = (
        (mi.Float64, mi.Vector2d, mi.Vector3d, mi.Point3d, mi.Vector4d) if precise else single
    )
    rotation = camera.world_from_camera[:3, :3]
    origin = camera.world_from_camera[:3, 3] - render_origin
    half_height = np.tan(camera.fov_y / 2) if camera.height is None else camera.height / 2
    extent = np.array([half_height * camera.aspect, half_height])
    right, up, backward = rotation.T
    rows = [np.append(axis, -axis @ origin) for axis in (right, up, -backward)]
    begin = -(1 + 2 * np.array(camera.shift)) * extent  # lateral place of the frame's corner, x right, y down
    corner, across, down = begin[0] * right - begin[1] * up, 2 * extent[0] * right, -2 * extent[1] * up
    nothing = np.zeros(3)
    lens, place = (corner, across, down), (nothing, nothing, nothing)
    if camera.height is not None:
        lens, place = place, lens
    return View(
        origin=opaque(point3, origin + place[0]),
        origin_across=opaque(vector3, place[1]),
        origin_down=opaque(vector3, place[2]),
        corner=opaque(vector3, lens[0] - backward),
        across=opaque(vector3, lens[1]),
        down=opaque(vector3, lens[2]),
        rows=tuple(opaque(vector4, row) for row in rows),
        tangent=opaque(vector2, extent),
        shift=opaque(vector2, camera.shift),
        perspective=dr.opaque(mi.Bool, camera.height is None),
        near=dr.opaque(scalar, camera.near),
        far=dr.opaque(scalar, camera.far),
    )


def origin(view: View, x: mi.Float, y: mi.Float) -> mi.Point3f:
    """Where the ray through (x, y) starts, in render space."""
    return view.origin + x * view.origin_across + y * view.origin_down


def direction(view: View, x: mi.Float, y: mi.Float) -> mi.Vector3f:
    """Direction [3] of the ray through (x, y), of unit length along the viewing axis."""
    return view.corner + x * view.across + y * view.down


def project(view: View, point: mi.Point3f) -> Projected:
    """Where a point in render space appears."""
    return _projected(view, point, 1)


def project_direction(view: View, vector: mi.Vector3f) -> Projected:
    """Where a point infinitely far away along `vector` appears to a pinhole; z is in units of the vector."""
    return _projected(view, vector, 0)


def _projected(view: View, place, w: int) -> Projected:
    x, y, z = (r.x * place.x + r.y * place.y + r.z * place.z + (r.w if w else 0) for r in view.rows)
    lateral = type(view.tangent)(x / view.tangent.x, -y / view.tangent.y)
    scale = 0.5 / dr.select((z > 0) & view.perspective, z, 1)
    centre = 0.5 + view.shift
    return Projected(centre.x + lateral.x * scale, centre.y + lateral.y * scale, z, lateral)
