"""Where rays meet triangles, and what interpolates over the triangle that was met."""

from dataclasses import dataclass

from .backend import dr, mi
from .geometry import Geometry, Pose, Tables


@dataclass(frozen=True)
class Hit:
    """Where a ray met a triangle: object, face (of the object's mesh), barycentric (u, v) of its 2nd and 3rd vertex."""

    valid: mi.Bool
    object: mi.UInt32
    face: mi.UInt32
    uv: mi.Point2f


@dataclass(frozen=True)
class Triangle:
    """A hit's triangle in render space. position = v0 + u edge1 + v edge2; uv and its edges in texture space; normal is
    the interpolated one, unit length, on the triangle's own side, and `geometric` the triangle's (edge1 x edge2). outward:
    away from the front, from which its vertices run counter-clockwise, of any length. second: uv and its edges of the
    second set; color: [4] of the vertices; tangent: [4] unit direction and the bitangent's sign, 0 where the mesh has none;
    None where the scene has none."""

    position: mi.Point3f
    edge1: mi.Vector3f
    edge2: mi.Vector3f
    geometric: mi.Vector3f
    normal: mi.Vector3f
    uv: mi.Point2f
    uv_edge1: mi.Vector2f
    uv_edge2: mi.Vector2f
    outward: mi.Vector3f
    second: tuple[mi.Point2f, mi.Vector2f, mi.Vector2f] | None
    color: mi.Vector4f | None
    tangent: mi.Vector4f | None


def trace(geometry: Geometry, pose: Pose, ray: mi.Ray3f, active: mi.Bool, coherent: bool) -> tuple[Hit, mi.Float]:
    """The first triangle along `ray`, and its distance in units of the ray's direction (infinite where there is none).

    coherent: neighbouring rays go alike. It changes no result; bounced rays traced as if they did cost a quarter more.
    """
    found = pose.scene.ray_intersect_preliminary(ray, coherent=coherent, active=active)
    valid = active & found.is_valid()
    number = dr.reinterpret_array(mi.UInt32, found.instance)
    number = dr.select(number != 0, number, dr.reinterpret_array(mi.UInt32, found.shape))
    index = dr.gather(mi.UInt32, geometry.tables.object_of_shape, number, valid)
    return Hit(valid, index, found.prim_index, found.prim_uv), dr.select(valid, found.t, dr.inf)


def point_of(tables: Tables, pose: Pose, hit: Hit) -> mi.Point3f:
    """Place [3] in render space, at `pose`, of the material point that was hit: v0 + u e1 + v e2, then transformed."""
    p0, p1, p2 = _corners(mi.Point3f, pose.positions, tables, hit)
    local = p0 + hit.uv.x * (p1 - p0) + hit.uv.y * (p2 - p0)
    return _transform(pose, hit).point(local)


def triangle_of(tables: Tables, pose: Pose, hit: Hit) -> Triangle:
    """Everything that interpolates over the hit's triangle. Degenerate triangles give finite values."""
    matrix = _transform(pose, hit)
    p0, p1, p2 = _corners(mi.Point3f, pose.positions, tables, hit)
    n0, n1, n2 = _corners(mi.Normal3f, pose.normals, tables, hit)
    local1, local2 = p1 - p0, p2 - p0
    u, v = hit.uv.x, hit.uv.y
    edge1, edge2 = matrix.vector(local1), matrix.vector(local2)
    geometric = _unit(dr.cross(edge1, edge2), mi.Vector3f(0, 0, 1))
    smooth = n0 + u * (n1 - n0) + v * (n2 - n0)
    normal = _unit(_cofactor(matrix).vector(smooth), geometric)  # objects without normals have zeros here
    uv, uv_edge1, uv_edge2 = _uv_over(tables.uv, tables, hit)
    return Triangle(
        position=matrix.point(p0 + u * local1 + v * local2),
        edge1=edge1,
        edge2=edge2,
        geometric=dr.select(dr.dot(geometric, normal) < 0, -geometric, geometric),
        normal=normal,
        uv=uv,
        uv_edge1=uv_edge1,
        uv_edge2=uv_edge2,
        outward=dr.cross(edge1, edge2) * _mirrored(matrix),
        second=_uv_over(tables.uv2, tables, hit) if tables.uv2 is not None else None,
        color=_color_of(tables, hit) if tables.colors is not None else None,
        tangent=_tangent_of(tables, hit, matrix) if tables.tangents is not None else None,
    )


