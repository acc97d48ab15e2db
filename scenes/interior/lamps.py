"""Lamps, and the light that they give: every lamp is a mesh that glows and one or two spots that shine."""

import numpy as np
from scenes.making.shapes import ball, box, lathe, merged, tube

from .furniture import banker_lamp, lamp_foot, shade
from .light import WINDOWS
from .room import BACK, BREAST, CEILING, LEFT
from .scene_file import SceneFile

WARM = np.array([1.0, 0.71, 0.42])
AMBER = np.array([1.0, 0.5, 0.17])
PENDANTS = [(x, 2.72, z) for z in (-4.4, -1.2, 2.4) for x in (-1.75, 1.75)]
DESK = (2.75, 0.0)  # middle of the library table
DESK_LAMPS = [(2.75, 0.78, 0.82 * k) for k in (-1, 0, 1)]
TABLE_LAMPS = {"Fireside": (-1.62, 0.56, -5.0), "Window": (-4.25, 0.72, -2.75)}
FLOOR_LAMP = (2.35, -4.9)
SCONCES = [(LEFT + 0.16, 2.35, z) for z in (-2.5, 1.1, 4.7)]
SHELF_LAMPS = [((4.06, 3.64, z), (4.7, 1.0, z)) for z in (-5.4, -3.0, -0.6, 1.8, 4.2)]
SHELF_LAMPS += [((x, 3.64, -6.04), (x, 1.0, -6.7)) for x in (-2.6, 2.6)]


def pendants(m: SceneFile) -> None:
    fitting = [
        lathe([(0.05, CEILING - 2.76), (0.06, CEILING - 2.75), (0.03, CEILING - 2.72), (0, CEILING - 2.72)], 20),
        lathe([(0.075, 0.125), (0.085, 0.14), (0.05, 0.17), (0.022, 0.2), (0.012, 0.26), (0.006, 0.27)], 20),
        lathe([(0.152, -0.012), (0.158, -0.012), (0.158, 0.012), (0.152, 0.012)], 40),
    ]
    brass = m.mesh("pendant_brass", merged(fitting))
    globe = m.mesh("pendant_globe", ball(0.15, 36, 20))
    for k, (x, y, z) in enumerate(PENDANTS):
        m.add(f"Pendants/Pendant{k}/brass", brass, "polished_brass", (x, y, z))
        cord = ("cylinder", {"p0": "0, 0.26, 0", "p1": f"0, {CEILING - y:g}, 0", "radius": "0.006"})
        m.add(f"Pendants/Pendant{k}/cord", cord, "polished_brass", (x, y, z))
        m.add(f"Pendants/Pendant{k}/globe", globe, "opal", (x, y, z), glow="opal_glow")
        m.spot(f"Pendants/Pendant{k}/light", (x, y - 0.16, z), (x, 0, z), 28 * WARM, 64, 30)
        m.spot(f"Pendants/Pendant{k}/up", (x, y + 0.3, z), (x, 9, z), 4 * WARM, 74, 20)


def desk_lamps(m: SceneFile) -> None:
    parts = {part: m.mesh(f"desk_lamp_{part}", shape) for part, shape in banker_lamp().items()}
    for k, (x, y, z) in enumerate(DESK_LAMPS):
        m.add(f"DeskLamps/Lamp{k}/brass", parts["brass"], "polished_brass", (x, y, z), -90)
        m.add(f"DeskLamps/Lamp{k}/glass", parts["glass"], "green_glass", (x, y, z), -90, glow=(0.01, 0.12, 0.035))
        m.add(f"DeskLamps/Lamp{k}/bulb", parts["bulb"], "opal", (x, y, z), -90, glow=(6.0, 4.2, 2.2))
        m.spot(f"DeskLamps/Lamp{k}/light", (x - 0.055, y + 0.33, z), (x - 0.1, 0, z), 2.4 * WARM, 74, 45)


