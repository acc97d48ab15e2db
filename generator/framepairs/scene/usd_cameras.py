"""Cameras of USD stages (UsdGeomCamera).

Source: the schema of UsdGeom's Camera, and GfCamera's frustum: apertures, their offsets and the focal length are in tenths
of a scene unit, of which a perspective view uses the ratios alone. The camera looks along its -z axis, y up. Exposure,
focus and shutter are named where they act. clippingRange is taken where it is authored.
"""

import math
from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom

from ..errors import InputError
from .description import CameraView, SceneCamera
from .usd_arrays import number, typed
from .usd_placement import is_animated

APERTURE_UNIT = 0.1  # scene units
OF_VIEW = ("projection", "focalLength", "clippingRange") + tuple(
    f"{axis}Aperture{what}" for axis in ("horizontal", "vertical") for what in ("", "Offset")
)
EARLIEST = Usd.TimeCode.EarliestTime()
OfTime = Callable[[Callable[[Usd.TimeCode], CameraView]], Callable[[float], CameraView]]


def read_cameras(stage: Usd.Stage, of_time: OfTime, not_read: list[str]) -> tuple[SceneCamera, ...]:
    """All cameras that are active and defined, in instances, too, but in prototypes of point instancers.

    of_time: makes a function of a time code one of the time in seconds. The vertical field of view and height hold, whatever
    the aspect ratio. `not_read` grows, also by cameras without a view at the earliest time. What they become later, too, raises
    InputError naming the camera at that time.
    """
    found = []
    prims = iter(Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies()))
    for prim in prims:
        if prim.IsA(UsdGeom.PointInstancer):
            prims.PruneChildren()
        if not prim.IsA(UsdGeom.Camera):
            continue
        camera = UsdGeom.Camera(prim)
        try:
            camera_view(camera, EARLIEST)
        except InputError as error:
            not_read.append(f"camera {prim.GetPath()}: {error.problem}")
            continue
        varies = any(prim.GetAttribute(name).ValueMightBeTimeVarying() for name in OF_VIEW)
        at = of_time(partial(camera_view, camera))
        found.append(SceneCamera(name=str(prim.GetPath()), at=at, moves=varies or is_animated(prim)))
        not_read += [f"{what} of camera {prim.GetPath()}" for what in _differences(camera)]
    return tuple(found)


def camera_view(camera: UsdGeom.Camera, code: Usd.TimeCode) -> CameraView:
    """What a camera sees at a time. Raises InputError naming it where it sees nothing."""
    path = str(camera.GetPath())
    width, height, right, up, focal = (
        number(attribute, code)
        for attribute in (
            camera.GetHorizontalApertureAttr(),
            camera.GetVerticalApertureAttr(),
            camera.GetHorizontalApertureOffsetAttr(),
            camera.GetVerticalApertureOffsetAttr(),
            camera.GetFocalLengthAttr(),
        )
    )
    perspective = typed(camera.GetProjectionAttr(), code) != UsdGeom.Tokens.orthographic
    if not all(map(math.isfinite, (width, height, right, up, focal))) or min(width, height) <= 0:
        raise InputError(f"aperture {width:g} x {height:g}, offset ({right:g}, {up:g}), focal length {focal:g}", field=path)
    if perspective and focal <= 0:
        raise InputError(f"focal length {focal:g}", field=path)
    clipping = camera.GetClippingRangeAttr()
    near, far = (float(x) for x in typed(clipping, code)) if clipping.HasAuthoredValue() else (None, None)
    if near is not None and not (near < far and (near > 0 or not perspective)):
        raise InputError(f"clippingRange ({near:g}, {far:g})", field=path)
    return CameraView(
        world_from_camera=_rigid(np.array(UsdGeom.XformCache(code).GetLocalToWorldTransform(camera.GetPrim())).T, path),
        fov_y=2 * math.atan(height / (2 * focal)) if perspective else None,
        height=None if perspective else height * APERTURE_UNIT,
        shift=(-right / width, up / height),  # the aperture moves, the image on it the other way
        near=near,
        far=far,
    )


def _rigid(matrix: NDArray[np.float64], path: str) -> NDArray[np.float64]:
    """[4, 4] without scale, shear and mirroring: it looks where the matrix sends -z, and up is as near to its y as can be."""
    z, y = matrix[:3, 2], matrix[:3, 1]
    depth = np.linalg.norm(z)
    up = y - z * (y @ z) / depth**2 if depth > 0 else np.zeros(3)
    height = np.linalg.norm(up)
    if not np.isfinite(matrix).all() or not height > 1e-9 * np.linalg.norm(y):
        raise InputError("a transform that is not finite, or that flattens it", field=path)
    out = np.eye(4)
    out[:3, 1], out[:3, 2], out[:3, 3] = up / height, z / depth, matrix[:3, 3]
    out[:3, 0] = np.cross(out[:3, 1], out[:3, 2])
    return out


def _differences(camera: UsdGeom.Camera) -> list[str]:
    """What a camera does and is not drawn, at the earliest time."""
    prim = camera.GetPrim()
    said = []
    stop, focus = (number(attribute) for attribute in (camera.GetFStopAttr(), camera.GetFocusDistanceAttr()))
    if stop > 0 and focus > 0:
        said.append(f"depth of field (fStop {stop:g}, focusDistance {focus:g})")
    shutter = [number(attribute) for attribute in (camera.GetShutterOpenAttr(), camera.GetShutterCloseAttr())]
    if shutter[0] != shutter[1]:
        said.append(f"shutter ({shutter[0]:g} to {shutter[1]:g})")
    scale = float(camera.ComputeLinearExposureScale(EARLIEST))
    if not math.isclose(scale, 1, rel_tol=1e-6):
        said.append(f"exposure ({scale:.4g} times)")
    if len(typed(camera.GetClippingPlanesAttr()) or ()):
        said.append("clippingPlanes")
    if np.linalg.det(np.array(UsdGeom.XformCache(EARLIEST).GetLocalToWorldTransform(prim))[:3, :3]) < 0:
        said.append("mirroring")
    return said
