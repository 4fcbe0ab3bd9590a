"""Simulated logs: a drive through a building, or a scanner that stands in a scene."""

import math
import os
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from typing import Any

import numpy as np

from ..logs import save_log
from ..progress import Track, untracked
from ..scan import LaserScan
from .drive import drive, drive_poses
from .scenes import SCENES, scene
from .sensor import SENSORS, Sensor
from .worlds import building

#: What a log can be recorded in: the storey is driven through, all others are seen from one place.
WORLDS = ("building", *SCENES)


def simulate_log(
    path: str | os.PathLike[str],
    world: str,
    sensor: Sensor,
    *,
    scans: int | None = None,
    speed: float = 0.6,
    rate: float | None = None,
    seed: int = 0,
    moving: bool = False,
    track: Track = untracked,
) -> None:
    """Record a log of simulated scans, each with its stamp and true pose.

    Parameters
    ----------
    path : path-like
        The log; its ending gives the format, see `lineament.logs.save_log`.
    world : str
        "building", driven through from end to end; or a kind of `SCENES`, a random one by the
        seed, in which the scanner stands still.
    sensor : Sensor
    scans : int, optional
        Number of scans; the whole drive if None, 100 if the scanner stands.
    speed, rate, seed, moving
        As for `drive`; the seed is of the scene, too.
    track : callable
        ``track(scans, about, whole)`` yields the scans, and shows the progress.

    Raises
    ------
    ValueError
        If there is no such world, a number is out of bounds, the scanner cannot move, or the
        ending is unknown.
    LineamentError
        If the file cannot be written.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> from lineament.logs import open_log
    >>> path = pathlib.Path(tempfile.mkdtemp(), "hall.npz")
    >>> simulate_log(path, "hall", SENSORS["lms181"], scans=3, seed=5)
    >>> len(open_log(path)), len({scan.pose for scan in open_log(path)})
    (3, 1)
    """
    if world not in WORLDS:
        raise ValueError(f"world is {world!r}, expected one of {', '.join(WORLDS)}")
    if scans is not None and scans < 1:
        raise ValueError(f"scans is {scans}, expected at least 1")
    rate = sensor.rate if rate is None else rate
    if not 0 < rate < math.inf:
        raise ValueError(f"rate is {rate}, expected a finite number > 0")
    if world == "building":
        plan, way = building()
        total = len(drive_poses(way, speed=speed, rate=rate)[0])
        total = total if scans is None else min(scans, total)
        driven = drive(plan, way, sensor, speed=speed, seed=seed, rate=rate, moving=moving)
        taken: Iterator[LaserScan] = islice(driven, total)
    else:
        if moving:
            raise ValueError(f"the scanner stands in world {world!r}, moving needs the building")
        total = 100 if scans is None else scans
        plan, pose = scene(world, seed)
        rngs = (np.random.default_rng([seed, i]) for i in range(total))
        still = 0.0, 0.0, 0.0
        taken = (sensor.scan(plan, pose, rng, i / rate, still) for i, rng in enumerate(rngs))
    save_log(path, track(taken, "simulating", range(total)))


def sensor_like(name: str, *, sigma: float | None = None, **changes: float | None) -> Sensor:
    """Take a preset of `SENSORS`, and change the fields of `Sensor` that are not None.

    `sigma` is the constant part of the range noise [m]. Raises ValueError if there is no such
    preset, or a value makes no sense.

    Examples
    --------
    >>> sensor_like("lms181", sigma=0.03, dropout=None).noise
    RangeNoise(sigma=0.03, proportional=0.0, bearing=0.0, quantum=0.01, uncertainty=0.0)
    """
    if name not in SENSORS:
        raise ValueError(f"sensor is {name!r}, expected one of {', '.join(SENSORS)}")
    sensor = SENSORS[name]
    noise = sensor.noise if sigma is None else replace(sensor.noise, sigma=sigma)
    chosen: dict[str, Any] = {key: value for key, value in changes.items() if value is not None}
    return replace(sensor, noise=noise, **chosen)
