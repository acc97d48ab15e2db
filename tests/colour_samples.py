"""Values, colours and calls for the tests of colour: functions of Dr.Jit arrays as functions of NumPy arrays."""

import numpy as np

from framepairs.backend import dr, jit

EPSILON = 2.0**-23  # of float32
# Values from below black to far above white, dense where sRGB has its joints.
JOINTS = np.linspace(0.003, 0.0033, 31), np.linspace(0.0403, 0.0406, 31)
VALUES = np.float32(np.concatenate([np.linspace(-0.1, 1.2, 1301), *JOINTS, np.geomspace(1, 1e5, 200)]))
# What a curve can trip over: zeros, denormals, powers of tiny numbers, the joints of HLG and ACEScct, all sizes.
STEEP = [0.0, -0.0, 1e-45, 1e-40, 1e-38, 1e-31, 1e-30, 1e-29, 1e-26, 1e-20, 1e-10, 1 / 12, 0.5, 0.0078125, 0.155251141552511]
EXTREMES = np.float32(np.concatenate([STEEP, -np.geomspace(1e-40, 0.1, 200), np.geomspace(1e-40, 1e5, 2000), VALUES]))


def pixels(count=500, low=-0.1, high=1e5):
    """RGB [count, 3] float32: signs and sizes mixed, from a fixed seed."""
    generator = np.random.default_rng(20240607)
    sizes = np.exp(generator.uniform(np.log(1e-6), np.log(high), (count, 3)))
    return np.float32(np.where(generator.uniform(size=(count, 3)) < 0.1, low * generator.uniform(size=(count, 3)), sizes))


def extreme_pixels():
    """RGB [n, 3] float32: greys of EXTREMES, colours with one such component, and `pixels`."""
    grey = np.repeat(EXTREMES[:, None], 3, axis=1)
    mixed = np.stack([EXTREMES, np.roll(EXTREMES, 777), np.zeros_like(EXTREMES)], axis=1)
    return np.concatenate([grey, mixed, pixels()])


def scalar(function, values):
    return np.array(function(jit.Float(np.ascontiguousarray(values, dtype=np.float32))))


def scalar_in_float64(function, values):
    return np.array(function(jit.Float64(np.ascontiguousarray(values, dtype=np.float64))))


def vector(function, rgb):
    """function of Array3f on [N, 3], as [N, 3] or [N]."""
    return np.array(function(jit.Array3f(np.ascontiguousarray(rgb.T, dtype=np.float32)))).T


def derivative(function, values):
    """d function / d value, float32 [N], by Dr.Jit's reverse mode."""
    x = jit.Float(np.ascontiguousarray(values, dtype=np.float32))
    dr.enable_grad(x)
    dr.backward(dr.sum(function(x)))
    return np.array(dr.grad(x))


def vector_derivative(function, rgb):
    """d (sum of the components of function) / d component, float32 [N, 3], by Dr.Jit's reverse mode."""
    x = jit.Array3f(np.ascontiguousarray(rgb.T, dtype=np.float32))
    dr.enable_grad(x)
    dr.backward(dr.sum(function(x), axis=None))
    return np.array(dr.grad(x)).T
