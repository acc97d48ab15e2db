"""The Mitsuba plugin: its density is that of its samples, its values are those of `brdf`, and `path` can use it."""

from importlib import import_module

import numpy as np
import pytest

from framepairs import brdf
from framepairs.backend import dr, mi
from framepairs.brdf_tables import brdf_table
from framepairs.conventions import BrdfModel
from framepairs.metallic_roughness import register

chi2 = import_module("mitsuba.chi2")  # it needs the variant, which `backend` has chosen by now
VISIBILITIES = ("separable_smith", "height_correlated", "schlick_k")
ROUNDINGS = 64 * 2.0**-24  # products of some tens of factors in float32
BASE = [0.6, 0.3, 0.1]


@pytest.fixture(scope="module", autouse=True)
def _registered():
    register()
    register()


def plugin(**properties) -> mi.BSDF:
    return mi.load_dict({"type": "metallic_roughness", "base_color": {"type": "rgb", "value": BASE}} | properties)


def toward(degrees: float, azimuth: float = 25.0) -> list[float]:
    theta, phi = np.radians(degrees), np.radians(azimuth)
    return [float(x) for x in (np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta))]


def hit(wi) -> mi.SurfaceInteraction3f:
    si = dr.zeros(mi.SurfaceInteraction3f, dr.width(mi.Vector3f(wi)))
    si.wi = mi.Vector3f(wi)
    return si


def random_directions(count: int, seed: int) -> mi.Vector3f:
    rng = np.random.default_rng(seed)
    xyz = rng.normal(size=(3, count))
    return mi.Vector3f((xyz / np.linalg.norm(xyz, axis=0)).astype(np.float32))


class Patch:
    """Equal-area (Lambert's) map of the sphere around a direction, cut to what holds a lobe: cells as fine as it needs."""

    def __init__(self, axis, across):
        self.axis = mi.Vector3f(axis)
        self.side = dr.normalize(mi.Vector3f(across) - self.axis * dr.dot(self.axis, mi.Vector3f(across)))
        self.up = dr.cross(self.axis, self.side)
        self.low, self.high = (-2.0, -2.0), (2.0, 2.0)

    def bounds(self):
        return mi.ScalarBoundingBox2f(list(self.low), list(self.high))

    def aspect(self):
        return 1.0

    def map_forward(self, p):
        squared = dr.squared_norm(p)
        stretch = dr.safe_sqrt(1 - squared / 4)
        return stretch * (p.x * self.side + p.y * self.up) + (1 - squared / 2) * self.axis

    def map_backward(self, d):
        x, y = dr.dot(d, self.side), dr.dot(d, self.up)
        return mi.Vector2f(x, y) * dr.rsqrt(dr.maximum((1 + dr.dot(d, self.axis)) / 2, 1e-6))

    def fit(self, directions):
        """Around the middle 96 % of the directions, in both axes."""
        places = np.array(self.map_backward(directions))
        self.low, self.high = np.quantile(places, 0.02, axis=1).tolist(), np.quantile(places, 0.98, axis=1).tolist()

    def discard_outside(self, draw):
        """`draw` with weight 0 for what falls outside."""

        def within(sample):
            directions, weights = draw(sample)
            p = self.map_backward(directions)
            inside = dr.all((p >= mi.Vector2f(self.low)) & (p <= mi.Vector2f(self.high)))
            centre = self.map_forward((mi.Vector2f(self.low) + mi.Vector2f(self.high)) / 2)
            return dr.select(inside, directions, centre), dr.select(inside, weights, 0)

        return within


def chi_square_holds(properties: dict, wi: list[float], tests: int) -> bool:
    values = {"type": "metallic_roughness", "base_color": {"type": "rgb", "value": BASE}, **properties}
    draw, density = chi2.BSDFAdapter("metallic_roughness", values, wi=wi)
    domain = chi2.SphericalDomain()
    if properties["roughness"] < 0.5:  # narrower than the sphere's cells
        domain = Patch([-wi[0], -wi[1], wi[2]], [-wi[1], wi[0], 0] if wi[0] else [1, 0, 0])
        # the glossy lobe alone decides where to look
        glossy, _ = chi2.BSDFAdapter("metallic_roughness", values | {"metallic": 1.0}, wi=wi)
        domain.fit(glossy(mi.Vector3f(np.random.default_rng(1).random((3, 20_000), dtype=np.float32)))[0])
        draw = domain.discard_outside(draw)
    test = chi2.ChiSquareTest(domain, draw, density, sample_dim=3, sample_count=400_000, res=61, ires=16)
    return bool(test.run(significance_level=0.01, test_count=tests, quiet=True))


VIEWS = {"normal": toward(0), "slanted": toward(35), "low": toward(80), "grazing": toward(89.5), "behind": toward(130)}
ROUGHNESSES = (0.05, 0.1, 0.3, 0.5, 1.0)
TESTS = 62


