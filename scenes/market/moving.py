"""What moves, sampled at every time code of four seconds: cart, ball, pigeon, lantern, carousel, pinwheels, a sign."""

import numpy as np
from scenes.making.shapes import Shape, ball, box, lathe, merged, quad, sheet, tube
from scenes.making.usd_stage import Stage

from .goods import POT, VASES


def wheel(radius: float) -> Shape:
    rim = lathe(
        [
            (radius - 0.04, -0.02),
            (radius, -0.02),
            (radius, -0.02),
            (radius, 0.02),
            (radius, 0.02),
            (radius - 0.04, 0.02),
            (radius - 0.04, 0.02),
            (radius - 0.04, -0.02),
        ],
        32,
    )
    spokes = [box(0.03, radius - 0.03, 0.024).turned("z", 45 * k) for k in range(8)]
    return merged(
        [rim.turned("x", 90), *spokes, lathe([(0, -0.05), (0.05, -0.05), (0.05, 0.05), (0, 0.05)], 12).turned("x", 90)]
    )


def cart_way(t: float) -> float:
    """Metres after t seconds: 2.1 a second for two seconds, then the cart rolls out."""
    late = min(max(t - 2, 0), 1)
    return 2.1 * (min(t, 2) + late - late**2 / 2)


def ball_place(t: float) -> tuple[float, float, float]:
    """The ball bounces off the sacks after 1.9 s."""
    late = max(t - 1.9, 0)
    return -1.15 - 2.6 * (t - late) + 1.3 * late, 0.14 + 0.8 * np.exp(-0.6 * late) * abs(np.sin(np.pi * (t * 1.6 + 0.1))), 0.85


