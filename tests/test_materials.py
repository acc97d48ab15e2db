"""Materials as one table: which pyramids they get, and what a filtered normal map does to roughness."""

import numpy as np
import pytest

from analytic import at, make_scene, quad
from framepairs import materials
from framepairs.backend import dr, mi
from framepairs.conventions import BrdfModel
from framepairs.materials import Footprint, build_materials, opacity_of, roughened, surface_of
from framepairs.scene.description import Material, SceneDescription, Slot, Texture
from framepairs.textures import TextureSettings

HALF_STEP = 2.0**-11
TILT = 0.4  # radians
LOST = (1 - np.cos(TILT)) / np.cos(TILT)  # slope variance of the bumps' mean normal


def bumps() -> Texture:
    """Columns tilted by +-TILT along u."""
    vectors = np.zeros((4, 6, 4), np.float32)
    vectors[..., 0], vectors[..., 2] = np.sin(TILT) * np.where(np.arange(6) % 2, 1, -1), np.cos(TILT)
    return Texture(name="bumps", texels=vectors, srgb=False)


def holes(seed: int = 2) -> Texture:
    texels = np.random.default_rng(seed).uniform(0, 1, (32, 32, 4)).astype(np.float32)
    texels[..., 3] **= 3
    return Texture(name="holes", texels=texels, srgb=False)


def scene_of(*parts: Material, textures: tuple[Texture, ...]) -> SceneDescription:
    return make_scene(*((quad(1, 1), material, at(0, 0, k)) for k, material in enumerate(parts)), textures=textures)


def far_away(texels: int) -> Footprint:
    """A look-up at the centre whose footprint is the whole texture, `texels` wide."""
    one = mi.Vector2f(1, 0), mi.Vector2f(0, 1)
    return Footprint(mi.Point2f(0.5, 0.5), *one, mi.Float(np.log2(texels)))


def first_material(footprint: Footprint) -> mi.UInt32:
    """Index 0 for each look-up: a branch of a kernel has the width of its condition."""
    return dr.opaque(mi.UInt32, 0, dr.width(footprint.uv))


def surface(material: Material, settings: TextureSettings, model: BrdfModel, footprint: Footprint):
    table = build_materials(scene_of(material, textures=(bumps(),)), model, settings)
    return surface_of(table, first_material(footprint), footprint, mi.Bool(True))


@pytest.mark.parametrize("mapping", ["squared", "linear"])
@pytest.mark.parametrize(("roughness", "scale"), [(0.3, 1.0), (0.7, 0.5), (1.0, 2.0)])
def test_what_a_normal_map_loses_becomes_roughness(mapping, roughness, scale):
    material = Material(name="m", roughness=roughness, normal_texture=Slot(texture=0), normal_scale=scale)
    model = BrdfModel(mapping=mapping)
    alpha = roughness**2 if mapping == "squared" else roughness
    widened = min(np.sqrt(alpha**2 + 2 * LOST * scale**2), 1)
    expected = np.sqrt(widened) if mapping == "squared" else widened
    got = surface(material, TextureSettings(), model, far_away(8))
    assert abs(float(got.roughness[0]) - expected) < HALF_STEP
    off = surface(material, TextureSettings(normal_variance=False), model, far_away(8))
    assert float(off.roughness[0]) == np.float32(roughness)
    assert abs(float(got.tangent_normal.x[0])) < HALF_STEP and float(got.tangent_normal.z[0]) > 1 - HALF_STEP


@pytest.mark.parametrize("roughness", [0.0, 0.02, 0.5])
def test_a_normal_map_seen_closely_adds_no_roughness(roughness):
    material = Material(name="m", roughness=roughness, normal_texture=Slot(texture=0))
    u = mi.Float(np.linspace(0, 1, 100, dtype=np.float32))
    near = Footprint(mi.Point2f(u, 0.4), mi.Vector2f(0.01, 0), mi.Vector2f(0, 0.01), mi.Float(0))
    got = surface(material, TextureSettings(), BrdfModel(), near)
    assert (np.array(got.roughness) == np.float32(roughness)).all()


