"""Scanners: their beams, their motion, and what stands between a true range and a measurement."""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..scan import Array, LaserScan, Pose, RangeNoise
from ..scan.poses import Twist, poses_along
from .raycast import cast_rays
from .worlds import World

#: Share of the beams across an occlusion edge that blend both depths.
_BLEND_SHARE = 0.5
#: Least step in depth of an occlusion edge: in metres, and in widths of the footprint. Smaller
#: ones are corners and walls at grazing incidence, whose depth has no gap.
_EDGE_STEP = 0.05
_EDGE_WIDTHS = 5.0


@dataclass(frozen=True, slots=True)
class Sensor:
    """A 2-D laser scanner.

    Parameters
    ----------
    name : str
    n_beams : int
    angle_min, angle_increment : float
        Bearing of the first beam and step between beams [rad], counter-clockwise.
    range_min, range_max : float
        Limits of ranges that are reported [m]: ``range_min <= r < range_max``.
    noise : RangeNoise or float
        Noise of a measurement, or its sigma [m]; all four parts are applied.
    dropout : float
        Probability that a beam returns nothing.
    outlier : float
        Probability of a false return, uniform between `range_min` and the true range.
    mixed_pixel : float
        Divergence of the beam, full width [rad]. If its two edges meet different surfaces with
        a step in depth between, half of the measurements are a blend of both depths.
    rate : float
        Scans a second [Hz], and turns of its mirror: a beam follows the other by `time_increment`.

    Raises
    ------
    ValueError
        If a field makes no sense. The message names it and its value.

    Examples
    --------
    >>> from lineament.simulation import SENSORS, room
    >>> SENSORS["paper"].scan(room(), (0.0, 0.0, 0.0), np.random.default_rng(7))
    LaserScan(481 beams, 481 valid, -80.0° + i·0.3333°, stamp=0.000)
    """

    name: str
    n_beams: int
    angle_min: float
    angle_increment: float
    range_min: float = 0.0
    range_max: float = math.inf
    noise: RangeNoise = field(default_factory=RangeNoise)
    dropout: float = 0.0
    outlier: float = 0.0
    mixed_pixel: float = 0.0
    rate: float = 10.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "noise", RangeNoise.of(self.noise))
        last = self.angle_min + (self.n_beams - 1) * self.angle_increment
        requirements = (
            ("n_beams", self.n_beams >= 1, "at least 1"),
            ("angle_min", math.isfinite(self.angle_min), "a finite bearing"),
            ("angle_increment", self.angle_increment > 0, "more than 0"),
            ("n_beams", last - self.angle_min < 2 * math.pi, "less than once around"),
            ("range_min", 0 <= self.range_min < math.inf, "finite and ≥ 0"),
            ("range_max", self.range_max > self.range_min, "more than range_min"),
            ("dropout", 0 <= self.dropout <= 1, "a probability"),
            ("outlier", 0 <= self.outlier <= 1, "a probability"),
            ("mixed_pixel", 0 <= self.mixed_pixel < math.pi, "a width of 0 … π"),
            ("rate", 0 < self.rate < math.inf, "finite and more than 0"),
        )
        for name, holds, expected in requirements:
            if not holds:
                raise ValueError(f"Sensor.{name} is {getattr(self, name)}, expected {expected}")

    @property
    def angles(self) -> Array:
        """Bearings of the beams in the sensor frame [rad], shape (n,)."""
        return self.angle_min + self.angle_increment * np.arange(self.n_beams, dtype=np.float64)

    @property
    def time_increment(self) -> float:
        """Time from a beam to the next [s]: a full turn takes 1/`rate`."""
        return self.angle_increment / (2 * math.pi * self.rate)

    def sweep(self, pose: Pose, twist: Twist) -> Array:
        """Return the pose of each beam of a sensor that moves, shape (n, 3), as `poses_along`.

        The pose is that of the first beam, in the world frame [m, m, rad], the twist the constant
        velocity forward and to the left [m/s], and the turn rate [rad/s].
        """
        x, y, theta = pose
        dx, dy, turn = poses_along(twist, self.time_increment * np.arange(self.n_beams)).T
        c, s = math.cos(theta), math.sin(theta)
        return np.column_stack((x + c * dx - s * dy, y + s * dx + c * dy, theta + turn))

    def ideal(self, world: World, pose: Pose) -> tuple[Array, NDArray[np.int32]]:
        """Return true ranges and surfaces as `cast_rays`, without limits or noise."""
        return cast_rays(world, pose, self.angles)

    def scan(
        self,
        world: World,
        pose: Pose,
        rng: np.random.Generator,
        stamp: float = 0.0,
        twist: Twist | None = None,
    ) -> LaserScan:
        """Simulate one sweep, or all beams at once.

        In order: each beam leaves with an error of bearing; it may blend two depths; it may be
        cut short; noise is added; the range is rounded to the lattice; it may be lost. As many
        random numbers are drawn whatever the world and the settings, so that two sensors can be
        compared on the same draws.

        Parameters
        ----------
        world : World
        pose : (x, y, theta)
            Pose of the sensor in the world frame [m, m, rad]; becomes the scan's.
        rng : numpy.random.Generator
        stamp : float
            Time of the first beam [s].
        twist : (v_x, v_y, omega), optional
            Velocity of the sensor in its own frame [m/s, m/s, rad/s]; see `sweep`. None: all beams
            are taken at the stamp, and `scan_time` and `time_increment` are 0, so that nobody
            removes a motion that did not take place.

        Returns
        -------
        LaserScan
            With the bearings as the sensor believes them; inf if nothing returned, or from beyond
            the limits.
        """
        normal = rng.standard_normal((2, self.n_beams))
        uniform = rng.random((5, self.n_beams))
        poses = self.sweep(pose, twist) if twist and any(twist) else np.array([pose])
        ranges = self._footprint(world, poses, self.noise.bearing * normal[0], uniform[:2])
        ranges = self._cut_short(ranges, uniform[2:4])
        ranges = self._measure(ranges, normal[1])
        lost = (ranges < self.range_min) | (ranges >= self.range_max)
        ranges[lost | (uniform[4] < self.dropout)] = np.inf
        return LaserScan(
            ranges,
            self.angle_min,
            self.angle_increment,
            range_min=self.range_min,
            range_max=self.range_max,
            stamp=stamp,
            scan_time=0.0 if twist is None else 1.0 / self.rate,
            time_increment=0.0 if twist is None else self.time_increment,
            frame_id="laser",
            pose=pose,
        )

    def _footprint(self, world: World, poses: Array, error: Array, uniform: Array) -> Array:
        """Ranges along the beams' axes, blended where a footprint spans two depths."""
        axis = self.angles + error
        ranges, _ = cast_rays(world, poses, axis)
        if self.mixed_pixel == 0:
            return ranges
        half = self.mixed_pixel / 2
        right, surface_right = cast_rays(world, poses, axis - half)
        left, surface_left = cast_rays(world, poses, axis + half)
        near, far = np.minimum(right, left), np.maximum(right, left)
        step = np.maximum(_EDGE_STEP, _EDGE_WIDTHS * self.mixed_pixel * near)
        # Light that does not come back in time cannot blend.
        edge = (surface_right != surface_left) & (far > near + step) & (far < self.range_max)
        blends = edge & (uniform[0] < _BLEND_SHARE)
        ranges[blends] = near[blends] + uniform[1, blends] * (far[blends] - near[blends])
        return ranges

    def _cut_short(self, ranges: Array, uniform: Array) -> Array:
        """Replace some ranges by false returns on the way."""
        # The way of a beam that meets nothing ends where the scanner stops listening.
        end = np.minimum(ranges, self.range_max)
        cut = (uniform[0] < self.outlier) & (end > self.range_min) & (end < math.inf)
        short = ranges.copy()
        short[cut] = self.range_min + uniform[1, cut] * (end[cut] - self.range_min)
        return short

    def _measure(self, ranges: Array, normal: Array) -> Array:
        """Add the noise of the range, then round to the lattice."""
        finite = np.isfinite(ranges)
        distance = np.where(finite, ranges, 0.0)
        deviation = np.hypot(self.noise.sigma, self.noise.proportional * distance)
        measured = distance + deviation * normal
        if self.noise.quantum > 0:
            measured = np.round(measured / self.noise.quantum) * self.noise.quantum
        return np.where(finite, measured, np.inf)


