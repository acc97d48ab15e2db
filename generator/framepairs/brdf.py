"""The BRDF that shades: Lambert (1 - m) c / pi plus GGX, Schlick's Fresnel and one of three shadowing-masking terms.

NSRD supplement, equations 1 to 10; equation 4's denominator is read as 4 (n.o)(n.i). With c = n.v or n.l, the terms are
`separable_smith` G1(l) G1(v) (Walter et al. 2007, equation 34), `height_correlated` (Heitz 2014, equation 99), and
`schlick_k` with G1 = c / (c (1 - k) + k), k = (alpha + 1)^2 / 8 (equations 9 and 10 as printed).

All directions are unit vectors away from the surface. Light below the surface gives 0. A view below it, as a bent normal can
make it, is taken at the horizon: there all three models have a finite limit, and the table holds the same limit.
"""

from dataclasses import dataclass

from .backend import dr, mi
from .conventions import BrdfModel

MIN_ALPHA = 1e-3
LEAST_CHANCE = 0.1  # of a lobe that is not 0: Fresnel at n.v says little about a rough lobe


@dataclass(frozen=True)
class Brdf:
    """The model that shades, and its table of A and B: [size, size, 2]; None where no surface has a specular lobe."""

    model: BrdfModel
    table: mi.TensorXf | None


def alpha_of(model: BrdfModel, roughness: mi.Float) -> mi.Float:
    """GGX alpha of a perceptual roughness, at least 0.001."""
    return dr.maximum(dr.square(roughness) if model.mapping == "squared" else roughness, MIN_ALPHA)


def roughness_of(model: BrdfModel, alpha: mi.Float) -> mi.Float:
    """The inverse of `alpha_of` for alpha >= 0.001."""
    return dr.sqrt(alpha) if model.mapping == "squared" else alpha


def roughened(model: BrdfModel, roughness: mi.Float, variance: mi.Float) -> mi.Float:
    """Perceptual roughness of a surface whose normals vary within the pixel by a slope `variance` >= 0.

    Toksvig (2005) takes the Blinn-Phong exponent s to s' = f s with f = L / (L + s (1 - L)) for a mean normal of length L, so
    1 / s' = 1 / s + variance with variance = (1 - L) / L; with alpha^2 = 2 / s, alpha'^2 = alpha^2 + 2 variance, at most 1.
    """
    squared = dr.square(alpha_of(model, roughness)) + 2 * variance
    return dr.select(variance > 0, roughness_of(model, dr.sqrt(dr.minimum(squared, 1))), roughness)


def ggx(sine_squared: mi.Float, alpha: mi.Float) -> mi.Float:
    """D of GGX, per steradian (equation 5), at a half vector whose sine to the normal has this square.

    The sine carries the digits near the peak, which 1 - cos^2 loses: |n x h|^2 is precise.
    """
    squared = dr.square(alpha)
    return squared / (dr.pi * dr.square(squared + (1 - squared) * sine_squared))


def slant(cosine: mi.Float, alpha: mi.Float) -> mi.Float:
    """sqrt(alpha^2 + (1 - alpha^2) c^2), so that Smith's G1 is 2 c / (c + slant)."""
    squared = dr.square(alpha)
    return dr.sqrt(squared + (1 - squared) * dr.square(cosine))


def visibility(model: BrdfModel, n_v: mi.Float, n_l: mi.Float, alpha: mi.Float) -> mi.Float:
    """G / (4 n_v n_l) for cosines >= 0: symmetric, and finite at 0."""
    if model.visibility == "separable_smith":
        return 1 / ((n_v + slant(n_v, alpha)) * (n_l + slant(n_l, alpha)))
    if model.visibility == "height_correlated":
        return 0.5 / dr.maximum(n_v * slant(n_l, alpha) + n_l * slant(n_v, alpha), 1e-30)
    k = dr.square(alpha + 1) / 8
    return 0.25 / ((n_v * (1 - k) + k) * (n_l * (1 - k) + k))


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
    """BRDF times cos(n, l) for unit vectors, per steradian (equations 1 to 8)."""
    diffuse = (1 - metallic) * base_color * (dr.maximum(dr.dot(n, l), 0) * dr.inv_pi)
    return diffuse + evaluate_specular(model, roughness, f0, n, v, l)


def evaluate_specular(
    model: BrdfModel, roughness: mi.Float, f0: mi.Color3f, n: mi.Vector3f, v: mi.Vector3f, l: mi.Vector3f
) -> mi.Color3f:
    """The specular part of `evaluate` (equations 4 to 10)."""
    n_l, alpha = dr.maximum(dr.dot(n, l), 0), alpha_of(model, roughness)
    v, n_v = _above(n, v)
    lobe = ggx(_sine_squared(n, v, l), alpha) * visibility(model, n_v, n_l, alpha) * n_l
    return schlick(f0, 0.5 * dr.norm(v + l)) * lobe


