"""Motion in float64, for triangles so large that float32 places on them are too coarse.

A float32 place is wrong by some 2^-24 of its triangle's extent, also where only a small part of the triangle fills the frame:
a plane a thousand times larger than the view errs by hundredths of a pixel. There the ray is cut with the plane again.
"""

from .backend import dr, mi
from .geometry import Geometry, Pose
from .projection import View, direction, origin, project
from .tracing import Hit, triangle_of

LARGE = 100.0  # extent of a triangle, in heights of the view at its depth, from which on float64 is used


def is_large(geometry: Geometry, pose: Pose, view: View, hit: Hit, depth: mi.Float) -> mi.Bool:
    """Whether the hit's triangle needs it; `depth` is the hit's view_z."""
    triangle = triangle_of(geometry.tables, pose, hit)
    edges = (triangle.edge1, triangle.edge2, triangle.edge2 - triangle.edge1)
    squared = dr.maximum(dr.maximum(*(dr.squared_norm(edge) for edge in edges[:2])), dr.squared_norm(edges[2]))
    height = 2 * view.tangent.y * dr.select(view.perspective, depth, 1)
    return hit.valid & (squared > dr.square(LARGE * height))


def precise_motion(
    geometry: Geometry,
    pose: Pose,
    previous_pose: Pose,
    view: View,
    previous_view: View,
    hit: Hit,
    x: mi.Float,
    y: mi.Float,
) -> tuple[mi.Point2f, mi.Float, mi.Vector2f]:
    """(previous place in fractions of the frame, previous view_z, previous minus present place) of what (x, y) shows.

    Both views are precise (`view_of`). Points behind the previous camera have a meaningless place.
    """
    double = mi.Float64
    x, y = double(x), double(y)
    start, towards = origin(view, x, y), direction(view, x, y)
    corner, edge1, edge2 = _edges(geometry, pose, hit)
    # start + t towards = corner + u edge1 + v edge2 (Moeller and Trumbore 1997)
    across = dr.cross(towards, edge2)
    determinant = dr.dot(edge1, across)
    scale = dr.select(determinant != 0, 1 / dr.select(determinant != 0, determinant, 1), 0)
    offset = mi.Vector3d(start - corner)
    u, v = dr.dot(offset, across) * scale, dr.dot(towards, dr.cross(offset, edge1)) * scale
    then_corner, then_edge1, then_edge2 = _edges(geometry, previous_pose, hit)
    now = project(view, corner + u * edge1 + v * edge2)
    then = project(previous_view, then_corner + u * then_edge1 + v * then_edge2)
    apart = mi.Vector2f(mi.Float(then.x - now.x), mi.Float(then.y - now.y))
    return mi.Point2f(mi.Float(then.x), mi.Float(then.y)), mi.Float(then.z), apart


def _edges(geometry: Geometry, pose: Pose, hit: Hit) -> tuple[mi.Point3d, mi.Vector3d, mi.Vector3d]:
    """First corner and two edges of the hit's triangle in render space, float64."""
    tables = geometry.tables
    face = dr.gather(mi.UInt32, tables.first_face, hit.object, hit.valid) + hit.face
    vertices = dr.gather(mi.Vector3u, tables.faces, face, hit.valid)
    local = [mi.Point3d(dr.gather(mi.Point3f, pose.positions, vertices[k], hit.valid)) for k in range(3)]
    rows = [dr.gather(mi.Vector4d, pose.precise_from_object, hit.object * 3 + k, hit.valid) for k in range(3)]
    corner = mi.Point3d(*(r.x * local[0].x + r.y * local[0].y + r.z * local[0].z + r.w for r in rows))
    edges = (local[k] - local[0] for k in (1, 2))
    return corner, *(mi.Vector3d(*(r.x * e.x + r.y * e.y + r.z * e.z for r in rows)) for e in edges)