def shaded_lamps(m: SceneFile) -> None:
    small, tall = shade(0.21, 0.12, 0.24, 0), shade(0.26, 0.16, 0.3, 0)
    shades = {"table": m.mesh("shade_table", small), "floor": m.mesh("shade_floor", tall)}
    feet = {"table": m.mesh("foot_table", lamp_foot(0.44, "table")), "floor": m.mesh("foot_floor", lamp_foot(1.5, "floor"))}
    lamps = [(name, "table", place, 0.36) for name, place in TABLE_LAMPS.items()]
    lamps += [("Floor", "floor", (FLOOR_LAMP[0], 0, FLOOR_LAMP[1]), 1.38)]
    for name, kind, (x, y, z), low in lamps:
        foot = "polished_brass" if kind == "floor" else "celadon" if name == "Fireside" else "cobalt"
        m.add(f"Lamps/{name}/foot", feet[kind], foot, (x, y, z))
        m.add(f"Lamps/{name}/shade", shades[kind], "cloth_shade", (x, y + low, z), glow="shade_glow")
        bulb = y + low + 0.13
        m.spot(f"Lamps/{name}/down", (x, bulb, z), (x, 0, z), 6 * WARM, 66, 48)
        m.spot(f"Lamps/{name}/up", (x, bulb + 0.02, z), (x, 9, z), 9 * WARM, 58, 30)


def wall_lamps(m: SceneFile) -> None:
    brass = [
        box(0.02, 0.26, 0.08, -0.15, -0.18, 0),
        tube([(-0.14, -0.1, 0), (-0.05, -0.12, 0), (0, -0.09, 0), (0, -0.04, 0)], 0.008, 8),
    ]
    brass += [lathe([(0, -0.05), (0.035, -0.04), (0.045, -0.01), (0.04, -0.01), (0, -0.01)], 20)]
    bowl = lathe(
        [(0.035, -0.01), (0.075, 0.03), (0.095, 0.09), (0.1, 0.13), (0.096, 0.13), (0.07, 0.03), (0, 0.0)], 28, refine=2
    )
    metal, glass = m.mesh("sconce_brass", merged(brass)), m.mesh("sconce_glass", bowl)
    for k, place in enumerate(SCONCES):
        m.add(f"Sconces/Sconce{k}/brass", metal, "brass", place)
        m.add(f"Sconces/Sconce{k}/glass", glass, "opal", place, glow=tuple(1.5 * WARM))
        x, y, z = place
        m.spot(f"Sconces/Sconce{k}/light", (x, y + 0.14, z), (x - 0.04, 9, z), 7.0 * WARM, 80, 35)
    reach = [tube([(0, 0, 0), (0, 0.12, 0.02), (0, 0.1, 0.3), (0, 0.06, 0.42)], 0.009, 8)]
    reach += [tube([(-0.14, 0.05, 0.43), (0.14, 0.05, 0.43)], 0.035, 12)]
    arm = m.mesh("shelf_lamp", merged(reach))
    for k, (place, target) in enumerate(SHELF_LAMPS):
        on_side = k < 5
        root = (4.5, 3.68, place[2]) if on_side else (place[0], 3.68, -6.5)
        m.add(f"ShelfLamps/Lamp{k}/brass", arm, "polished_brass", root, -90 if on_side else 0)
        m.spot(f"ShelfLamps/Lamp{k}/light", place, target, 40 * WARM, 64, 25)
    m.spot("Pictures/Mantel/light", (0, 3.3, BACK + BREAST + 0.75), (0, 1.95, BACK + BREAST), 13 * WARM, 38, 20)


def fire_and_dusk(m: SceneFile) -> None:
    m.spot("Fire/light", (0, 0.42, BACK + BREAST + 0.02), (0, 0.3, 0), 15 * AMBER, 88, 40)
    m.spot("Fire/back_light", (0, 0.5, BACK + BREAST - 0.02), (0, 0.35, BACK), 0.7 * AMBER, 85, 30)
    m.point("Mantel/candlelight", (-0.6, 1.85, BACK + BREAST + 0.16), 0.35 * AMBER)
    for k, z in enumerate(WINDOWS):
        m.spot(f"Outside/light{k}", (LEFT - 5.5, 6.4, z - 0.5), (LEFT, 2.0, z), np.array([0.25, 0.5, 1.0]) * 80, 20, 16)


def lamps(m: SceneFile) -> None:
    for part in (pendants, desk_lamps, shaded_lamps, wall_lamps, fire_and_dusk):
        part(m)
