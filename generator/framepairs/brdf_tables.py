"""The table of A and B, the integral of the BRDF that shades: specular albedo F0 A + F90 B (NSRD supplement, equations 15-18).

Written over visible normals, A and B are means of G2 / G1(v) (1 - F_c) and G2 / G1(v) F_c, F_c = (1 - v.h)^5, over the part
of the spherical cap of Dupuy and Benyoub 2023 whose light lies above the horizon: integrands in [0, 1] that vary on the
scale of the cap, whatever alpha. The horizon is a curve on the cap that is known in closed form, so `quadrature` puts
Gauss-Legendre nodes on both of its sides' smooth parts only. `hammersley` is what the paper did.
"""

from functools import lru_cache
from typing import Literal

import numpy as np

from .backend import dr, mi
from .brdf import MIN_ALPHA, alpha_of, fifth, ggx_half_vector, slant, visibility
from .channels import Channel
from .conventions import BrdfModel

Method = Literal["quadrature", "hammersley"]
DEFAULT_SAMPLES = {"quadrature": 12, "hammersley": 1024}


@lru_cache(maxsize=8)
def brdf_table(
    model: BrdfModel, size: int = 512, method: Method = "quadrature", samples: int | None = None
) -> mi.TensorXf:
    """`tabulate`, remembered."""
    return tabulate(model, size, method, samples)