def sample(
    model: BrdfModel,
    base_color: mi.Color3f,
    metallic: mi.Float,
    roughness: mi.Float,
    f0: mi.Color3f,
    n: mi.Vector3f,
    v: mi.Vector3f,
    u1: mi.Float,
    u: mi.Point2f,
) -> mi.Vector3f:
    """Direction of light with `density`, from u1 (which lobe) and u, uniform in [0, 1). It may lie below the surface."""
    _, n_v = _above(n, v)
    diffuse = mi.Frame3f(n).to_world(mi.warp.square_to_cosine_hemisphere(u))
    is_specular = u1 < specular_chance(base_color, metallic, f0, n_v)
    return dr.select(is_specular, sample_specular(model, roughness, n, v, u), diffuse)


def density(
    model: BrdfModel,
    base_color: mi.Color3f,
    metallic: mi.Float,
    roughness: mi.Float,
    f0: mi.Color3f,
    n: mi.Vector3f,
    v: mi.Vector3f,
    l: mi.Vector3f,
) -> mi.Float:
    """Density per steradian of `sample`, both lobes; `evaluate` is at most 1 / LEAST_CHANCE times it for colours <= 1."""
    n_l, (_, n_v) = dr.maximum(dr.dot(n, l), 0), _above(n, v)
    chance = specular_chance(base_color, metallic, f0, n_v)
    return dr.lerp(n_l * dr.inv_pi, specular_density(model, roughness, n, v, l), chance)


def specular_chance(base_color: mi.Color3f, metallic: mi.Float, f0: mi.Color3f, n_v: mi.Float) -> mi.Float:
    """Probability that `sample` takes the specular lobe: luminances of Fresnel at n_v against (1 - metallic) base.

    At least LEAST_CHANCE, and at most 1 - LEAST_CHANCE, unless one of the lobes is 0.
    """
    specular, diffuse = mi.luminance(schlick(f0, n_v)), mi.luminance((1 - metallic) * base_color)
    chance = dr.clip(specular / dr.maximum(specular + diffuse, 1e-20), LEAST_CHANCE, 1 - LEAST_CHANCE)
    return dr.select(diffuse > 0, dr.select(dr.max(f0) > 0, chance, 0), 1)


def sample_specular(model: BrdfModel, roughness: mi.Float, n: mi.Vector3f, v: mi.Vector3f, u: mi.Point2f) -> mi.Vector3f:
    """Direction of light with `specular_density`, from u in [0, 1)^2: v mirrored at a visible GGX normal.

    The spherical cap of Dupuy and Benyoub 2023 (listing 3), with 1 + z kept free of cancellation: the tail keeps its digits.
    """
    v, _ = _above(n, v)
    frame, alpha = mi.Frame3f(n), alpha_of(model, roughness)
    local = frame.to_local(v)
    local.z = dr.maximum(local.z, 0)
    stretched = mi.Vector3f(alpha * local.x, alpha * local.y, local.z)
    stretched *= dr.rsqrt(dr.maximum(dr.squared_norm(stretched), 1e-20))
    height = (1 - u.y) * (1 + stretched.z)  # of the cap's point above the cap's rim
    above = height + (dr.square(stretched.x) + dr.square(stretched.y)) / (1 + stretched.z)  # 1 + z
    sine, phi = dr.safe_sqrt(above * (2 - above)), 2 * dr.pi * u.x
    x, y = sine * dr.cos(phi) + stretched.x, sine * dr.sin(phi) + stretched.y
    half = dr.normalize(mi.Vector3f(alpha * x, alpha * y, dr.maximum(height, 1e-20)))
    return frame.to_world(2 * dr.dot(local, half) * half - local)


def specular_density(model: BrdfModel, roughness: mi.Float, n: mi.Vector3f, v: mi.Vector3f, l: mi.Vector3f) -> mi.Float:
    """Density per steradian of `sample_specular`: G1(v) D / (4 n.v) (Heitz 2018, equation 17), 0 below the surface."""
    v, n_v = _above(n, v)
    alpha = alpha_of(model, roughness)
    value = ggx(_sine_squared(n, v, l), alpha) / (2 * (n_v + slant(n_v, alpha)))
    return dr.select(dr.dot(n, l) > 0, value, 0)


def ggx_half_vector(k: mi.UInt32, count: mi.UInt32, alpha: mi.Float) -> mi.Vector3f:
    """Hammersley sample `k` of `count` of the half vector around z, with density D(h) cos(h)."""
    first, second = (mi.Float(k) + 0.5) / mi.Float(count), mi.Float(dr.brev(k) >> 8) * (1 / 2**24)
    rest = 1 / (1 + (dr.square(alpha) - 1) * first)
    cosine, sine, phi = dr.sqrt((1 - first) * rest), alpha * dr.sqrt(first * rest), 2 * dr.pi * second
    return mi.Vector3f(sine * dr.cos(phi), sine * dr.sin(phi), cosine)