def _uv_over(values: mi.Float, tables: Tables, hit: Hit) -> tuple[mi.Point2f, mi.Vector2f, mi.Vector2f]:
    """(at the hit, and what it grows by along both edges) of a set of texture coordinates."""
    t0, t1, t2 = _corners(mi.Point2f, values, tables, hit)
    return t0 + hit.uv.x * (t1 - t0) + hit.uv.y * (t2 - t0), t1 - t0, t2 - t0


def _color_of(tables: Tables, hit: Hit) -> mi.Vector4f:
    c0, c1, c2 = _corners(mi.Vector4f, tables.colors, tables, hit)
    return c0 + hit.uv.x * (c1 - c0) + hit.uv.y * (c2 - c0)


def _tangent_of(tables: Tables, hit: Hit, matrix: "_Affine") -> mi.Vector4f:
    """In render space. The bitangent's sign is the first vertex's: it may not change within a triangle."""
    t0, t1, t2 = _corners(mi.Vector4f, tables.tangents, tables, hit)
    smooth = t0 + hit.uv.x * (t1 - t0) + hit.uv.y * (t2 - t0)
    direction = _unit(matrix.vector(mi.Vector3f(smooth.x, smooth.y, smooth.z)), mi.Vector3f(0))
    return mi.Vector4f(direction.x, direction.y, direction.z, t0.w * _mirrored(matrix))


def _unit(vector: mi.Vector3f, otherwise: mi.Vector3f) -> mi.Vector3f:
    largest = dr.max(dr.abs(vector))
    scaled = vector / dr.select(largest > 0, largest, 1)  # squares of tiny edges would underflow
    return dr.select(largest > 0, dr.normalize(scaled), otherwise)


def _corners(kind, values, tables: Tables, hit: Hit):
    face = dr.gather(mi.UInt32, tables.first_face, hit.object, hit.valid) + hit.face
    vertices = dr.gather(mi.Vector3u, tables.faces, face, hit.valid)
    return (dr.gather(kind, values, vertices[k], hit.valid) for k in range(3))


class _Affine:
    """Rows of a 3x4 matrix on the device."""

    def __init__(self, rows: list[mi.Vector4f]):
        self.rows = rows

    def point(self, p) -> mi.Point3f:
        return mi.Point3f(*(r.x * p.x + r.y * p.y + r.z * p.z + r.w for r in self.rows))

    def vector(self, v) -> mi.Vector3f:
        return mi.Vector3f(*(r.x * v.x + r.y * v.y + r.z * v.z for r in self.rows))


def _transform(pose: Pose, hit: Hit) -> _Affine:
    rows = [dr.gather(mi.Vector4f, pose.render_from_object, hit.object * 3 + k, hit.valid) for k in range(3)]
    return _Affine(rows)


def _mirrored(matrix: _Affine) -> mi.Float:
    """-1 for a matrix that mirrors, else 1."""
    a, b, c = (mi.Vector3f(row.x, row.y, row.z) for row in matrix.rows)
    return dr.sign(dr.dot(a, dr.cross(b, c)))


def _cofactor(matrix: _Affine) -> _Affine:
    """Matrix that takes normals: cofactors of the linear part, times the sign of its determinant."""
    a, b, c = (mi.Vector3f(row.x, row.y, row.z) for row in matrix.rows)
    sign = _mirrored(matrix)
    rows = [dr.cross(b, c) * sign, dr.cross(c, a) * sign, dr.cross(a, b) * sign]
    return _Affine([mi.Vector4f(row.x, row.y, row.z, 0) for row in rows])
