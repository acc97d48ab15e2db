"""The figures of the cast as nodes, skins and animation, and the names above some of them."""

import json
from functools import cache

import numpy as np
from scenes.making.gltf_stage import GltfStage
from scenes.making.gltf_values import quaternion

from . import gait, head
from .body import bare_legs, top, trousers
from .cast import CAST, CUTS, LEGS, Person
from .cloth import Piece
from .skeleton import BUILDS, NAMES, PARENT, joint_from_bind, joints_of
from .things import ARMS, THINGS

SECONDS = 8.0
SEAT = 0.47


@cache
def poses_of(build: str, how: str, seed: int) -> tuple[float, list[dict]]:
    """(seconds between poses, poses of one period)."""
    places, h = joints_of(BUILDS[build]), BUILDS[build].height
    if how in gait.GAITS:
        return gait.GAITS[how].period / gait.KEYS, gait.walk(gait.GAITS[how], places, h)
    times = np.arange(16) / 4
    if how == "sit":
        return 0.25, [gait.sit(places, h, t, SEAT, seed) for t in times]
    return 0.25, [gait.stand(places, h, t, seed, 1.0 if how == "talk" else 0.0) for t in times]


def speed(person: Person) -> float:
    """Metres a second, by which no foot slides."""
    if person.how not in gait.GAITS:
        return 0.0
    walk = gait.GAITS[person.how]
    return walk.stride * BUILDS[person.build].height * person.size / walk.period


def heading(person: Person) -> np.ndarray:
    """Unit vector [2] in x and z."""
    way = np.subtract(person.to, person.start)
    return way / np.linalg.norm(way)


@cache
def part(kind: str, build: str, cut: str, seed: int = 0) -> Piece:
    body = BUILDS[build]
    if kind == "top":
        return top(body, CUTS[cut], seed)
    if kind == "legs" and cut == "tights":
        return bare_legs(body)
    if kind == "legs":
        return trousers(body, seed=seed, **LEGS[cut])
    if kind == "hair":
        return head.hair(body, cut, seed)
    if kind == "thing":
        name, of = cut.split("/")
        return THINGS[name](body, CUTS[of])
    if kind == "shoes":
        return head.shoes(body, 0.3 if cut == "boots" else 0.1)
    return {"head": head.head, "bare": bare_legs}[kind](body) if kind != "hands" else head.hands(body, CUTS[cut].sleeve)


def wearing(person: Person) -> list[tuple[str, Piece, str]]:
    """(name, piece, material) of all that somebody is made of."""
    cut, legs = person.top[0], person.legs[0]
    found = [
        ("head", part("head", person.build, ""), f"skin_{person.skin}"),
        ("hands", part("hands", person.build, cut), f"skin_{person.skin}"),
        ("hair", part("hair", person.build, person.hair[0]), f"hair_{person.hair[1]}"),
        ("top", part("top", person.build, cut), person.top[1]),
        ("legs", part("legs", person.build, legs), person.legs[1]),
        ("shoes", part("shoes", person.build, "boots" if person.boots else ""), person.shoes),
    ]
    if legs == "shorts":
        found.append(("calves", part("bare", person.build, ""), f"skin_{person.skin}"))
    return found + [(thing, part("thing", person.build, f"{thing}/{cut}"), look) for thing, look in person.things]


def arms_of(person: Person) -> dict:
    found = {}
    for name in [person.how, *(thing for thing, _ in person.things)]:
        found |= ARMS.get(name, {})
    return found


