"""The square's materials; those of clothes come from a palette."""

from scenes.making.gltf_values import Look

PLACE = {
    "paving": Look(("paving", (1.0, 0.96, 0.9)), ("paving_roughness", 1), normal=("paving_normal", 1.0), tile=4.0),
    "kerb": Look(("plaster", (0.5, 0.47, 0.43)), 0.8, normal="plaster_normal", tile=1.7),
    "asphalt": Look(("plaster", (0.16, 0.155, 0.15)), 0.9, normal=("plaster_normal", 1.6), tile=2.3),
    "ashlar": Look(("ashlar", (1.0, 0.95, 0.88)), 0.85, normal="ashlar_normal", tile=3.2),
    "trim": Look(("plaster", (0.78, 0.70, 0.57)), 0.8, normal="plaster_normal", tile=2.6),
    "stucco": Look(("plaster", (0.62, 0.42, 0.26)), 0.9, normal="plaster_normal", tile=3.1),
    "ochre": Look(("plaster", (0.72, 0.5, 0.28)), 0.9, tile=3.1),
    "cream": Look(("plaster", (0.76, 0.66, 0.5)), 0.9, tile=3.1),
    "vault": Look(("plaster", (0.3, 0.27, 0.24)), 0.9, tile=3.1),
    "slate": Look(("plaster", (0.17, 0.2, 0.22)), 0.55, normal="plaster_normal", tile=1.1),
    "verdigris": Look(("plaster", (0.27, 0.46, 0.38)), 0.6, normal="plaster_normal", tile=1.9),
    "iron": Look((0.035, 0.045, 0.042), 0.42),
    "green_paint": Look(("wood", (0.07, 0.21, 0.17)), 0.42, tile=0.9),
    "cream_paint": Look(("wood", (0.9, 0.84, 0.7)), 0.5, tile=0.9),
    "oak": Look(("wood", (0.46, 0.28, 0.15)), 0.6, tile=0.5),
    "rail": Look((0.56, 0.55, 0.54), 0.3, metallic=1),
    "brass": Look((0.88, 0.68, 0.33), 0.28, metallic=1),
    "steel": Look((0.66, 0.67, 0.69), 0.36, metallic=1),
    "glass": Look((0.025, 0.032, 0.038), 0.05),
    "hall_glass": Look((0.05, 0.06, 0.07), 0.12, emission=(0.05, 0.045, 0.035)),
    "shop": Look((0.04, 0.04, 0.04), 0.1, emission=("shop", (1.25, 1.25, 1.25))),
    "lamp": Look((0.75, 0.72, 0.64), 0.3, emission=(0.9, 0.75, 0.5)),
    "posters": Look(("posters", 1), 0.55),
    "clock": Look(("clock", 1), 0.35),
    "stop": Look(("stop", 1), 0.4),
    "frieze": Look(("frieze", 1), 0.8),
    "bark": Look(("wood", (0.24, 0.18, 0.13)), 0.95, tile=0.4),
    "leaves": Look(("leaves", (1.7, 1.5, 0.9)), 0.65, mask=True),
    "earth": Look((0.06, 0.045, 0.03), 1.0),
    "terracotta": Look(("plaster", (0.5, 0.25, 0.15)), 0.85, normal="plaster_normal", tile=1),
    "awning": Look(("stripes", (0.9, 0.5, 0.35)), 0.85, normal=("creases_normal", 0.3), tile=0.55),
    "banner_red": Look(("weave", (0.56, 0.06, 0.05)), 0.9, normal=("creases_normal", 0.3), tile=2.2),
    "banner_blue": Look(("weave", (0.06, 0.16, 0.36)), 0.9, normal=("creases_normal", 0.3), tile=2.2),
    "tram_red": Look((0.48, 0.045, 0.035), 0.22),
    "tram_cream": Look((0.78, 0.7, 0.52), 0.24),
    "rubber": Look((0.03, 0.03, 0.032), 0.85),
    "paper": Look((0.74, 0.72, 0.67), 0.9),
    "pigeon": Look(("strands", (0.42, 0.44, 0.5)), 0.6, tile=0.1),
    "pigeon_dark": Look((0.11, 0.12, 0.15), 0.5),
}
SKIN = {
    "skin_fair": (0.62, 0.40, 0.31),
    "skin_tan": (0.50, 0.30, 0.20),
    "skin_olive": (0.40, 0.235, 0.145),
    "skin_brown": (0.225, 0.12, 0.075),
    "skin_dark": (0.105, 0.056, 0.04),
}
HAIR = {
    "hair_black": (0.035, 0.03, 0.03),
    "hair_brown": (0.12, 0.065, 0.035),
    "hair_auburn": (0.26, 0.09, 0.035),
    "hair_blond": (0.55, 0.38, 0.17),
    "hair_grey": (0.5, 0.49, 0.47),
}
COLOURS = {
    "mustard": (0.66, 0.40, 0.07),
    "rust": (0.50, 0.15, 0.05),
    "red": (0.52, 0.05, 0.045),
    "rose": (0.62, 0.26, 0.25),
    "navy": (0.04, 0.06, 0.14),
    "blue": (0.08, 0.20, 0.42),
    "sky": (0.36, 0.52, 0.66),
    "teal": (0.04, 0.25, 0.25),
    "olive": (0.19, 0.20, 0.085),
    "moss": (0.12, 0.24, 0.1),
    "sand": (0.56, 0.45, 0.31),
    "camel": (0.46, 0.29, 0.14),
    "cream": (0.76, 0.70, 0.58),
    "white": (0.82, 0.81, 0.78),
    "grey": (0.30, 0.30, 0.31),
    "charcoal": (0.075, 0.078, 0.085),
    "black": (0.035, 0.035, 0.038),
    "plum": (0.20, 0.05, 0.13),
    "umber": (0.13, 0.075, 0.045),
}
CLOTHS = {  # image, normal map, roughness, metres per repeat
    "weave": ("weave", ("creases_normal", 0.3), 0.88, 1.1),
    "denim": ("denim", ("creases_normal", 0.25), 0.85, 0.5),
    "knit": ("knit", ("knit_normal", 0.5), 0.95, 0.2),
    "stripes": ("stripes", ("creases_normal", 0.2), 0.9, 0.16),
    "checks": ("checks", ("creases_normal", 0.2), 0.9, 0.26),
    "leather": ("weave", ("creases_normal", 0.2), 0.4, 0.5),
}


def cloth_look(name: str) -> Look:
    """'<cloth>_<colour>'."""
    cloth, colour = name.split("_")
    image, normal, roughness, tile = CLOTHS[cloth]
    bright = (0.78, 0.75, 0.71) if cloth in ("stripes", "checks") and colour == "plain" else COLOURS.get(colour)
    return Look((image, bright), roughness, normal=normal, tile=tile)


class Looks(dict):
    """All materials; a piece of clothing's is made when it is asked for."""

    def __missing__(self, name: str) -> Look:
        self[name] = cloth_look(name)
        return self[name]


def looks() -> Looks:
    skins = {name: Look(colour, 0.52) for name, colour in SKIN.items()}
    hairs = {name: Look(("strands", colour), 0.5, tile=0.12) for name, colour in HAIR.items()}
    return Looks(PLACE | skins | hairs)