@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize("metallic", [0.0, 1.0])
@pytest.mark.parametrize("roughness", ROUGHNESSES)
def test_samples_follow_the_density(roughness, metallic, view):
    assert chi_square_holds({"roughness": roughness, "metallic": metallic}, VIEWS[view], TESTS)


@pytest.mark.parametrize("mapping", ["squared", "linear"])
@pytest.mark.parametrize("roughness", [0.1, 0.3, 0.7])
@pytest.mark.parametrize("visibility", VISIBILITIES[1:])
def test_samples_follow_the_density_whatever_the_model(visibility, roughness, mapping):
    properties = {"roughness": roughness, "metallic": 0.5, "visibility": visibility, "mapping": mapping}
    assert chi_square_holds(properties, VIEWS["slanted"], TESTS)


@pytest.mark.parametrize("mapping", ["squared", "linear"])
@pytest.mark.parametrize("visibility", VISIBILITIES)
def test_values_are_those_of_the_brdf_that_raster_shades_with(visibility, mapping):
    wi, wo = random_directions(5000, 1), random_directions(5000, 2)
    bsdf = plugin(roughness=0.35, metallic=0.3, specular=0.8, visibility=visibility, mapping=mapping)
    value, density = bsdf.eval_pdf(mi.BSDFContext(), hit(wi), wo)
    model, base, normal = BrdfModel(visibility, mapping), mi.Color3f(BASE), mi.Vector3f(0, 0, dr.sign(wi.z))
    surface = base, mi.Float(0.3), mi.Float(0.35), brdf.f0_of(base, mi.Float(0.3), mi.Float(0.8)), normal
    expected, expected_density = brdf.evaluate(model, *surface, wi, wo), brdf.density(model, *surface, wi, wo)
    assert np.allclose(np.array(value), np.array(expected), rtol=ROUNDINGS, atol=0)
    assert np.allclose(np.array(density), np.array(expected_density), rtol=ROUNDINGS, atol=0)
    assert (np.array(density)[np.array(wi.z * wo.z) <= 0] == 0).all()


def test_a_sample_brings_its_value_and_its_density():
    bsdf, si = plugin(roughness=0.4, metallic=0.2), hit(random_directions(5000, 3))
    rng = np.random.default_rng(4)
    u1, u2 = mi.Float(rng.random(5000, dtype=np.float32)), mi.Point2f(rng.random((2, 5000), dtype=np.float32))
    drawn, weight = bsdf.sample(mi.BSDFContext(), si, u1, u2)
    value, density = bsdf.eval_pdf(mi.BSDFContext(), si, drawn.wo)
    above = np.array(density) > 0
    assert above.mean() > 0.9 and (np.array(drawn.pdf)[~above] == 0).all() and (np.array(weight)[:, ~above] == 0).all()
    assert np.allclose(np.array(drawn.pdf)[above], np.array(density)[above], rtol=1e-4)  # wo is rounded, and D is steep
    assert np.allclose(np.array(weight * drawn.pdf)[:, above], np.array(value)[:, above], rtol=1e-4)
    kinds = {int(kind) for kind in np.array(drawn.sampled_type)}
    assert kinds == {+mi.BSDFFlags.DiffuseReflection, +mi.BSDFFlags.GlossyReflection}


def test_the_lobes_that_a_context_asks_for_add_up():
    bsdf, si, wo = plugin(roughness=0.4, metallic=0.2), hit(toward(40)), mi.Vector3f(toward(60, 180))
    whole, parts = bsdf.eval(mi.BSDFContext(), si, wo), []
    for component in (0, 1):
        context = mi.BSDFContext()
        context.component = component
        parts.append(bsdf.eval(context, si, wo))
        drawn, _ = bsdf.sample(context, si, mi.Float(0.5), mi.Point2f(0.3, 0.6))
        assert drawn.sampled_component[0] == component
        assert drawn.pdf[0] == pytest.approx(bsdf.pdf(context, si, drawn.wo)[0], rel=1e-4)
    assert np.allclose(np.array(parts[0] + parts[1]), np.array(whole), rtol=ROUNDINGS)
    assert np.array(parts[0]).ravel() == pytest.approx(0.8 * np.array(BASE) * np.cos(np.radians(60)) / np.pi, rel=ROUNDINGS)
    context.type_mask = mi.BSDFFlags.Transmission
    assert np.array(bsdf.eval(context, si, wo)).max() == 0 and bsdf.pdf(context, si, wo)[0] == 0


