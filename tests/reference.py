"""The BRDF once more in float64 NumPy, from its equations, and integrals of it: what the renderer is held against.

NSRD supplement, equations 1 to 10, with separable Smith (Walter et al. 2007, equation 34) and alpha = roughness^2 >= 0.001.
"""

import numpy as np
from numpy.typing import NDArray

MIN_ALPHA = 1e-3


def f0_of(base, metallic, specular=0.5) -> NDArray:
    return (1 - metallic) * 0.08 * specular + metallic * np.asarray(base, float)


def reflect(base, metallic, roughness, n, v, l, specular=0.5) -> NDArray:
    """[..., 3] BRDF times cosine; n, v, l [..., 3] unit vectors, 0 for light below the surface."""
    n, v, l = (np.asarray(d, float) for d in (n, v, l))
    alpha = max(roughness**2, MIN_ALPHA)
    h = v + l + 1e-300
    h /= np.linalg.norm(h, axis=-1, keepdims=True)
    n_v, n_l, n_h, v_h = ((a * b).sum(-1)[..., None] for a, b in ((n, v), (n, l), (n, h), (v, h)))
    sine2 = (np.cross(n, h) ** 2).sum(-1)[..., None]
    n_l = np.maximum(n_l, 1e-140)
    d = alpha**2 / (np.pi * (alpha**2 * n_h**2 + sine2) ** 2)
    g_v, g_l = (2 / (1 + np.sqrt(1 + alpha**2 * (1 / c**2 - 1))) for c in (n_v, n_l))
    f0 = f0_of(base, metallic, specular)
    f90 = np.minimum(50 * np.max(f0, axis=-1, keepdims=True), 1) if np.ndim(f0) else min(50 * f0, 1)
    f = f0 + (f90 - f0) * (1 - v_h) ** 5
    value = ((1 - metallic) * np.asarray(base, float) / np.pi + d * f * g_v * g_l / (4 * n_v * n_l)) * n_l
    return np.where(n_l > 1e-140, value, 0)


def albedo_terms(roughness: float, n_v, nodes: int = 200) -> tuple[NDArray, NDArray]:
    """A and B [...] at cosines n_v [...]: midpoints of the half vector's azimuth and of s with D cos distributed as
    u = 1 - (1 - s)^2. Doubling the nodes changes them by less than 1e-4 for n_v >= 0.03."""
    alpha = max(roughness**2, MIN_ALPHA)
    u = 1 - (1 - (np.arange(nodes) + 0.5) / nodes) ** 2
    step = 2 * (1 - (np.arange(nodes) + 0.5) / nodes) / nodes  # du
    cosine = np.sqrt((1 - u) / (1 - u + alpha**2 * u))[:, None]
    sine = np.sqrt(1 - cosine**2)
    phi = (np.arange(nodes // 2) + 0.5) / (nodes // 2) * np.pi
    terms = np.empty((2, *np.shape(n_v)))
    for place, c in np.ndenumerate(n_v):
        v_h = np.sqrt(1 - c**2) * sine * np.cos(phi) + c * cosine
        n_l = 2 * v_h * cosine - c
        above = (n_l > 0) & (v_h > 0)
        n_l = np.where(above, n_l, 1)
        g = 4 / ((1 + np.sqrt(1 + alpha**2 * (1 / c**2 - 1))) * (1 + np.sqrt(1 + alpha**2 * (1 / n_l**2 - 1))))
        weight = np.where(above, g * v_h / (c * cosine), 0) * step[:, None] / len(phi)
        fresnel = (1 - v_h) ** 5
        terms[(slice(None), *place)] = (weight * (1 - fresnel)).sum(), (weight * fresnel).sum()
    return terms[0], terms[1]
