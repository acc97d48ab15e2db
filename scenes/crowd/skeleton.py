"""The skeleton that all figures share, in the proportions of each build. Figures stand on y = 0, face +z, their left is +x."""

from dataclasses import dataclass

import numpy as np

NAMES = (
    "ground", "hips", "spine", "chest", "neck", "head", "tail",
    "arm_l", "forearm_l", "hand_l", "arm_r", "forearm_r", "hand_r",
    "thigh_l", "shin_l", "foot_l", "toe_l", "thigh_r", "shin_r", "foot_r", "toe_r",
)  # fmt: skip
PARENT = dict(
    hips="ground", spine="hips", chest="spine", neck="chest", head="neck", tail="hips",
    arm_l="chest", forearm_l="arm_l", hand_l="forearm_l", arm_r="chest", forearm_r="arm_r", hand_r="forearm_r",
    thigh_l="hips", shin_l="thigh_l", foot_l="shin_l", toe_l="foot_l",
    thigh_r="hips", shin_r="thigh_r", foot_r="shin_r", toe_r="foot_r",
)  # fmt: skip
INDEX = {name: number for number, name in enumerate(NAMES)}
ARM_ANGLE = 35.0  # degrees between the arms of the bind pose and the body


@dataclass(frozen=True)
class Build:
    """What one body differs by from an adult of 1.75 m: factors. bust: metres that the chest comes forward; belly: the same
    lower down."""

    height: float = 1.0
    shoulders: float = 1.0
    hips: float = 1.0
    waist: float = 1.0
    depth: float = 1.0
    limbs: float = 1.0
    head: float = 1.0
    bust: float = 0.0
    belly: float = 0.0


BUILDS = {
    "man": Build(1.01, 1.05, 0.95, 0.98, 1.0, 1.02),
    "woman": Build(0.95, 0.89, 1.02, 0.86, 0.93, 0.88, 0.97, bust=0.026),
    "broad": Build(1.02, 1.1, 1.06, 1.18, 1.16, 1.12, 1.0, belly=0.05),
    "lean": Build(1.06, 0.98, 0.9, 0.88, 0.92, 0.92, 0.97),
    "elder": Build(0.92, 0.94, 1.05, 1.06, 1.06, 0.95, 0.99, bust=0.012, belly=0.025),
    "child": Build(0.68, 0.86, 0.92, 1.0, 1.0, 0.95, 1.28),
}


def joints_of(build: Build) -> dict[str, np.ndarray]:
    """Places of the joints in the bind pose."""
    h, s, w = build.height, build.shoulders * build.height, build.hips * build.height
    direction = np.array([np.sin(np.radians(ARM_ANGLE)), -np.cos(np.radians(ARM_ANGLE)), 0])
    places = {
        "ground": (0, 0, 0),
        "hips": (0, 0.955 * h, 0),
        "spine": (0, 1.07 * h, -0.005 * h),
        "chest": (0, 1.22 * h, -0.012 * h),
        "neck": (0, 1.47 * h, -0.02 * h),
        "head": (0, 1.545 * h, -0.004 * h),
        "tail": (0, 0.97 * h, -0.07 * h),
        "arm_l": (0.178 * s, 1.41 * h, -0.015 * h),
        "thigh_l": (0.088 * w, 0.925 * h, 0),
        "shin_l": (0.088 * w, 0.5 * h, 0.012 * h),
        "foot_l": (0.088 * w, 0.085 * h, -0.018 * h),
        "toe_l": (0.094 * w, 0.022 * h, 0.105 * h),
    }
    places = {name: np.array(place, float) for name, place in places.items()}
    places["forearm_l"] = places["arm_l"] + 0.29 * h * direction
    places["hand_l"] = places["forearm_l"] + 0.245 * h * direction + [0, 0, 0.012 * h]
    for name in [key for key in places if key.endswith("_l")]:
        places[name[:-1] + "r"] = places[name] * [-1, 1, 1]
    return places


def joint_from_bind(places: dict[str, np.ndarray]) -> np.ndarray:
    """[joints, 4, 4]: the bind pose turns no joint."""
    matrices = np.tile(np.eye(4), (len(NAMES), 1, 1))
    matrices[:, :3, 3] = [-places[name] for name in NAMES]
    return matrices


def heaviest_first(weights: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Joints [V, 4] and weights [V, 4], the four greatest, of sum 1."""
    dense = np.zeros((len(next(iter(weights.values()))), len(NAMES)))
    for name, values in weights.items():
        dense[:, INDEX[name]] += np.clip(values, 0, None)
    order = np.argsort(-dense, axis=1, kind="stable")[:, :4]
    chosen = np.take_along_axis(dense, order, axis=1)
    chosen = np.where(chosen > 0.01 * chosen.sum(axis=1, keepdims=True), chosen, 0)
    return np.where(chosen > 0, order, 0), chosen / chosen.sum(axis=1, keepdims=True)
