"""Who is on the square, in which clothes, and where everybody goes."""

from dataclasses import dataclass

from .body import Top

CUTS = {
    "jacket": Top(hem=0.82, ease=0.016, placket=True, neckline=0.17, collar=0.0, belt=0.004),
    "zip": Top(hem=0.87, ease=0.02, placket=True, collar=0.035, cuff=0.014, folds=0.006),
    "parka": Top(hem=0.74, ease=0.03, flare=0.02, placket=True, collar=0.04, cuff=0.02, folds=0.007),
    "coat": Top(hem=0.56, ease=0.022, flare=0.05, placket=True, neckline=0.14, collar=0.0),
    "trench": Top(hem=0.54, ease=0.018, flare=0.075, placket=True, neckline=0.12, collar=0.0, belt=0.016),
    "dress": Top(hem=0.53, ease=0.006, flare=0.095, sleeve=0.42, collar=-0.004, belt=0.01, folds=0.003),
    "gown": Top(hem=0.36, ease=0.006, flare=0.1, sleeve=0.9, collar=0.0, belt=0.01, folds=0.003),
    "tunic": Top(hem=0.72, ease=0.012, flare=0.03, collar=0.005, sleeve=0.9),
    "knit": Top(hem=0.84, ease=0.018, cuff=0.016, collar=0.022, folds=0.005),
    "tee": Top(hem=0.85, ease=0.012, sleeve=0.46, cuff=0.02, collar=0.0),
    "shirt": Top(hem=0.83, ease=0.013, placket=True, collar=0.02),
}
LEGS = {
    "slim": dict(ease=0.004, flare=0.006),
    "straight": dict(ease=0.01, flare=0.016),
    "wide": dict(ease=0.018, flare=0.045, hem=0.04),
    "shorts": dict(ease=0.012, flare=0.03, hem=0.47),
}


@dataclass(frozen=True)
class Person:
    """start: x and z at 0 s; to: where the walk is heading, or what somebody who stands looks at. how: a gait of gait.GAITS,
    'stand', 'talk' or 'sit'. phase: sixteenths of a cycle. top, legs, shoes: (cut, material). things: (thing, material).
    size: factor of the whole figure. tag: text and colour of the name above the head."""

    name: str
    build: str
    how: str
    start: tuple[float, float]
    to: tuple[float, float]
    skin: str
    hair: tuple[str, str]
    top: tuple[str, str]
    legs: tuple[str, str]
    shoes: str = "leather_umber"
    phase: int = 0
    size: float = 1.0
    things: tuple = ()
    tag: str | None = None
    boots: bool = False


