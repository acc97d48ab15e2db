"""The BRDF that shades: Lambert (1 - m) c / pi plus GGX, Schlick's Fresnel and a Smith term (NSRD supplement, equations 1 to
10; equation 4's denominator is read as 4 (n.o)(n.i))."""

from dataclasses import dataclass
from functools import lru_cache

from .backend import dr, mi
from .conventions import BrdfModel

MIN_ALPHA = 1e-3


@dataclass(frozen=True)
class Brdf:
    """The model that shades, and its table of A and B: [size, size, 2]."""

    model: BrdfModel
    table: mi.TensorXf


def alpha_of(model: BrdfModel, roughness: mi.Float) -> mi.Float:
    """GGX alpha of a perceptual roughness, at least 0.001."""
    return dr.maximum(dr.square(roughness) if model.mapping == "squared" else roughness, MIN_ALPHA)


def roughness_of(model: BrdfModel, alpha: mi.Float) -> mi.Float:
    """The inverse of `alpha_of` for alpha >= 0.001."""
    return dr.sqrt(alpha) if model.mapping == "squared" else alpha


def ggx(cos_h: mi.Float, alpha: mi.Float) -> mi.Float:
    """D (equation 5). 1 - cos^2 is taken as given: near the peak it carries all the digits."""
    squared = dr.square(alpha)
    return squared / (dr.pi * dr.square(dr.square(cos_h) * (squared - 1) + 1))


def smith(cosine: mi.Float, alpha: mi.Float) -> mi.Float:
    """G1 of GGX: 2 c / (c + sqrt(alpha^2 + (1 - alpha^2) c^2)), for c >= 0; 0 at grazing."""
    squared = dr.square(alpha)
    return 2 * cosine / dr.maximum(cosine + dr.sqrt(squared + (1 - squared) * dr.square(cosine)), 1e-20)


def f0_of(base_color: mi.Color3f, metallic: mi.Float, specular: mi.Float) -> mi.Color3f:
    """Reflectance at normal incidence: lerp(0.08 specular, base, metallic) (equation 7 with specular 0.5)."""
    return dr.lerp(mi.Color3f(0.08 * specular), base_color, metallic)


def evaluate(
    model: BrdfModel,
    base_color: mi.Color3f,
    metallic: mi.Float,
    roughness: mi.Float,
    f0: mi.Color3f,
    n: mi.Vector3f,
    v: mi.Vector3f,
    l: mi.Vector3f,
) -> mi.Color3f:
    """BRDF times cos(n, l) for unit vectors; 0 where either lies below the surface (equations 1 to 8)."""
    half = dr.normalize(v + l)
    n_l, n_v = dr.maximum(dr.dot(n, l), 0), dr.maximum(dr.dot(n, v), 1e-4)
    n_h, v_h = dr.clip(dr.dot(n, half), 0, 1), dr.clip(dr.dot(v, half), 0, 1)
    alpha = alpha_of(model, roughness)
    fresnel = f0 + (1 - f0) * _fifth(1 - v_h)
    visibility = smith(n_l, alpha) * smith(n_v, alpha) / (4 * n_v * dr.maximum(n_l, 1e-8))
    diffuse = (1 - metallic) * base_color * dr.inv_pi
    return (diffuse + fresnel * (ggx(n_h, alpha) * visibility)) * n_l


@lru_cache(maxsize=4)
def brdf_table(model: BrdfModel, size: int = 512, samples: int = 1024) -> mi.TensorXf:
    """[size, size, 2]: A and B at roughness = row / (size - 1) and n.v = (column / (size - 1))^2.

    Hammersley samples of the half vector; equations 16 and 17.
    """
    index = dr.arange(mi.UInt32, size * size)
    cos_v = dr.maximum(dr.square(mi.Float(index % size) / (size - 1)), 1e-4)
    alpha = alpha_of(model, mi.Float(index // size) / (size - 1))
    a, b = _integrate(cos_v, alpha, dr.opaque(mi.UInt32, samples))
    norm = dr.maximum(a + b, samples)  # the model loses energy only; the estimate may gain some 2e-4 at alpha 0.001
    values = dr.zeros(mi.Float, 2 * size * size)
    dr.scatter(values, a / norm, 2 * index)
    dr.scatter(values, b / norm, 2 * index + 1)
    return mi.TensorXf(values, (size, size, 2))


@dr.syntax
def _integrate(cos_v: mi.Float, alpha: mi.Float, count: mi.UInt32) -> tuple[mi.Float, mi.Float]:
    """Sums over the samples of A and B."""
    view = mi.Vector3f(dr.sqrt(dr.maximum(1 - dr.square(cos_v), 0)), 0, cos_v)
    k, a, b = mi.UInt32(0), mi.Float(0), mi.Float(0)
    while k < count:
        half = ggx_half_vector(k, count, alpha)
        v_h = dr.dot(view, half)
        cos_l = 2 * v_h * half.z - cos_v
        weight = smith(cos_l, alpha) * smith(cos_v, alpha) * v_h / (half.z * cos_v)
        weight = dr.select((cos_l > 0) & (v_h > 0), weight, 0)
        fresnel = _fifth(1 - v_h)
        a += weight * (1 - fresnel)
        b += weight * fresnel
        k += 1
    return a, b


def ggx_half_vector(k: mi.UInt32, count: mi.UInt32, alpha: mi.Float) -> mi.Vector3f:
    """Hammersley sample `k` of `count` of the half vector around z, with density D(h) cos(h)."""
    first, second = (mi.Float(k) + 0.5) / mi.Float(count), mi.Float(dr.brev(k) >> 8) * (1 / 2**24)
    cosine = dr.sqrt((1 - first) / (1 + (dr.square(alpha) - 1) * first))
    sine, phi = dr.sqrt(dr.maximum(1 - dr.square(cosine), 0)), 2 * dr.pi * second
    return mi.Vector3f(sine * dr.cos(phi), sine * dr.sin(phi), cosine)


def look_up(brdf: Brdf, cos_v: mi.Float, roughness: mi.Float, active: mi.Bool) -> tuple[mi.Float, mi.Float]:
    """A and B, bilinear between nodes that include the ends of both axes."""
    table, size = brdf.table, brdf.table.shape[0]
    x = dr.sqrt(dr.clip(cos_v, 0, 1)) * (size - 1)
    y = dr.clip(roughness, 0, 1) * (size - 1)
    column, row = dr.minimum(mi.UInt32(x), size - 2), dr.minimum(mi.UInt32(y), size - 2)
    fx, fy = x - mi.Float(column), y - mi.Float(row)

    def node(dx: int, dy: int) -> mi.Vector2f:
        return dr.gather(mi.Vector2f, table.array, (row + dy) * size + column + dx, active)

    value = dr.lerp(dr.lerp(node(0, 0), node(1, 0), fx), dr.lerp(node(0, 1), node(1, 1), fx), fy)
    return value.x, value.y


def pre_integrated(
    base_color: mi.Color3f, metallic: mi.Float, f0: mi.Color3f, a: mi.Float, b: mi.Float
) -> mi.Color3f:
    """F_beta = (1 - metallic) base + F0 A + B (equations 12, 14, 15)."""
    return (1 - metallic) * base_color + f0 * a + b


def _fifth(x):
    squared = dr.square(x)
    return squared * squared * x


def _fifth(x: mi.Float) -> mi.Float:
    squared = dr.square(x)
    return squared * squared * x
