"""The ruins' materials."""

from scenes.making.usd_stage import Look

from .textures import FLOOR, WALL

BRICK = ("brick_roughness", 1), 0, "brick_normal", WALL
STONE = ("stone_roughness", 1), 0, "stone_normal"
LOOKS = {
    "brick": Look(("brick", 1), *BRICK),
    "brick_pale": Look(("brick", (1.22, 1.2, 1.12)), *BRICK),
    "brick_dark": Look(("brick", (0.62, 0.6, 0.62)), *BRICK),
    "brick_moss": Look(("brick_moss", 1), *BRICK),
    "floor": Look(("herringbone", 1), ("herringbone_roughness", 1), 0, "herringbone_normal", FLOOR),
    "stone": Look(("stone", 1), *STONE, 1.3),
    "stone_dark": Look(("stone", (0.62, 0.6, 0.56)), *STONE, 1.1),
    "marble": Look(("stone", (1.2, 1.2, 1.2)), ("stone_roughness", 0.7), 0, "stone_normal", 0.8),
    "clay": Look(("stone", (0.80, 0.34, 0.22)), *STONE, 0.7),
    "clay_pale": Look(("stone", (0.95, 0.58, 0.38)), *STONE, 0.7),
    "clay_dark": Look(("stone", (0.45, 0.22, 0.17)), *STONE, 0.7),
    "turf": Look(("turf", 1), 0.95, 0, "turf_normal", 3.1),
    "patch": Look(("patch", 1), 0.95, mask="patch"),
    "earth": Look(("turf", (1.15, 0.95, 0.85)), 0.95, 0, "turf_normal", 1.7),
    "hills": Look((0.20, 0.165, 0.13), 1.0),
    "hills_far": Look((0.38, 0.315, 0.285), 1.0),
    "puddle": Look((0.05, 0.045, 0.038), 0.07),
    "water": Look((0.022, 0.028, 0.022), 0.06, 0, "ripple_normal", 1.2),
    "fresco": Look(("fresco", 1), 0.9, mask="fresco"),
    "ivy": Look(("ivy", 1), 0.55, mask="ivy"),
    "grass": Look(("grass", 1), 0.75, mask="grass"),
    "iron": Look((0.10, 0.062, 0.045), 0.72),
    "wrought": Look((0.35, 0.33, 0.31), ("stone_roughness", 0.62), 1, None, 0.4),
    "bronze": Look((0.60, 0.42, 0.22), ("stone_roughness", 0.5), 1, None, 0.4),
    "oak": Look((0.085, 0.055, 0.035), 0.85),
    "coal": Look((0.03, 0.028, 0.027), 0.9, emission=(0.9, 0.14, 0.02)),
    "flame": Look((0.03, 0.02, 0.01), 0.9, emission=("flame", (12, 12, 12))),
    "feather": Look((0.032, 0.032, 0.036), 0.5),
}