P = Person
# fmt: off
CAST = (
    # near the camera
    P("Mira", "woman", "sway", (-0.95, 2.7), (-0.5, 12), "fair", ("long", "auburn"), ("trench", "weave_mustard"),
      ("tights", "weave_black"), "leather_umber", 3, 1.02, (("scarf", "knit_teal"), ("shoulder_bag", "leather_umber")),
      "Mira", True),
    P("Jonas", "man", "brisk", (-3.6, 3.3), (6, 2.3), "brown", ("short", "black"), ("zip", "weave_teal"), ("slim",
      "denim_navy"), "leather_cream", 9, 1.0, (("backpack", "weave_rust"),), "Jonas"),
    P("Theo", "lean", "stroll", (2.75, 2.9), (1.3, -20), "fair", ("side", "brown"), ("coat", "weave_charcoal"),
      ("straight", "weave_grey"), "leather_black", 5, 0.98, (("trolley", "leather_red"), ("shirt", "weave_white")),
      "Theo"),
    P("Noor", "woman", "stroll", (-3.1, -0.6), (-2.3, 10), "olive", ("bun", "black"), ("tunic", "weave_rose"), ("wide",
      "weave_cream"), "leather_camel", 0, 1.0, (("shoulder_bag", "leather_camel"),), None),
    P("Pia", "child", "child", (-2.45, -0.35), (-1.6, 10), "olive", ("curly", "black"), ("knit", "stripes_plain"),
      ("slim", "denim_blue"), "leather_red", 6, 1.0, (("beanie", "knit_red"),), "Pia"),
    P("Ada", "elder", "elder", (3.5, -0.9), (-6, -2.3), "fair", ("bob", "grey"), ("coat", "weave_plum"), ("tights",
      "weave_charcoal"), "leather_black", 11, 1.0, (("hat", "weave_plum"), ("scarf", "checks_plain")), "Ada"),
    P("Lin", "woman", "sway", (1.35, -3.2), (-5.5, 1.2), "tan", ("fringe", "black"), ("dress", "weave_red"), ("tights",
      "weave_charcoal"), "leather_black", 1, 0.98, (("umbrella", "weave_sky"),), "Lin"),
    # on a bench and around it
    P("Bruno", "broad", "sit", (-4.8, 0.6), (-2.6, 1.75), "fair", ("receding", "grey"), ("knit", "knit_moss"),
      ("straight", "weave_sand"), "leather_umber", 0, 1.0, (("newspaper", "weave_white"),), None),
    P("Ivo", "man", "phone", (-6.4, 4.4), (-3, 7), "tan", ("short", "brown"), ("tee", "weave_cream"), ("straight",
      "denim_blue"), "leather_white", 0, 1.02, (("phone", "leather_black"), ("cap", "weave_navy"))),
    # a group that talks, and a pair
    P("Omar", "man", "talk", (-3.9, -5.1), (-3.1, -5.7), "dark", ("short", "black"), ("jacket", "weave_blue"),
      ("straight", "weave_sand"), "leather_umber", 0, 1.03, (("shirt", "weave_white"), ("tie", "weave_rust")), "Omar"),
    P("Selma", "woman", "stand", (-2.75, -5.35), (-3.6, -5.6), "tan", ("bob", "blond"), ("jacket", "weave_cream"),
      ("wide", "weave_navy"), "leather_black", 1, 1.0, (("shirt", "weave_rose"),)),
    P("Kofi", "lean", "talk", (-3.4, -6.5), (-3.35, -5.4), "dark", ("curly", "black"), ("shirt", "checks_plain"), ("slim",
      "denim_navy"), "leather_camel", 1, 0.97, ()),
    P("Vera", "elder", "talk", (3.4, -7.6), (3.0, -8.5), "fair", ("bun", "grey"), ("gown", "weave_sky"), ("tights",
      "weave_grey"), "leather_black", 2, 1.02, (("scarf", "weave_cream"),)),
    P("Otto", "broad", "stand", (2.75, -8.6), (3.3, -7.6), "fair", ("receding", "grey"), ("parka", "weave_olive"),
      ("straight", "weave_umber"), "leather_umber", 2, 0.98, (("cap", "weave_olive"),)),
    # the middle distance
    P("Yara", "woman", "brisk", (0.9, -7.2), (0.1, 8), "brown", ("curly", "black"), ("zip", "weave_mustard"), ("slim",
      "weave_black"), "leather_white", 2, 1.03, (), "Yara"),
    P("Emil", "man", "stroll", (2.0, -5.9), (1.0, 8), "fair", ("side", "blond"), ("knit", "knit_navy"), ("straight",
      "weave_camel"), "leather_umber", 9, 1.0, ()),
    P("Rosa", "broad", "heavy", (-6.6, -3.0), (5.5, -1.7), "olive", ("bun", "brown"), ("coat", "weave_teal"), ("tights",
      "weave_black"), "leather_black", 4, 0.94, (("shoulder_bag", "leather_black"),)),
    P("Hugo", "broad", "heavy", (-1.5, -9.4), (-1.9, -30), "fair", ("short", "brown"), ("jacket", "weave_charcoal"),
      ("straight", "weave_charcoal"), "leather_black", 12, 1.03, (("shirt", "weave_sky"), ("briefcase",
      "leather_umber"))),
    P("Nils", "lean", "brisk", (4.6, -5.4), (-7, -7.2), "fair", ("short", "auburn"), ("parka", "weave_red"), ("slim",
      "denim_navy"), "leather_cream", 7, 1.0, (("backpack", "weave_charcoal"),)),
    P("Jun", "man", "stroll", (-5.2, -11.5), (-4.6, 6), "tan", ("short", "black"), ("coat", "weave_camel"), ("straight",
      "weave_navy"), "leather_black", 14, 0.99, (("shirt", "weave_white"), ("briefcase", "leather_black"))),
    P("Zoe", "woman", "sway", (-0.6, -13.4), (0.3, 5), "fair", ("long", "blond"), ("dress", "weave_teal"), ("tights",
      "weave_umber"), "leather_umber", 5, 1.0, (("bouquet", "weave_rose"),)),
    P("Malik", "man", "brisk", (-2.8, -14.5), (5, -17.5), "dark", ("short", "black"), ("jacket", "weave_olive"), ("slim",
      "weave_black"), "leather_white", 0, 1.04, (("shirt", "weave_cream"), ("trolley", "leather_blue"))),
    P("Greta", "elder", "elder", (-1.55, -7.9), (-2.2, 6), "fair", ("bob", "grey"), ("coat", "weave_navy"), ("tights",
      "weave_grey"), "leather_black", 8, 1.0, (("hat", "weave_navy"),)),
    P("Tom", "child", "child", (-0.9, -7.8), (-1.55, 6), "fair", ("fringe", "blond"), ("zip", "weave_blue"), ("shorts",
      "weave_sand"), "leather_red", 3, 1.06, (("cap", "weave_red"),)),
    P("Ines", "woman", "stroll", (-6.8, -13.6), (4, -11.8), "olive", ("fringe", "brown"), ("trench", "weave_sand"),
      ("tights", "weave_black"), "leather_umber", 10, 1.0, (("scarf", "weave_red"),)),
    P("Paul", "man", "stroll", (2.3, -19.5), (2.0, -34), "fair", ("side", "grey"), ("coat", "weave_navy"), ("straight",
      "weave_charcoal"), "leather_black", 6, 1.0, (("hat", "weave_charcoal"), ("briefcase", "leather_umber"))),
    P("Lea", "woman", "brisk", (3.5, 0.9), (3.3, 12), "fair", ("long", "brown"), ("parka", "weave_rose"), ("slim",
      "denim_blue"), "leather_white", 13, 1.0, ()),
    P("Samir", "lean", "brisk", (-7.4, -0.9), (5, -3.6), "brown", ("short", "black"), ("zip", "weave_rust"), ("straight",
      "denim_navy"), "leather_black", 2, 1.0, (("backpack", "weave_navy"),)),
    P("Elsa", "woman", "stand", (4.1, -19.8), (7.4, -19), "fair", ("bun", "blond"), ("coat", "weave_cream"), ("tights",
      "weave_black"), "leather_black", 3, 1.0, (("shoulder_bag", "leather_red"),)),
    P("Karl", "broad", "heavy", (0.75, -10.9), (0.5, 4), "fair", ("receding", "brown"), ("knit", "knit_rust"),
      ("straight", "denim_navy"), "leather_umber", 1, 1.0, ()),
)
# fmt: on
