"""A room without symmetry, its plan, and what is seen of it."""

import math
from itertools import repeat

import numpy as np

from lineament import Extractor
from lineament.mapping import LineMap, Query
from lineament.mapping.drive_map import Drive
from lineament.mapping.loops import Survey
from lineament.simulation import SENSORS, World
from lineament.walls import segments_of
from lineament.walls.sights import count_of, lines_of, sights_of

#: A room without symmetry, its walls seen from inside.
RING = np.array([(-3, -2), (4, -2), (4, 1), (2, 1), (2, 3), (-1, 3), (-1, 2.4), (-3, 2.4)], float)


def plan_of(ring):
    return LineMap.from_lines(np.hstack((ring, np.roll(ring, -1, axis=0))), side=1)


def query_at(pose, plan):
    """What is seen of all walls of a plan, and beams to them from a place beside the sensor."""
    x, y, theta = pose
    c, s = math.cos(theta), math.sin(theta)
    walls = plan.walls.copy()
    for name in ("start", "end", "centroid"):
        walls[name] = (plan.walls[name] - (x, y)) @ np.array([[c, -s], [s, c]])
    walls["angle"] = plan.walls["angle"] - theta
    walls["covariance"] = np.array([[4e-6, 5e-7], [5e-7, 1e-6]])
    walls["covariance"][::2, 0, 0] *= 9
    origin, along = np.array((0.1, 0.2)), walls["end"] - walls["start"]
    ends = (walls["start"][:, None] + np.linspace(0.1, 0.9, 9)[:, None] * along[:, None]) - origin
    ends, beams = ends.reshape(-1, 2), np.zeros((ends.size // 2, 10))
    beams[:, 4] = np.linalg.norm(ends, axis=1)
    beams[:, :2], beams[:, 2:4], beams[:, 6] = origin, ends / beams[:, 4:5], 1.0
    beams[:, 5], beams[:, 7:] = 1e-4, (2e-4, 1e-4, 3e-4)
    beams[::3, 4] -= 0.05
    blocks = np.zeros((len(walls), 2, len(walls), 2))
    k = np.arange(len(walls))
    blocks[k, :, k] = walls["covariance"]
    return Query(walls, blocks.reshape(2 * len(walls), -1), beams)


def scans_on(way, world=None, turn=0.0):
    """Scans of a room, from place to place, with the poses as exact odometry."""
    world = World(np.hstack((RING, np.roll(RING, -1, axis=0))), []) if world is None else world
    for k, x in enumerate(way):
        yield SENSORS["lms361"].scan(world, (x, 0.0, turn * k), np.random.default_rng(k), 0.1 * k)


def placed(scans, odometry=None):
    """The drive that these scans are of, with the odometry of each, if there is any."""
    drive, extract = Drive(), Extractor()
    for scan, pose in zip(scans, repeat(None) if odometry is None else odometry, strict=False):
        drive.add(scan, extract(scan), pose)
    return drive


def survey_of(frames, poses, again):
    """What key frames see of all walls of the room, from `again` on under other numbers.

    Their walls are where they are from `poses`, and known to a millimetre and 1 mrad.
    """
    plan, every = plan_of(RING), np.arange(len(RING))
    seen = [segments_of(query_at(frame.scan.pose, plan).walls) for frame in frames]
    sights = sights_of([(of, every + len(RING) * (k >= again)) for k, of in enumerate(seen)])
    sights["covariance"] = np.eye(2) * 1e-6
    return Survey(frames, poses, sights, lines_of(sights, poses, count_of(sights)))