def figure(m: GltfStage, number: int, person: Person) -> None:
    """Nodes, skin, parts and animation of one person. The node that walks is a joint, so that the skin's root is it."""
    build, name = BUILDS[person.build], f"Crowd/{person.name}"
    places, way = joints_of(build), heading(person)
    start = np.array([person.start[0], 0, person.start[1]])
    root = m.group(name, tuple(start), float(np.degrees(np.arctan2(way[0], way[1]))), person.size)
    nodes = {"ground": root}
    for joint in NAMES[1:]:
        nodes[joint] = m.group(f"{name}/{joint}", places[joint] - places[PARENT[joint]], parent=nodes[PARENT[joint]])
    skin = m.skin([nodes[joint] for joint in NAMES], joint_from_bind(places))
    for label, piece, look in wearing(person):
        m.add_skinned(f"{name}/{label}", piece.shape, piece.skinning, piece.colors, look, skin, root)
    step, poses = poses_of(person.build, person.how, person.phase if person.how not in gait.GAITS else 0)
    count = int(np.ceil(SECONDS / step)) + 1
    times = np.arange(count) * step
    first = person.phase if person.how in gait.GAITS else 0
    order = np.arange(count + len(poses)) % len(poses)
    arms = arms_of(person)
    for joint in NAMES[1:]:
        turns = quaternion(np.array([(pose | arms).get(joint, np.eye(3)) for pose in poses]))
        turns *= np.sign(turns[:, 3:] + 1e-12)
        if np.abs(turns - turns[0]).max() < 1e-4:
            m.put(nodes[joint], rotation=turns[0])
        else:
            m.animate(nodes[joint], "rotation", times, turns[order], first)
    m.animate(nodes["hips"], "translation", times, np.array([pose["hips_at"] for pose in poses])[order], first)
    if person.how in gait.GAITS:
        end = start + np.array([way[0], 0, way[1]]) * speed(person) * times[-1]
        m.animate(root, "translation", times[[0, -1]], np.stack([start, end]))


def tag(person: Person) -> dict:
    """The overlay's element above somebody's head; it hangs at the origin of the top's space, its joint of most weight."""
    build = BUILDS[person.build]
    joints, weights = part("top", person.build, person.top[0]).skinning
    anchor = NAMES[int(np.bincount(joints.ravel(), weights.ravel()).argmax())]
    places = joints_of(build)
    above = places["head"][1] + (0.34 + 0.1 * any(t in ("hat", "beanie") for t, _ in person.things)) * build.head * build.height
    above += 0.46 * any(t == "umbrella" for t, _ in person.things)
    return {
        "text": person.tag,
        "object": f"Crowd/{person.name}/top",
        "offset": [0, round(float(above - places[anchor][1]), 4), round(float(-places[anchor][2]), 4)],
        "align": "bottom",
        "world_height": 0.15,
        "color": "#ffffff",
        "background": {"color": "#10202c", "opacity": 0.62, "padding": 0.28},
    }


def overlay() -> dict:
    """Names above some heads, and what a game would show."""
    names = [tag(person) for person in CAST if person.tag]
    box = {"color": "#10202c", "opacity": 0.62, "padding": 0.45}
    screen = [
        {
            "text": "CENTRAL STATION\nForecourt   08:14",
            "screen": [0.022, 0.035],
            "align": "left top",
            "size": 0.042,
            "background": box,
        },
        {
            "text": "Find Theo   2 / 5",
            "screen": [0.978, 0.965],
            "align": "right bottom",
            "size": 0.05,
            "color": "#ffd68a",
            "outline": {"width": 0.05},
        },
    ]
    return {"version": 1, "elements": names + screen}


def write(m: GltfStage) -> None:
    for number, person in enumerate(CAST):
        figure(m, number, person)
    text = json.dumps(overlay(), indent=1)
    (m.folder / f"{m.name}.overlay.json").write_text(text + "\n")


def closest(seconds: float = 4.0) -> list[tuple[float, str, str]]:
    """Pairs who come nearer than 0.75 m to each other, for the scene's author: distance in metres and names."""
    times = np.linspace(0, seconds, 49)[:, None]
    ways = {p.name: np.array(p.start) + heading(p) * speed(p) * times for p in CAST}
    names = list(ways)
    pairs = [
        (float(np.linalg.norm(ways[a] - ways[b], axis=1).min()), a, b) for k, a in enumerate(names) for b in names[k + 1 :]
    ]
    return sorted(pair for pair in pairs if pair[0] < 0.75)
