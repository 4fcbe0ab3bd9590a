"""Which reading of the corner response reproduces Figure 9 of the paper? Run: make figures.

Average repetition AR = ½ (N_r/N_o + N_r/N_t) of corners between a view and views turned by parts
of a beam with fresh noise, against the threshold and against the support radius, for each reading
of equation 22; and precision, recall and F1 of corners within 0.1 m, for the choice of thresholds.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

import lineament as ln
from lineament.simulation import SENSORS, Sensor, World, building, drive_poses, room

NEAR = 0.1  # two corners are one [m]
THRESHOLDS = (0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.5, 0.6, 0.66, 0.7, 0.8, 1.0, 1.5)
RADII = (3, 4, 5, 6, 7, 8, 10, 12)
READINGS = ("tangent", "product", "relative")
Pose = tuple[float, float, float]


def matched(a: np.ndarray, b: np.ndarray) -> int:
    """Pairs of mutually nearest points that are near."""
    if not len(a) or not len(b):
        return 0
    distance = np.hypot(*(a[:, None] - b[None]).transpose(2, 0, 1))
    nearest = distance.argmin(axis=1)
    mutual = distance.argmin(axis=0)[nearest] == np.arange(len(a))
    return int((mutual & (distance.min(axis=1) < NEAR)).sum())


def turned_views(world: World, poses: list[Pose], sensor: Sensor) -> list[list[ln.LaserScan]]:
    """Of each pose four scans, turned by quarters of a beam, with fresh noise."""
    rng = np.random.default_rng(9)
    step = sensor.angle_increment / 4
    return [
        [sensor.scan(world, (x, y, theta + k * step), rng) for k in range(4)]
        for x, y, theta in poses
    ]


def average_repetition(views: list[list[ln.LaserScan]], step: float, **parameters: object) -> float:
    extractor = ln.Extractor("liu:paper", **parameters)
    rates = []
    for first, *others in views:
        original = extractor(first).corners["position"]
        for k, scan in enumerate(others, 1):
            target = extractor(scan).transform(0, 0, k * step / 4).corners["position"]
            repeated = matched(original, target)
            if len(original) or len(target):
                shares = [repeated / len(c) if len(c) else 0.0 for c in (original, target)]
                rates.append(sum(shares) / 2)
            else:
                rates.append(0.0)
    return float(np.mean(rates))


def visible_corners(world: World, sensor: Sensor, pose: Pose) -> np.ndarray:
    """Vertices between two walls that both show six beams or more, in the sensor's frame."""
    _, surface = sensor.ideal(world, pose)
    x, y, theta = pose
    to_sensor = np.array([[np.cos(theta), np.sin(theta)], [-np.sin(theta), np.cos(theta)]])
    beams = np.bincount(surface[surface >= 0], minlength=world.n_surfaces)
    corners = []
    for a, b in pairwise(surface):
        if a != b and min(a, b) >= 0 and max(a, b) < len(world.segments):
            ends = world.segments[[a, b]].reshape(2, 2, 2)
            gaps = np.hypot(*(ends[0][:, None] - ends[1][None]).transpose(2, 0, 1))
            if gaps.min() < 1e-6 and min(beams[a], beams[b]) >= 6:
                corners.append(to_sensor @ (ends[0][gaps.min(axis=1).argmin()] - [x, y]))
    return np.array(corners).reshape(-1, 2)


def scores(world: World, poses: list[Pose], sensor: Sensor, **parameters: object) -> str:
    extractor, rng = ln.Extractor("liu", **parameters), np.random.default_rng(5)
    hits = real = found = 0
    for pose in poses:
        truth = visible_corners(world, sensor, pose)
        corners = extractor(sensor.scan(world, pose, rng)).corners["position"]
        hits += matched(truth, corners)
        real, found = real + len(truth), found + len(corners)
    precision, recall = hits / max(found, 1), hits / max(real, 1)
    f1 = 2 * precision * recall / max(precision + recall, 1e-9)
    return f"{precision:.2f} / {recall:.2f} / {f1:.2f}"


def main() -> None:
    sensor = SENSORS["paper"]
    rng = np.random.default_rng(3)
    in_room = [
        (float(x), float(y), float(theta))
        for x, y, theta in rng.uniform((-2.5, -1.5, -np.pi), (-0.5, 1.5, np.pi), (24, 3))
    ]
    plan, waypoints = building()
    on_the_way = [tuple(map(float, pose)) for pose in drive_poses(waypoints, rate=0.3)[1]]
    worlds = {"room": (room(), in_room), "building": (plan, on_the_way)}
    for name, (world, poses) in worlds.items():
        views = turned_views(world, poses, sensor)
        step = sensor.angle_increment
        print(f"\nAR in the {name}, radius 6, against the threshold\n")
        print("| threshold | " + " | ".join(READINGS) + " |\n|---|---|---|---|")
        for threshold in THRESHOLDS:
            cells = (
                average_repetition(views, step, response=reading, threshold=threshold)
                for reading in READINGS
            )
            print(f"| {threshold} | " + " | ".join(f"{cell:.2f}" for cell in cells) + " |")
        print(f"\nAR in the {name}, threshold 0.66, against the support radius\n")
        print("| radius | " + " | ".join(READINGS) + " |\n|---|---|---|---|")
        for radius in RADII:
            cells = (
                average_repetition(views, step, response=reading, support_radius=radius)
                for reading in READINGS
            )
            print(f"| {radius} | " + " | ".join(f"{cell:.2f}" for cell in cells) + " |")
    for half, sensors in (("tuned", ("paper", "lms361")), ("reported", ("utm30lx",))):
        poses = on_the_way[::2] if half == "tuned" else on_the_way[1::2]
        for name in sensors:
            print(f"\nCorners within 0.1 m, building, {name} ({half}): precision / recall / F1\n")
            print("| threshold | " + " | ".join(READINGS) + " |\n|---|---|---|---|")
            for threshold in THRESHOLDS:
                cells = (
                    scores(plan, poses, SENSORS[name], response=reading, threshold=threshold)
                    for reading in READINGS
                )
                print(f"| {threshold} | " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main()
