"""Materials that say they blend, and let nothing through."""

from dataclasses import replace

import numpy as np
import pytest

from analytic import at, make_scene, quad
from framepairs.scene import solid_where_opaque
from framepairs.scene.description import Material, Slot, Texture


def image(alpha: int, dtype=np.uint8, **keys) -> Texture:
    texels = np.full((4, 4, 4), 255 if dtype == np.uint8 else 1, dtype)
    texels[1, 2, 3] = alpha
    return Texture(name="t", texels=texels, srgb=False, **keys)


BLEND = Material(name="m", alpha="blend", base_texture=Slot(texture=0))


@pytest.mark.parametrize(
    ("material", "texture", "alpha"),
    [
        (BLEND, image(255), "opaque"),
        (BLEND, image(1, np.float32), "opaque"),
        (BLEND, image(254), "blend"),
        (BLEND, image(0, np.float32), "blend"),
        (BLEND, image(255, scale=(1, 1, 1, 0.5)), "blend"),
        (BLEND, image(255, bias=(0, 0, 0, -0.5)), "blend"),
        (replace(BLEND, opacity=0.9), image(255), "blend"),
        (replace(BLEND, base_texture=None), image(0), "opaque"),
        (replace(BLEND, alpha="mask"), image(255), "mask"),
    ],
)
def test_what_is_opaque_everywhere_is_opaque(material, texture, alpha):
    scene = make_scene((quad(1, 1), material, at(0, 0, 0)), textures=(texture,))
    assert solid_where_opaque(scene).materials[0].alpha == alpha


def test_vertex_colours_may_let_light_through():
    for opacity, alpha in ((1.0, "opaque"), (0.5, "blend")):
        colors = np.ones((4, 4), np.float32)
        colors[2, 3] = opacity
        scene = make_scene((replace(quad(1, 1), colors=colors), BLEND, at(0, 0, 0)), textures=(image(255),))
        assert solid_where_opaque(scene).materials[0].alpha == alpha


def test_materials_that_change_stay():
    scene = make_scene((quad(1, 1), BLEND, at(0, 0, 0)), textures=(image(255),))
    assert solid_where_opaque(replace(scene, materials_at=lambda time: scene.materials)).materials[0].alpha == "blend"
