"""The moving picture of the README: what is seen, the map of it, and where a robot is on that map.

Run: python benchmarks/moving_picture.py [-o docs/start.gif]. A storey is simulated and driven in;
its features are shown as they are found, `map` makes a map without odometry, and a robot that is
switched on anywhere finds itself on that map.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import LineCollection
from PIL import Image

import lineament as ln
from lineament.mapping.drive_map import Drive
from lineament.mapping.following import Follower
from lineament.mapping.making import DriveMap, make_map
from lineament.simulation import SENSORS, drive
from lineament.simulation.buildings import office

#: Colours that a palette of few keeps apart.
BEAM, SEEN, WALL, ROBOT, LOST = "#c8d4e0", "#d1495b", "#24292f", "#2a7f62", "#9aa4af"
SENSOR = SENSORS["utm30lx"]


def moved(points: np.ndarray, pose: tuple[float, float, float]) -> np.ndarray:
    """Return points of a sensor's frame in that of its pose."""
    x, y, theta = pose
    turn = np.array([[np.cos(theta), np.sin(theta)], [-np.sin(theta), np.cos(theta)]])
    return points @ turn + (x, y)


class Film:
    """Frames of one size, over one view of the storey."""

    def __init__(self, points: np.ndarray) -> None:
        low, high = points.min(axis=0) - 0.8, points.max(axis=0) + 0.8
        wide, high_up = high - low
        self.figure, self.axes = plt.subplots(figsize=(6.4, 6.4 * high_up / wide + 0.4), dpi=100)
        self.figure.subplots_adjust(0, 0, 1, 1 - 0.4 / self.figure.get_figheight())
        self.limits, self.frames = (low, high), []

    def begin(self, about: str) -> Any:
        """Clear the axes for the next frame."""
        axes = self.axes
        axes.clear()
        axes.set(xlim=(self.limits[0][0], self.limits[1][0]), aspect="equal")
        axes.set_ylim(self.limits[0][1], self.limits[1][1])
        axes.axis("off")
        axes.set_title(about, fontsize=11, loc="left", x=0.02, family="monospace")
        return axes

    def lines(self, starts: np.ndarray, ends: np.ndarray, colour: str, width: float) -> None:
        """Draw segments."""
        ends_of = np.stack((starts, ends), axis=1)
        self.axes.add_collection(LineCollection(list(ends_of), colors=colour, linewidths=width))

    def robot(self, pose: tuple[float, float, float], colour: str = ROBOT) -> None:
        """Draw a robot as a triangle."""
        shape = np.array([(0.5, 0.0), (-0.3, 0.3), (-0.3, -0.3)])
        self.axes.fill(*moved(shape, pose).T, color=colour, zorder=5)

    def take(self, times: int = 1) -> None:
        """Take the frame, which stays for so many."""
        self.figure.canvas.draw()
        picture = Image.fromarray(np.asarray(self.figure.canvas.buffer_rgba())[..., :3])
        self.frames += [picture.quantize(16, dither=Image.Dither.NONE)] * times

    def save(self, path: Path, milliseconds: int) -> None:
        """Write a GIF that goes on and on."""
        first, *others = self.frames
        first.save(
            path, save_all=True, append_images=others, duration=milliseconds, loop=0, optimize=True
        )


def view(film: Film, made: DriveMap, scans: list[ln.LaserScan]) -> None:
    """Show scans and what is found in them, along the way that the map found."""
    extract = ln.Extractor()
    for scan, pose in islice(zip(scans, made.poses, strict=True), 0, 320, 16):
        film.begin("$ lineament view LOG")
        features = extract(scan)
        points = moved(scan.points[scan.valid], pose)
        film.axes.plot(*points.T, ".", color=BEAM, markersize=2)
        segments = features.segments
        film.lines(moved(segments["start"], pose), moved(segments["end"], pose), SEEN, 2.0)
        film.axes.plot(*moved(features.corners["position"], pose).T, "o", color=SEEN, markersize=4)
        film.robot(pose)
        film.take()


def mapped(film: Film, made: DriveMap) -> None:
    """Show the map as it grows: of each wall, once it was seen."""
    seen = made.survey.sights
    walls = made.map.walls
    ids = range(len(walls))
    first = np.array([seen["frame"][seen["wall"] == k].min(initial=10**6) for k in ids])
    for k in np.linspace(0, len(made.survey.poses) - 1, 24).astype(int):
        film.begin("$ lineament map LOG -o plan.dxf")
        shown = walls[first <= k]
        film.lines(shown["start"], shown["end"], WALL, 1.6)
        film.axes.plot(*np.array(made.survey.poses)[: k + 1, :2].T, color=BEAM, linewidth=1.0)
        film.robot(tuple(made.survey.poses[k]))
        film.take()
    film.take(6)


def located(film: Film, made: DriveMap, scans: list[ln.LaserScan]) -> None:
    """Show a robot that is switched on in the middle of the drive, and finds itself."""
    follower, extract = Follower(made.map), ln.Extractor()
    start = len(scans) // 2
    for k, scan in enumerate(scans[start : start + 160]):
        where = follower(extract(scan))
        if k % 8:
            continue
        axes = film.begin("$ lineament locate LOG --map plan.dxf -o poses.tum")
        walls = made.map.walls
        film.lines(walls["start"], walls["end"], WALL if where else LOST, 1.6)
        if where:
            film.axes.plot(*moved(scan.points[scan.valid], where.pose).T, ".", color=SEEN, ms=2)
            film.robot(where.pose)
        axes.text(
            *(0.02, 0.02), where.verdict, transform=axes.transAxes, fontsize=13,
            color=ROBOT if where else SEEN,
        )  # fmt: skip
        film.take()
    film.take(6)


def main() -> None:
    """Simulate, map, and film."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path, default=Path("docs/start.gif"))
    output = parser.parse_args().output
    storey = office(3, (24.0, 16.0))
    way: Iterator[ln.LaserScan] = drive(storey.world, storey.waypoints, SENSOR, seed=1, rate=5)
    scans, followed, extract = list(way), Drive(), ln.Extractor()
    for scan in scans:
        followed.add(scan, extract(scan), None)
    made = make_map(followed.frames, followed.scans)
    walls = made.map.walls
    film = Film(np.concatenate((walls["start"], walls["end"])))
    view(film, made, scans)
    mapped(film, made)
    located(film, made, scans)
    film.save(output, 160)
    print(f"{output}: {len(film.frames)} frames, {output.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
