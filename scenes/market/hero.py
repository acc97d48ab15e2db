"""The oak table in the foreground with what stands on it."""

import numpy as np
from scenes.making.shapes import ball, bow, box, lathe, merged, quad, tube
from scenes.making.usd_stage import Stage

from .goods import vase

SAMOVAR = [
    (0, 0), (0.13, 0), (0.13, 0), (0.13, 0.02), (0.13, 0.02), (0.08, 0.035), (0.05, 0.07), (0.055, 0.1), (0.11, 0.13),
    (0.155, 0.2), (0.172, 0.3), (0.165, 0.38), (0.165, 0.38), (0.176, 0.385), (0.176, 0.4), (0.165, 0.405),
    (0.165, 0.405),
    (0.12, 0.44), (0.075, 0.46), (0.07, 0.52), (0.085, 0.53), (0.085, 0.55), (0.03, 0.56), (0.02, 0.6), (0, 0.61),
]  # fmt: skip


def hero(m: Stage) -> None:
    """The oak table in the foreground: brushed brass and copper, glaze, a balance, fruit."""
    m.group("Hero", (2.15, 0, 1.75), -14)
    legs = [box(0.07, 0.72, 0.07, x, 0, z) for x in (-0.72, 0.72) for z in (-0.3, 0.3)]
    m.add("Hero/table", merged([box(1.7, 0.045, 0.82, 0, 0.72, 0), *legs, box(1.4, 0.09, 0.03, 0, 0.63, 0.3)]), "oak")
    m.add(
        "Hero/runner",
        merged([box(0.62, 0.004, 0.8, -0.42, 0.766, 0), quad((-0.73, 0.52, 0.414), (0.62, 0, 0), (0, 0.25, 0))]),
        "runner",
    )
    top = 0.766
    urn = [lathe(SAMOVAR, 44, refine=2), tube(bow((0.165, 0.33, 0), (0.165, 0.24, 0), (0.08, 0, 0)), 0.011, 8)]
    urn += [
        tube(bow((-0.165, 0.33, 0), (-0.165, 0.24, 0), (-0.08, 0, 0)), 0.011, 8),
        tube([(0, 0.15, 0.12), (0, 0.15, 0.21), (0, 0.12, 0.235)], 0.013, 8),
    ]
    m.add("Hero/samovar", merged(urn).at(-0.42, top + 0.005, -0.05), "brass")
    vase(m, "Hero/vase", (0.02, top, -0.16), "slim", "glaze", 1.05)
    vase(m, "Hero/celadon", (0.64, top, -0.14), "round", "celadon", 0.95)
    vase(m, "Hero/jar", (-0.72, top, 0.16), "jar", "oxblood", 0.6)
    bowl = [
        (0, 0),
        (0.05, 0),
        (0.05, 0),
        (0.055, 0.015),
        (0.12, 0.05),
        (0.155, 0.1),
        (0.16, 0.102),
        (0.15, 0.1),
        (0.11, 0.05),
        (0, 0.02),
    ]
    m.add("Hero/bowl", lathe(bowl, 32, refine=2).at(-0.08, top + 0.004, 0.2), "honey")
    spots = ((-0.06, 0.07, 0.03), (0.06, 0.075, 0.04), (0.0, 0.07, -0.07), (0.0, 0.125, 0.01))
    lemons = [ball(0.046, 16, 10).scaled(1.2, 1, 1).turned("y", 70 * k).at(*spot) for k, spot in enumerate(spots)]
    m.add("Hero/lemons", merged(lemons).at(-0.08, top, 0.2), "lemon")
    m.add("Hero/melon", ball(0.13, 28, 16).turned("x", 70).at(0.66, top + 0.128, 0.2), "melon")
    post = lathe(
        [
            (0, 0),
            (0.09, 0),
            (0.09, 0),
            (0.09, 0.015),
            (0.03, 0.03),
            (0.012, 0.08),
            (0.012, 0.36),
            (0.02, 0.38),
            (0, 0.4),
        ],
        20,
        refine=2,
    )
    pans, wires = [], []
    for side, dip in ((-1, 0.02), (1, -0.02)):
        x, y = side * 0.2, 0.1 - dip
        dish = lathe([(0, 0), (0.06, 0.006), (0.095, 0.028), (0.098, 0.028), (0.06, 0.009), (0, 0.003)], 28)
        pans.append(dish.at(x, y, 0))
        wires += [
            tube([(x + 0.095 * np.sin(a), y + 0.028, 0.095 * np.cos(a)), (x, 0.345 - dip, 0)], 0.0012, 4) for a in (0, 2.1, 4.2)
        ]
    beam = tube(bow((-0.2, 0.325, 0), (0.2, 0.365, 0), (0, 0.02, 0)), 0.007, 8)
    m.add("Hero/scale", merged([post, beam, *pans]).turned("y", 20).at(0.36, top, 0.08), "steel")
    m.add("Hero/scale_wires", merged(wires).turned("y", 20).at(0.36, top, 0.08), "wire")
