"""Wind: how the points of the shared prototypes sway, over a cycle of four seconds."""

import numpy as np

CYCLE_S = 4.0
EVERY = 4  # time codes between two samples of the points: 6 samples a second, the fastest part has 1 cycle a second

# (cycles per second, share of the reach, waves per metre): sway, gust, flutter; whole numbers of cycles in CYCLE_S
PARTS = ((0.25, 0.45, 0.25), (0.5, 0.35, 0.6), (1.0, 0.2, 2.6))
HEADING = np.array([0.86, 0.0, 0.51])


def swayed(points: np.ndarray, reach: np.ndarray, seconds: float, seed: int) -> np.ndarray:
    """Points [n, 3] at a time; reach: [n] metres that each goes to either side, at most. It leans downwind on average."""
    rng = np.random.default_rng(seed)
    along, across, lift = np.full(len(points), 0.3), np.zeros(len(points)), np.zeros(len(points))
    for rate, share, waves in PARTS:
        direction, phase = rng.normal(size=3), rng.uniform(0, 2 * np.pi, 3)
        place = points @ (direction / np.linalg.norm(direction)) * waves * 2 * np.pi
        angle = 2 * np.pi * rate * seconds
        along += share * np.sin(angle - place + phase[0])
        across += share * 0.6 * np.sin(angle - 1.3 * place + phase[1])
        lift += share * 0.5 * np.sin(angle - 0.8 * place + phase[2])
    side = np.array([HEADING[2], 0, -HEADING[0]])
    return points + reach[:, None] * (along[:, None] * HEADING + across[:, None] * side + lift[:, None] * [0, 1, 0])
