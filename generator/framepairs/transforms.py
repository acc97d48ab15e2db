"""Float64 matrices on the host. Named `a_from_b`, so that products read like dominoes; column vectors, row-major arrays."""

import math

import numpy as np
from numpy.typing import NDArray

Matrix = NDArray[np.float64]  # [4, 4]
Vector = NDArray[np.float64]  # [3]


def look_at(position: Vector, target: Vector, up: Vector) -> Matrix:
    """world_from_camera of a camera at `position` that looks along -z at `target`, its y axis near `up`.

    Looking along `up` (or its opposite) takes the world axis most nearly perpendicular to it as up instead. A target at
    the position itself raises ValueError.
    """
    backward = position - target
    distance = np.linalg.norm(backward)
    if not distance > 0:
        raise ValueError("the camera's target is its own position")
    backward = backward / distance
    right = np.cross(up, backward)
    if np.linalg.norm(right) < 1e-9 * np.linalg.norm(up):
        right = np.cross(np.eye(3)[np.argmin(np.abs(backward))], backward)
    right = right / np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3] = np.stack([right, np.cross(backward, right), backward, position], axis=1)
    return matrix


def rigid(rotation: NDArray[np.float64], position: Vector) -> Matrix:
    """The matrix of a rotation [3, 3] followed by a translation [3]."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, position
    return matrix


def translation(offset: Vector) -> Matrix:
    return rigid(np.eye(3), offset)


def rotation_from_quaternion(quaternion: NDArray[np.float64]) -> NDArray[np.float64]:
    """[3, 3] from (w, x, y, z) of any non-zero length."""
    w, x, y, z = quaternion / np.linalg.norm(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def quaternion_from_rotation(rotation: NDArray[np.float64]) -> NDArray[np.float64]:
    """(w, x, y, z), unit length, of a rotation [3, 3]; by the largest component, so that no case divides by zero."""
    m = rotation
    squares = np.array(
        [
            1 + m[0, 0] + m[1, 1] + m[2, 2],
            1 + m[0, 0] - m[1, 1] - m[2, 2],
            1 - m[0, 0] + m[1, 1] - m[2, 2],
            1 - m[0, 0] - m[1, 1] + m[2, 2],
        ]
    )
    a, b, c = m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]
    d, e, f = m[1, 0] + m[0, 1], m[0, 2] + m[2, 0], m[2, 1] + m[1, 2]
    rows = np.array([[squares[0], a, b, c], [a, squares[1], d, e], [b, d, squares[2], f], [c, e, f, squares[3]]])
    row = rows[int(np.argmax(squares))]
    return row / np.linalg.norm(row)


def slerp(a: NDArray[np.float64], b: NDArray[np.float64], t: float) -> NDArray[np.float64]:
    """Unit quaternion at `t` in [0, 1] on the shorter arc from `a` to `b`; linear where the arc is too short to divide."""
    b = b if np.dot(a, b) >= 0 else -b
    angle = math.atan2(np.linalg.norm(a - b), np.linalg.norm(a + b)) * 2  # well conditioned at 0 and at pi
    if angle < 1e-8:
        mixed = (1 - t) * a + t * b
    else:
        mixed = (math.sin((1 - t) * angle) * a + math.sin(t * angle) * b) / math.sin(angle)
    return mixed / np.linalg.norm(mixed)


def clip_from_view(
    fov_y: float, aspect: float, near: float, far: float, shift: tuple[float, float] = (0.0, 0.0)
) -> Matrix:
    """OpenGL perspective: clip x, y, z in [-w, w], w = -z. `fov_y` in radians, `aspect` = width / height. `shift` moves the
    image by fractions of the frame, x right, y down."""
    cotangent = 1 / math.tan(fov_y / 2)
    matrix = np.zeros((4, 4))
    matrix[0, 0], matrix[1, 1] = cotangent / aspect, cotangent
    matrix[0, 2], matrix[1, 2] = -2 * shift[0], 2 * shift[1]
    matrix[2, 2], matrix[2, 3] = (far + near) / (near - far), 2 * far * near / (near - far)
    matrix[3, 2] = -1
    return matrix


def orthographic_clip_from_view(
    height: float, aspect: float, near: float, far: float, shift: tuple[float, float] = (0.0, 0.0)
) -> Matrix:
    """OpenGL orthographic projection of a view `height` units high: clip x, y, z in [-1, 1], w = 1."""
    matrix = np.eye(4)
    matrix[0, 0], matrix[1, 1] = 2 / (height * aspect), 2 / height
    matrix[0, 3], matrix[1, 3] = 2 * shift[0], -2 * shift[1]
    matrix[2, 2], matrix[2, 3] = 2 / (near - far), (far + near) / (near - far)
    return matrix
