"""The forest's materials. Those that end in a number stand in the mist: `mist_looks` darkens them and lets them shine."""

from dataclasses import replace

from scenes.making.usd_stage import Look

# Radiance of the mist before things far away, and what it leaves of their own colour. Even numbers stand towards the sun.
MIST = {
    1: ((0.042, 0.048, 0.048), 0.80),
    2: ((0.120, 0.098, 0.058), 0.78),
    3: ((0.120, 0.138, 0.138), 0.55),
    4: ((0.330, 0.265, 0.155), 0.50),
}

NEAR = {
    "floor": Look(("floor", 1), ("floor_roughness", 1), normal="floor_normal", tile=3.0),
    "path": Look(("path", 1), 0.92, normal="floor_normal", mask="path"),
    "oak_bark": Look(("oak_bark", 1), ("bark_roughness", 1), normal="oak_bark_normal"),
    "oak_root": Look(("oak_root", 1), 0.9, normal="oak_bark_normal"),
    "birch_bark": Look(("birch_bark", 1), ("bark_roughness", 0.8), normal="birch_bark_normal"),
    "birch_root": Look(("birch_root", 1), 0.9, normal="birch_bark_normal"),
    "oak_leaves": Look(("oak_leaves", (1.45, 1.4, 1.2)), 0.62, mask="oak_leaves"),
    "birch_leaves": Look(("birch_leaves", (1.35, 1.3, 1.1)), 0.55, mask="birch_leaves"),
    "golden_leaves": Look(("birch_leaves", (2.6, 1.25, 0.55)), 0.58, mask="birch_leaves"),
    "fern": Look(("fern", (1.5, 1.45, 1.2)), 0.6, mask="fern"),
    "grass": Look(("grass", (1.6, 1.5, 1.2)), 0.65, mask="grass"),
    "fallen_leaves": Look(("fallen_leaves", (1.0, 1.0, 1.0)), 0.75),
    "rock": Look(("rock", 1), ("rock_roughness", 1), normal="rock_normal", tile=1.3),
    "wood": Look(("oak_bark", (1.5, 1.35, 1.2)), 0.85, normal="oak_bark_normal"),
    "end_grain": Look(("end_grain", 1), 0.85),
    "cap": Look((0.58, 0.055, 0.025), 0.3),
    "brown_cap": Look((0.34, 0.19, 0.085), 0.4),
    "stem": Look((0.78, 0.73, 0.62), 0.7),
    "iron": Look((0.32, 0.31, 0.30), 0.5, 1),
    "brass": Look((0.80, 0.58, 0.27), 0.32, 1),
    "flame": Look((0.1, 0.06, 0.02), 0.2, emission=(6.0, 3.0, 0.9)),
    "blue_wing": Look((0.10, 0.24, 0.62), 0.5),
    "orange_wing": Look((0.78, 0.30, 0.04), 0.5),
    "body": Look((0.035, 0.03, 0.03), 0.6),
    "feather": Look((0.24, 0.22, 0.21), 0.7),
    "breast": Look((0.62, 0.24, 0.08), 0.75),
    "backdrop": Look(("backdrop", 1), 1.0, mask="backdrop"),
    "hills": Look((0.05, 0.06, 0.05), 1.0),
}


def _in_mist(look: Look, number: int) -> Look:
    radiance, left = MIST[number]
    image, tint = look.base
    tint = tint if isinstance(tint, tuple) else (tint,) * 3
    return replace(look, mask=None, base=(image, tuple(left * part for part in tint)), emission=radiance)


def mist_looks(names: tuple[str, ...]) -> dict[str, Look]:
    return {f"{name}_{number}": _in_mist(NEAR[name], number) for name in names for number in MIST}


FAR_NAMES = ("oak_bark", "birch_bark", "oak_leaves", "birch_leaves", "golden_leaves")
LOOKS = {**NEAR, **mist_looks(FAR_NAMES)}

# Index of refraction where it is not 1.5: what is loose or full of holes has little of a surface that could shine.
IOR = {
    **dict.fromkeys(("floor", "path", "rock", "oak_root", "birch_root", "fallen_leaves", "backdrop", "hills"), 1.15),
    **dict.fromkeys(("fern", "grass", "oak_bark"), 1.2),
    **{name: 1.3 for name in LOOKS if "leaves" in name and name != "fallen_leaves"},
}