def tabulate(model: BrdfModel, size: int, method: Method, samples: int | None = None) -> mi.TensorXf:
    """[size, size, 2]: A and B >= 0, A + B <= 1, at roughness = row / (size - 1) and n.v = (column / (size - 1))^2.

    samples: half vectors a node for `hammersley` (default 1024), nodes per axis for `quadrature` (default 12, so 288
    evaluations in two regions of the cap). Column 0 holds the limit n.v -> 0, alpha is at least 0.001. At 512 x 512,
    quadrature of 12 errs by at most 6e-5, 1024 Hammersley points err by up to 0.024.
    """
    index = dr.arange(mi.UInt32, size * size)
    cos_v = dr.square(mi.Float(index % size) / (size - 1))
    a, b = integrate(model, cos_v, alpha_of(model, mi.Float(index // size) / (size - 1)), method, samples)
    values = dr.zeros(mi.Float, 2 * size * size)
    dr.scatter(values, a, 2 * index)
    dr.scatter(values, b, 2 * index + 1)
    return mi.TensorXf(values, (size, size, 2))


def table_channel(model: BrdfModel) -> Channel:
    """How the table is stored."""
    alpha = "roughness^2" if model.mapping == "squared" else "roughness"
    return Channel(
        name="brdf_table", exr=("A", "B"), dtype="float", unit="1", frame_of_reference="none", needed_by="",
        meaning=f"{model.visibility}, alpha = max({alpha}, {MIN_ALPHA}): specular albedo = F0 A + F90 B; "
        "column x: n.v = (x / (size - 1))^2, row y: roughness = y / (size - 1)",
    )  # fmt: skip


def integrate(
    model: BrdfModel, cos_v: mi.Float, alpha: mi.Float, method: Method = "quadrature", samples: int | None = None
) -> tuple[mi.Float, mi.Float]:
    """A and B at n.v = cos_v in [0, 1] and alpha in [0.001, 1]."""
    count = samples or DEFAULT_SAMPLES[method]
    if method == "hammersley":
        # Its weight has n.v in the denominator, and its variance grows without bound towards 0.
        a, b = _hammersley(model, dr.maximum(cos_v, 1e-4), alpha, dr.opaque(mi.UInt32, count))
    else:
        nodes, weights = np.polynomial.legendre.leggauss(count)
        rule = [mi.Float(column.astype(np.float32)) for column in ((nodes + 1) / 2, weights / 2)]
        a, b = _quadrature(model, cos_v, alpha, *rule, dr.opaque(mi.UInt32, count))
    total = dr.maximum(a + b, 1)  # the models lose energy only; an estimate may gain a little
    return a / total, b / total


@dr.syntax
def _quadrature(
    model: BrdfModel, cos_v: mi.Float, alpha: mi.Float, nodes: mi.Float, weights: mi.Float, count: mi.UInt32
) -> tuple[mi.Float, mi.Float]:
    """A and B by Gauss-Legendre nodes on (0, 1) in two regions of the cap, rings of light above the horizon and arcs of it.

    The cap holds points p = c + w, c on the unit sphere, w the view stretched by alpha (here in the plane y = 0); its
    half vector is (alpha p_x, alpha p_y, p_z). t = p_z is uniform in (0, 1 + w_z), and so is the azimuth of c.
    """
    sine_v = dr.sqrt((1 - cos_v) * (1 + cos_v))
    alpha2 = dr.square(alpha)
    length = dr.sqrt(alpha2 * dr.square(sine_v) + dr.square(cos_v))
    w_x, w_z = alpha * sine_v / length, cos_v / length
    # Rings with t > t_ring lie above the horizon, rings with t < t_none below: there h halves v and (-1, 0, 0) or (1, 0, 0).
    less = dr.square(cos_v) / (1 + sine_v)  # 1 - sine_v
    t_ring = 2 * w_z * alpha2 / (less + alpha2 * (1 + sine_v))
    t_none = 2 * w_z * alpha2 / (1 + sine_v + alpha2 * less)
    top, view_part = 1 + w_z, cos_v + slant(cos_v, alpha)
    a, b, i = mi.Float(0), mi.Float(0), mi.UInt32(0)
    while dr.hint(i < 2 * count, exclude=[model, nodes, weights]):
        node, weight = dr.gather(mi.Float, nodes, i % count), dr.gather(mi.Float, weights, i % count)
        tau = dr.pi * (node - 0.5)  # the arcs end and begin like square roots
        on_arc = i >= count
        t = dr.select(on_arc, dr.lerp(t_none, t_ring, 0.5 + 0.5 * dr.sin(tau)), dr.lerp(t_ring, top, node * node * node))
        step = dr.select(on_arc, (t_ring - t_none) * dr.cos(tau) * (0.5 * dr.pi), (top - t_ring) * 3 * dr.square(node))
        above = t + dr.square(w_x) / top  # 1 + c_z
        sine = dr.safe_sqrt(above * (2 - above))
        least = dr.square(t * (2 * w_z - t) / dr.maximum(sine + w_x, 1e-20))  # |p_xy|^2 where the azimuth is pi
        spread = dr.maximum(2 * sine * w_x, 1e-20)
        horizon = w_z * (1 - alpha2) * dr.square(t) / dr.maximum(t - alpha2 * w_z, 1e-20) - dr.square(t)  # its |p_xy|^2
        end = dr.select(on_arc, dr.acos(dr.clip((horizon - least) / spread, 0, 2) - 1), dr.pi)
        ring_a, ring_b, j = mi.Float(0), mi.Float(0), mi.UInt32(0)
        while dr.hint(j < count, exclude=[model, nodes, weights]):
            p_xy = least + spread * (1 + dr.cos(end * dr.gather(mi.Float, nodes, j)))
            p, h = p_xy + dr.square(t), alpha2 * p_xy + dr.square(t)  # squared lengths of p and of its half vector
            inverse = dr.rcp(h)
            cos_l = dr.clip(length * (p * t * inverse - w_z), 0, 1)
            v_h = 0.5 * length * p * dr.sqrt(inverse)
            ratio = 2 * visibility(model, cos_v, cos_l, alpha) * cos_l * view_part  # G2 / G1(v) of GGX
            ratio *= dr.gather(mi.Float, weights, j)
            fresnel = fifth(1 - dr.minimum(v_h, 1))
            ring_a += ratio * (1 - fresnel)
            ring_b += ratio * fresnel
            j += 1
        weight *= step * end / (dr.pi * top)
        a += ring_a * weight
        b += ring_b * weight
        i += 1
    return a, b


@dr.syntax
def _hammersley(model: BrdfModel, cos_v: mi.Float, alpha: mi.Float, count: mi.UInt32) -> tuple[mi.Float, mi.Float]:
    """A and B as means over half vectors with density D cos (equations 16 and 17)."""
    view = mi.Vector3f(dr.sqrt((1 - cos_v) * (1 + cos_v)), 0, cos_v)
    k, a, b = mi.UInt32(0), mi.Float(0), mi.Float(0)
    while dr.hint(k < count, exclude=[model]):
        half = ggx_half_vector(k, count, alpha)
        v_h = dr.dot(view, half)
        cos_l = 2 * v_h * half.z - cos_v
        weight = 4 * visibility(model, cos_v, dr.maximum(cos_l, 0), alpha) * cos_l * v_h / half.z
        weight = dr.select((cos_l > 0) & (v_h > 0), weight, 0)
        fresnel = fifth(1 - dr.minimum(v_h, 1))
        a += weight * (1 - fresnel)
        b += weight * fresnel
        k += 1
    return a / mi.Float(count), b / mi.Float(count)
