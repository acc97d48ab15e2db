"""The pinhole camera on the device: rays from fractions of the frame, and points back to fractions of the frame."""

from dataclasses import dataclass

import numpy as np

from .backend import dr, mi, opaque
from .frame import CameraState
from .transforms import Vector


@dataclass(frozen=True)
class View:
    """A camera around the render origin, every number opaque so that frames share one kernel.

    direction(x, y) = corner + x across + y down, with x, y in fractions of the frame; its component along the viewing axis
    is 1, so that a ray's parameter is view_z. rows: view_from_render [3 x 4], the third row giving +view_z. tangent: of
    half the field of view in x and y.
    """

    origin: mi.Point3f
    corner: mi.Vector3f
    across: mi.Vector3f
    down: mi.Vector3f
    rows: tuple[mi.Vector4f, mi.Vector4f, mi.Vector4f]
    tangent: mi.Vector2f
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


def view_of(camera: CameraState, render_origin: Vector) -> View:
    """Composed in float64, then rounded once."""
    rotation = camera.world_from_camera[:3, :3]
    origin = camera.world_from_camera[:3, 3] - render_origin
    tangent_y = np.tan(camera.fov_y / 2)
    tangent_x = tangent_y * camera.aspect
    right, up, backward = rotation.T
    rows = [np.append(axis, -axis @ origin) for axis in (right, up, -backward)]
    return View(
        origin=opaque(mi.Point3f, origin),
        corner=opaque(mi.Vector3f, -backward - tangent_x * right + tangent_y * up),
        across=opaque(mi.Vector3f, 2 * tangent_x * right),
        down=opaque(mi.Vector3f, -2 * tangent_y * up),
        rows=tuple(opaque(mi.Vector4f, row) for row in rows),
        tangent=opaque(mi.Vector2f, (tangent_x, tangent_y)),
        near=dr.opaque(mi.Float, camera.near),
        far=dr.opaque(mi.Float, camera.far),
    )


def direction(view: View, x: mi.Float, y: mi.Float) -> mi.Vector3f:
    """Direction [3] of the ray through (x, y), of unit length along the viewing axis."""
    return view.corner + x * view.across + y * view.down


def project(view: View, point: mi.Point3f) -> Projected:
    """Where a point in render space appears."""
    return _projected(view, point, 1)


def project_direction(view: View, vector: mi.Vector3f) -> Projected:
    """Where a point infinitely far away along `vector` appears; z is in units of the vector."""
    return _projected(view, vector, 0)


def _projected(view: View, place, w: int) -> Projected:
    x, y, z = (r.x * place.x + r.y * place.y + r.z * place.z + (r.w if w else 0) for r in view.rows)
    lateral = mi.Vector2f(x / view.tangent.x, -y / view.tangent.y)
    scale = 0.5 / dr.select(z > 0, z, 1)
    return Projected(0.5 + lateral.x * scale, 0.5 + lateral.y * scale, z, lateral)