def look_up(brdf: Brdf, cos_v: mi.Float, roughness: mi.Float, active: mi.Bool) -> tuple[mi.Float, mi.Float]:
    """A and B, linear between the table's nodes; at 512 x 512 within 1e-3 of the integral everywhere.

    The roughness is clamped as alpha is, so that no cell is interpolated across the bend at alpha 0.001. For small alpha,
    A + B is a function of n.v / alpha. Where the rows lie far apart on that scale (mapping `linear`), A + B is
    interpolated along constant n.v / alpha, and B's share of it, which is not such a function, along constant n.v. Without a
    table both are 0.
    """
    if brdf.table is None:
        return mi.Float(0), mi.Float(0)
    size = brdf.table.shape[0]
    x = dr.sqrt(dr.clip(cos_v, 0, 1)) * (size - 1)
    y = dr.clip(roughness, 0, 1)
    row = dr.minimum(mi.UInt32(y * (size - 1)), size - 2)
    least = MIN_ALPHA**0.5 if brdf.model.mapping == "squared" else MIN_ALPHA
    y, low, high = (dr.maximum(value, least) for value in (y, mi.Float(row) / (size - 1), mi.Float(row + 1) / (size - 1)))
    weight = dr.select(high > low, (y - low) / (high - low), 0)
    first, second = _in_row(brdf, row, x, active), _in_row(brdf, row + 1, x, active)
    value = dr.lerp(first, second, weight)
    if brdf.model.mapping == "squared" or brdf.model.visibility == "schlick_k":
        return value.x, value.y
    first_share, second_share = (pair.y / dr.maximum(pair.x + pair.y, 1e-6) for pair in (first, second))
    first, second = (_in_row(brdf, row + k, x * dr.sqrt(edge / y), active) for k, edge in enumerate((low, high)))
    total, share = dr.lerp(first.x + first.y, second.x + second.y, weight), dr.lerp(first_share, second_share, weight)
    return total * (1 - share), total * share


def _in_row(brdf: Brdf, row: mi.UInt32, x: mi.Float, active: mi.Bool) -> mi.Vector2f:
    """A and B of one row at column `x`, between its two nodes."""
    size = brdf.table.shape[0]
    x = dr.minimum(x, size - 1)
    column = dr.minimum(mi.UInt32(x), size - 2)
    place = row * size + column
    left, right = (dr.gather(mi.Vector2f, brdf.table.array, place + k, active) for k in (0, 1))
    return dr.lerp(left, right, x - mi.Float(column))


def pre_integrated(base_color: mi.Color3f, metallic: mi.Float, f0: mi.Color3f, a: mi.Float, b: mi.Float) -> mi.Color3f:
    """F_beta = (1 - metallic) base + F0 A + F90 B (equations 12, 14, 15, where F90 is 1)."""
    return (1 - metallic) * base_color + f0 * a + f90_of(f0) * b


def schlick(f0: mi.Color3f, cosine: mi.Float) -> mi.Color3f:
    """Fresnel reflectance (equation 6, where F90 is 1)."""
    return f0 + (f90_of(f0) - f0) * fifth(1 - dr.minimum(cosine, 1))


def f90_of(f0: mi.Color3f) -> mi.Float:
    """Reflectance at grazing incidence: 1 from F0 = 0.02 on, which is below every real material, then falling to 0 with F0, so
    that a surface of specular 0 is Lambert alone (Lagarde and de Rousiers 2014, section 3.1.3)."""
    return dr.minimum(50 * dr.max(f0), 1)


def fifth(x: mi.Float) -> mi.Float:
    """x^5."""
    squared = dr.square(x)
    return squared * squared * x


def _above(n: mi.Vector3f, v: mi.Vector3f) -> tuple[mi.Vector3f, mi.Float]:
    """The view, moved to the horizon where it lies below the surface, and its cosine >= 0."""
    n_v = dr.dot(n, v)
    flat = v - n * n_v
    squared = dr.squared_norm(flat)
    flat = dr.select(squared > 1e-12, flat * dr.rsqrt(squared), mi.coordinate_system(n)[0])  # straight from below: any
    return dr.select(n_v < 0, flat, v), dr.maximum(n_v, 0)


def _sine_squared(n: mi.Vector3f, v: mi.Vector3f, l: mi.Vector3f) -> mi.Float:
    """sin^2 between the normal and the half vector; 0 for v = -l, which has none."""
    both = v + l
    return dr.minimum(dr.squared_norm(dr.cross(n, both)) / dr.maximum(dr.squared_norm(both), 1e-20), 1)