_TIME_OF_FLIGHT = RangeNoise(0.01, quantum=0.001)
_CENTIMETRES = RangeNoise(0.01, quantum=0.01)
_TRIANGULATION = RangeNoise(0.002, proportional=0.007, quantum=0.00025)

#: Beams, first bearing and step [degrees], limits, noise, rate; divergence, dropout, outlier.
_PRESETS = {
    # The experiments of Liu et al. 2023: range noise alone.
    "paper": (481, -80.0, 160 / 480, 0.0, 30.0, RangeNoise(0.01), 10.0, 0.0, 0.0, 0.0),
    # The same beams, three times the noise, and lost returns.
    "noisy": (481, -80.0, 160 / 480, 0.0, 30.0, RangeNoise(0.03), 10.0, 0.0, 0.02, 0.0),
    # Hokuyo UTM-30LX: 270°.
    "utm30lx": (1081, -135.0, 0.25, 0.1, 30.0, _TIME_OF_FLIGHT, 40.0, 0.004, 0.002, 0.0005),
    # SICK LMS 200 class: 180° in steps of 0.5° or 1°, a wide beam.
    "lms361": (361, -90.0, 0.5, 0.0, 80.0, _CENTIMETRES, 37.5, 0.0044, 0.001, 0.0002),
    "lms181": (181, -90.0, 1.0, 0.0, 80.0, _CENTIMETRES, 75.0, 0.0044, 0.001, 0.0002),
    # Slamtec RPLIDAR class: a full turn.
    "rplidar": (720, -180.0, 0.5, 0.15, 12.0, _TRIANGULATION, 10.0, 0.003, 0.02, 0.002),
    # LDROBOT LD19: a full turn, few beams.
    "ld19": (455, -180.0, 360 / 455, 0.02, 12.0, _TIME_OF_FLIGHT, 10.0, 0.006, 0.01, 0.001),
}

#: Scanners of several kinds, by name. Beams and limits are the data sheets'; divergence, drop-outs
#: and false returns are of the size that such scanners show indoors.
SENSORS: dict[str, Sensor] = {
    name: Sensor(
        name, n, math.radians(first), math.radians(step), low, high, noise,
        dropout=lost, outlier=false, mixed_pixel=divergence, rate=rate,
    )
    for name, (n, first, step, low, high, noise, rate, divergence, lost, false) in _PRESETS.items()
}  # fmt: skip
