"""The houses all around the square, and the tower behind them."""

from scenes.making.shapes import box, lathe, merged, quad
from scenes.making.usd_stage import Stage

from .houses import CHIMNEY_POT, House, building, row, whole_height

SHOP = ((1.0, 0.75, 1.7, 1.75), (3.5, 0.14, 1.15, 2.35), (5.4, 0.75, 1.9, 1.75))
HOUSES = (
    House(
        "Ochre",
        (-11, 0, -7),
        0,
        8.1,
        6.5,
        "ochre",
        row(0.9, 2.5, 3, 1.1) + row(0.9, 2.5, 3, 4.0),
        "teal_paint",
        pipes=(7.95,),
        dormers=(4.1,),
    ),
    House("Brick", (-2.9, 0, -7), 0, 8.1, 7.3, "brick", SHOP + row(1.2, 2.4, 3, 4.5), lit=(0, 2), corners=(0, 8.1)),
    House("Rose", (7.2, 0, -7), 0, 2.8, 6.2, "rose", row(0.9, 1, 1, 1.1) + row(0.9, 1, 1, 3.9), "white_paint", pipes=(0.12,)),
    House(
        "Cream",
        (10, 0, -7),
        -90,
        16,
        6.0,
        "cream",
        row(1.1, 2.6, 3, 1.1) + row(11.5, 1, 1, 1.1) + row(1.1, 2.6, 6, 3.8),
        "teal_paint",
        (2,),
        doors=((9.0, 1.05, 2.2), (14.2, 1.0, 2.2)),
        pipes=(5.9, 15.9),
        chimneys=((3.0, 3.2), (8.7, 5.6), (13.5, 3.4)),
        dormers=(6.3, 11.5),
    ),
    House(
        "Left",
        (-11, 0, -2.6),
        90,
        4.4,
        5.6,
        "rose",
        row(0.9, 1.9, 2, 1.1) + row(0.9, 1.9, 2, 3.6),
        "white_paint",
        pipes=(4.25,),
        chimneys=((2.2, 4.0),),
    ),
    House(
        "Farther",
        (-16, 0, 12),
        90,
        14,
        4.6,
        "cream",
        row(0.9, 2.4, 3, 1.1) + row(10.5, 2.0, 2, 1.1),
        "teal_paint",
        doors=((8.35, 1.1, 2.2),),
        pipes=(0.15,),
        chimneys=((4.0, 3.4), (11.0, 5.0)),
    ),
    House("Distant", (0, 0, -21), 0, 14, 8.5, "ochre", row(1, 2.2, 6, 5), far=True),
    House(
        "South",
        (12.5, 0, 14),
        180,
        9.5,
        6.8,
        "ochre",
        row(0.8, 2.3, 1, 1.1) + row(4.9, 2.3, 2, 1.1) + row(0.8, 2.3, 4, 4.1),
        "white_paint",
        doors=((3.1, 1.1, 2.2),),
        pipes=(9.35,),
        chimneys=((2.5, 3.4), (7.5, 5.0)),
        dormers=(3.2, 6.6),
        far=True,
    ),
    House(
        "SouthBrick",
        (3, 0, 14),
        180,
        8.2,
        7.6,
        "brick",
        row(0.9, 2.4, 2, 0.9, 1.3, 1.6) + row(6.0, 2, 1, 0.9, 1.3, 1.6) + row(0.9, 2.4, 3, 4.6),
        lit=(1,),
        doors=((4.75, 1.0, 2.2),),
        chimneys=((1.5, 3.2), (6.8, 3.2)),
        corners=(0, 8.2),
        far=True,
    ),
    House(
        "SouthRose",
        (-5.2, 0, 14),
        180,
        16.5,
        6.2,
        "rose",
        row(0.9, 2.5, 2, 1.1) + row(8.0, 2, 1, 1.1) + row(0.9, 2.5, 4, 3.9),
        "teal_paint",
        doors=((6.1, 1.1, 2.2),),
        pipes=(0.15, 11.0),
        chimneys=((4.5, 3.0), (9.0, 5.4)),
        far=True,
    ),
    House(
        "EastEnd",
        (20, 0, 6),
        -90,
        14,
        6.6,
        "cream",
        row(0.9, 2.4, 5, 1.1) + row(0.9, 2.4, 5, 4.1),
        chimneys=((6, 4),),
        far=True,
    ),
)


def town(m: Stage) -> None:
    for house in HOUSES:
        building(m, house)
    m.group("Tower", (5.6, 0, -27))
    m.add("Tower/shaft", whole_height(box(3.4, 15, 3.4), 15), "cream")
    m.add("Tower/spire", lathe([(2.7, 15), (2.5, 15.1), (0, 21)], 4).turned("y", 45), "tiles")
    m.add("Tower/belfry", merged([box(0.9, 2, 0.05, x, 11.8, 1.7) for x in (-0.7, 0.7)]), "iron")
    stacks, pots = [], []
    for x in (-8.5, -4.5, 1.4, 4.2):
        stacks += [box(0.7, 1.75, 0.6, x, 7.6, -9.4), box(0.84, 0.1, 0.74, x, 9.1, -9.4), box(0.78, 0.08, 0.68, x, 9.35, -9.4)]
        pots += [CHIMNEY_POT.at(x + dx, 9.43, -9.4) for dx in (-0.18, 0.18)]
    m.add("Chimneys/stacks", merged(stacks), "brick")
    m.add("Chimneys/pots", merged(pots), "terracotta")
    m.group("Neon", (0.9, 3.0, -6.93))
    m.add("Neon/board", box(3.3, 0.95, 0.07, 0, 0, 0.08), "iron")
    m.add("Neon/tubes", quad((-1.55, 0.09, 0.125), (3.1, 0, 0), (0, 0.775, 0), st=(1, 1)), "neon")