def test_roughness_grows_with_variance_and_ends_at_one():
    variance = np.linspace(0, 2, 200, dtype=np.float32)
    got = np.array(roughened(BrdfModel(), mi.Float(0.4), mi.Float(variance)))
    assert (np.diff(got) >= 0).all() and got[0] == np.float32(0.4) and got[-1] == 1


def test_a_texture_has_one_pyramid_for_each_of_its_roles():
    slot = Slot(texture=0)
    opaque = Material(name="a", base_texture=slot, surface_texture=slot)
    again = Material(name="b", base_texture=Slot(texture=1), alpha="blend")  # an equal texture of another name
    mask = Material(name="c", base_texture=slot, alpha="mask", alpha_cutoff=0.25)
    half = Material(name="d", base_texture=slot, alpha="mask", alpha_cutoff=0.125, opacity=0.5)  # the same threshold
    other = Material(name="e", base_texture=slot, alpha="mask", alpha_cutoff=0.5)
    normal = Material(name="f", normal_texture=slot)
    first = holes()
    second = Texture(name="copy", texels=first.texels, srgb=first.srgb)
    scene = scene_of(opaque, again, mask, half, other, normal, textures=(first, second))
    table = build_materials(scene)
    base = np.array(table.slots).reshape(-1, 4)
    assert len(np.array(table.textures.first_level)) == 4
    assert base[0, 0] == base[0, 1] == base[1, 0] and base[2, 0] == base[3, 0]
    assert len({base[0, 0], base[2, 0], base[4, 0], base[5, 2]}) == 4
    assert len(np.array(build_materials(scene, settings=TextureSettings(mask_coverage=False)).textures.first_level)) == 2


@pytest.mark.parametrize("opacity", [1.0, 0.7])
def test_a_mask_covers_as_much_far_away_as_it_does_closely(opacity):
    """A third of these texels pass at level 0; without care hardly one of level 3's, which are means of 64."""
    material = Material(name="m", base_texture=Slot(texture=0), alpha="mask", alpha_cutoff=0.4, opacity=opacity)
    scene = scene_of(material, textures=(holes(),))
    shares = {}
    for settings in (TextureSettings(), TextureSettings(mask_coverage=False)):
        table = build_materials(scene, settings=settings)
        for level in (0, 2, 3):
            count = 32 >> level
            slope = (mi.Vector2f(1 / count, 0), mi.Vector2f(0, 1 / count))
            places = mi.Point2f(np.random.default_rng(level).random((2, 40_000)).astype(np.float32))
            footprint = Footprint(places, *slope, mi.Float(0))
            opaque = opacity_of(table, first_material(footprint), footprint, mi.Bool(True))
            shares[settings.mask_coverage, level] = np.array(opaque).mean()
    assert 0.05 < shares[True, 0] == shares[False, 0] < 0.4
    for level in (2, 3):
        # 16 places of each of 64 or 16 texels stand for all, and 40 000 random ones here
        assert abs(shares[True, level] - shares[True, 0]) <= 0.02
        assert shares[False, level] < 0.5 * shares[False, 0]


def test_only_normal_textures_cost_variance(monkeypatch):
    def called(*_):
        raise AssertionError("roughened")

    monkeypatch.setattr(materials, "roughened", called)
    plain = build_materials(scene_of(Material(name="m", base_texture=Slot(texture=0)), textures=(holes(),)))
    surface_of(plain, mi.UInt32(0), far_away(32), mi.Bool(True))
    bumpy = Material(name="m", normal_texture=Slot(texture=0))
    with pytest.raises(AssertionError, match="roughened"):
        surface(bumpy, TextureSettings(), BrdfModel(), far_away(8))
    surface(bumpy, TextureSettings(normal_variance=False), BrdfModel(), far_away(8))