@pytest.mark.parametrize("visibility", VISIBILITIES)
@pytest.mark.parametrize("roughness", [0.05, 0.3, 0.7, 1.0])
def test_a_white_metal_in_a_white_furnace_sends_back_a_plus_b(roughness, visibility):
    """The mean weight of 2^17 samples is the albedo, to four of its standard errors and the look-up's 4e-4."""
    table, count = brdf.Brdf(BrdfModel(visibility), brdf_table(BrdfModel(visibility))), 2**17
    white = {"type": "rgb", "value": 1.0}
    bsdf = plugin(base_color=white, metallic=1.0, roughness=roughness, visibility=visibility)
    u = np.random.default_rng(9).random((3, count), dtype=np.float32)
    for degrees in (0, 60, 85, 89.9):
        wi = toward(degrees)
        si = hit(mi.Vector3f(np.repeat(np.float32(wi)[:, None], count, axis=1)))
        _, weight = bsdf.sample(mi.BSDFContext(), si, mi.Float(u[0]), mi.Point2f(u[1:]))
        weights = np.array(weight.x, dtype=np.float64)
        assert weights.max() <= 1 + 64 * 2.0**-24  # G2 <= G1(v), and D cancels
        a, b = brdf.look_up(table, mi.Float(wi[2]), mi.Float(roughness), mi.Bool(True))
        assert a[0] + b[0] <= 1 + 2.0**-22
        assert weights.mean() == pytest.approx(a[0] + b[0], abs=4 * weights.std() / np.sqrt(count) + 4e-4)


@pytest.mark.parametrize("roughness", [0.1, 0.4, 1.0])
def test_a_metal_is_that_of_mitsubas_principled(roughness):
    """Both are GGX, separable Smith and Schlick with alpha = roughness^2; principled's metal has no diffuse part."""
    wi, wo = random_directions(4000, 6), random_directions(4000, 7)
    wi.z, wo.z = dr.abs(wi.z) + 0.05, dr.abs(wo.z) + 0.05
    wi, wo = dr.normalize(wi), dr.normalize(wo)
    other = mi.load_dict(
        {"type": "principled", "base_color": {"type": "rgb", "value": BASE}, "metallic": 1.0, "roughness": roughness}
    )
    ours = np.array(plugin(metallic=1.0, roughness=roughness).eval(mi.BSDFContext(), hit(wi), wo))
    theirs = np.array(other.eval(mi.BSDFContext(), hit(wi), wo))
    assert np.allclose(ours, theirs, rtol=2e-4, atol=1e-7)  # theirs rounds 1 - cos^2 of the half vector


def test_parameters_are_found_and_updated():
    bsdf, si, wo = plugin(roughness=0.2), hit(toward(30)), mi.Vector3f(toward(30, 205))
    parameters = mi.traverse(bsdf)
    keys = {"base_color.value", "roughness.value", "metallic.value", "specular.value"}
    assert keys <= set(parameters.keys())
    parameters["roughness.value"], parameters["base_color.value"] = 0.6, mi.Color3f(0.1, 0.8, 0.3)
    parameters.update()
    fresh = plugin(roughness=0.6, base_color={"type": "rgb", "value": [0.1, 0.8, 0.3]})
    context = mi.BSDFContext()
    assert np.allclose(np.array(bsdf.eval(context, si, wo)), np.array(fresh.eval(context, si, wo)), rtol=ROUNDINGS)


def test_unknown_models_are_refused():
    """Mitsuba wraps what a plugin raises."""
    with pytest.raises(RuntimeError, match="InputError.*visibility: must be one of separable_smith"):
        plugin(visibility="smith")
    with pytest.raises(RuntimeError, match="InputError.*mapping: must be one of squared"):
        plugin(mapping="cubic")


def test_path_integrator_renders_it_in_a_furnace():
    """A white metal sphere in uniform light of 1 shows A + B: middle pixels to four standard errors, and finite everywhere."""
    scene = {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 3},
        "light": {"type": "constant", "radiance": 1.0},
        "sphere": {
            "type": "sphere",
            "bsdf": {
                "type": "metallic_roughness", "metallic": 1.0, "roughness": 0.7, "base_color": {"type": "rgb", "value": 1.0}
            },
        },
        "sensor": {
            "type": "perspective",
            "to_world": mi.ScalarTransform4f().look_at([0, 0, 4], [0, 0, 0], [0, 1, 0]),
            "film": {"type": "hdrfilm", "width": 24, "height": 20, "rfilter": {"type": "box"}},
        },
    }  # fmt: skip
    pixels = np.array(mi.render(mi.load_dict(scene), spp=256))
    assert np.isfinite(pixels).all() and pixels.min() >= 0
    middle = pixels[8:12, 10:14, 0].ravel()  # n.v >= 0.95
    model = BrdfModel()
    a, b = brdf.look_up(brdf.Brdf(model, brdf_table(model)), mi.Float([1.0, 0.95]), mi.Float(0.7), mi.Bool(True))
    darkest, brightest = sorted(np.array(a + b))
    error = 4 * middle.std() / 4
    assert darkest - error <= middle.mean() <= brightest + error and error < 0.05