def moving(m: Stage) -> None:
    radius = 0.36
    m.animate(m.group("Cart"), "translate", lambda t: (-2.9 + cart_way(t), 0, -0.15))
    planks = [box(1.5, 0.05, 0.8, 0, 0.42, 0), *(box(1.5, 0.2, 0.03, 0, 0.48, z) for z in (-0.385, 0.385))]
    planks += [box(0.03, 0.2, 0.74, x, 0.48, 0) for x in (-0.735, 0.735)]
    m.add("Cart/body", merged([*planks, *(box(0.75, 0.04, 0.05, -1.1, 0.45, z) for z in (-0.3, 0.3))]), "teal_paint")
    for k, (x, z) in enumerate(((-0.45, 0.46), (0.45, 0.46), (-0.45, -0.46), (0.45, -0.46))):
        hub = m.group(f"Cart/Wheel{k}", (x, radius, z))
        m.animate(hub, "rotateZ", lambda t: -np.degrees(cart_way(t) / radius))
        m.add(f"Cart/Wheel{k}/wood", wheel(radius), "oak")
    rng = np.random.default_rng(120)
    spots = [(-0.5 + 0.25 * i, 0.59, -0.225 + 0.225 * j) for i in range(5) for j in range(3)] + [
        (-0.37 + 0.25 * i, 0.79, -0.11 + 0.23 * j) for i in range(4) for j in range(2)
    ]
    for k, spot in enumerate(spots):
        m.add(f"Cart/melon{k}", ball(0.125, 14, 8).turned("x", 75), "melon", spot, int(rng.integers(360)))

    rolling = m.group("Ball")
    m.animate(rolling, "translate", ball_place)
    m.animate(rolling, "rotateZ", lambda t: -np.degrees((ball_place(t)[0] + 1.15) / 0.14))
    m.add("Ball/skin", ball(0.14, 24, 14), "ball")

    m.animate(m.group("Pigeon"), "translate", lambda t: (2.1 - 4.4 * t, 1.75 + 0.7 * t, 1.2 - 0.9 * t + 0.45 * max(t - 2, 0)))
    body = lathe([(0, -0.17), (0.035, -0.13), (0.07, -0.03), (0.065, 0.06), (0.035, 0.11), (0, 0.125)], 16, refine=2).turned(
        "z", 90
    )
    tail = quad((0.1, 0.0, 0.04), (0, 0, -0.08), (0.17, 0.0, 0))
    m.add("Pigeon/body", merged([body, ball(0.042, 12, 8).at(-0.14, 0.035, 0), tail]), "feather")
    for name, side in (("Left", 1), ("Right", -1)):
        wing = m.group(f"Pigeon/{name}", (0, 0.04, 0.03 * side))
        m.animate(wing, "rotateX", lambda t, side=side: side * (-10 + 55 * np.sin(2 * np.pi * 5.3 * t)))
        z, x = np.meshgrid(np.linspace(0, 0.33, 6) * side, np.linspace(-1, 1, 3))
        x = 0.01 + x * 0.075 * (1 - (np.abs(z) / 0.36) ** 2) + 0.12 * np.abs(z) / 0.33
        m.add(
            f"Pigeon/{name}/wing",
            sheet(np.stack([x, 0.02 * np.sin(9 * np.abs(z)), z], axis=-1)[::side], np.stack([x, z], axis=-1)[::side]),
            "feather",
        )

    swing = m.group("Lamp/Lantern", (0.6, 3.2, 0))
    m.animate(swing, "rotateZ", lambda t: 24 * np.sin(2 * np.pi * 0.9 * t + 0.6))
    cage = [
        tube([(0, 0, 0), (0, -0.35, 0)], 0.006),
        lathe([(0.13, -0.46), (0.03, -0.36), (0, -0.34)], 6),
        lathe([(0, -0.77), (0.09, -0.77), (0.09, -0.74), (0, -0.74)], 6),
    ]
    cage += [
        tube([(0.09 * np.sin(a), -0.75, 0.09 * np.cos(a)), (0.12 * np.sin(a), -0.46, 0.12 * np.cos(a))], 0.006, 4)
        for a in np.arange(6) * np.pi / 3
    ]
    m.add("Lamp/Lantern/cage", merged(cage), "iron")
    m.add(
        "Lamp/Lantern/flame",
        lathe([(0, -0.735), (0.05, -0.735), (0.07, -0.6), (0.045, -0.48), (0, -0.47)], 16, refine=2),
        "lantern_glass",
    )

    m.group("Carousel", (1.0, 0, -3.1))
    m.add("Carousel/stand", lathe([(0.3, 0), (0.3, 0.04), (0.05, 0.08), (0.03, 0.4), (0.025, 2.0), (0, 2.03)], 20), "iron")
    turning = m.group("Carousel/Ring", (0, 0, 0))
    m.animate(turning, "rotateY", lambda t: -170 * t)
    circle = [(0.6 * np.sin(a), 1.9, 0.6 * np.cos(a)) for a in np.linspace(0, 2 * np.pi, 33)]
    m.add(
        "Carousel/Ring/hoop",
        merged([tube(circle, 0.012), *(tube([(0, 1.95, 0), circle[4 * k]], 0.007, 4) for k in range(8))]),
        "iron",
    )
    for k in range(8):
        hung = (
            lathe(POT, 22, refine=2).at(0, 1.52, 0)
            if k % 2
            else lathe(VASES["round"], 24, refine=2).scaled(0.75, 0.75, 0.75).at(0, 1.5, 0)
        )
        hook = tube([(0, 1.6, 0), (0, 1.9, 0)], 0.004, 4)
        place = (0.6 * np.sin(k * np.pi / 4), 0, 0.6 * np.cos(k * np.pi / 4))
        m.add(
            f"Carousel/Ring/ware{k}",
            merged([hung, hook]),
            ("glaze", "copper", "celadon", "brass", "oxblood", "steel", "honey", "copper")[k],
            place,
        )

    for k, (x, y, z) in enumerate(((-2.78, 2.5, -1.35), (5.22, 2.5, -1.45))):
        mill = m.group(f"Pinwheels/Mill{k}", (x, y, z))
        m.animate(mill, "rotateZ", lambda t, k=k: (330 - 90 * k) * t * (-1) ** k)
        blades = [
            sheet(
                np.array([[(0, 0, 0), (0.15, 0.02, 0.03)], [(0.02, 0.16, 0.05), (0.16, 0.2, 0.0)]], float)[::-1],
                np.zeros((2, 2, 2)),
            ).turned("z", 60 * j)
            for j in range(6)
        ]
        m.add(f"Pinwheels/Mill{k}/red", merged(blades[::2]), "red_flag")
        m.add(f"Pinwheels/Mill{k}/gold", merged(blades[1::2]), "gold_flag")
        m.add(f"Pinwheels/stick{k}", tube([(x, 1.9, z - 0.03), (x, y, z - 0.03)], 0.008), "pine")

    m.add(
        "Blade/arm",
        merged([tube([(4.6, 3.55, -7), (4.6, 3.55, -5.9)], 0.015), tube([(4.6, 3.55, -6.25), (4.6, 3.45, -6.25)], 0.008)]),
        "iron",
    )
    m.animate(m.group("Blade/Board", (4.6, 2.9, -6.25)), "rotateY", lambda t: 230 * t)
    m.add("Blade/Board/face", box(0.75, 0.55, 0.05), "red_canvas")
