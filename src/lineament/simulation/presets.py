"""Scanners of several kinds, by name."""

import math
from typing import Any

from ..scan import RangeNoise
from .sensor import Sensor


def _preset(
    name: str,
    n_beams: int,
    first_degrees: float,
    step_degrees: float,
    range_min: float,
    range_max: float,
    **others: Any,
) -> Sensor:
    first, step = math.radians(first_degrees), math.radians(step_degrees)
    return Sensor(name, n_beams, first, step, range_min, range_max, **others)


_PRESETS = (
    # The experiments of Liu et al. 2023: range noise alone.
    _preset("paper", 481, -80.0, 160.0 / 480, 0.0, 30.0, noise=RangeNoise(sigma=0.01), rate=10.0),
    # The same beams, three times the noise, and lost returns.
    _preset(
        "noisy", 481, -80.0, 160.0 / 480, 0.0, 30.0,
        noise=RangeNoise(sigma=0.03), rate=10.0, dropout=0.02,
    ),
    # Hokuyo UTM-30LX: 270°, time of flight.
    _preset(
        "utm30lx", 1081, -135.0, 0.25, 0.1, 30.0,
        noise=RangeNoise(sigma=0.01, quantum=0.001), rate=40.0,
        mixed_pixel=0.004, dropout=0.002, outlier=0.0005,
    ),
    # SICK LMS 200 class: 180° in steps of 0.5° or 1°, a wide beam, readings in centimetres.
    _preset(
        "lms361", 361, -90.0, 0.5, 0.0, 80.0,
        noise=RangeNoise(sigma=0.01, quantum=0.01), rate=37.5,
        mixed_pixel=0.0044, dropout=0.001, outlier=0.0002,
    ),
    _preset(
        "lms181", 181, -90.0, 1.0, 0.0, 80.0,
        noise=RangeNoise(sigma=0.01, quantum=0.01), rate=75.0,
        mixed_pixel=0.0044, dropout=0.001, outlier=0.0002,
    ),
    # Slamtec RPLIDAR class: a full turn by triangulation, noise in proportion to the range.
    _preset(
        "rplidar", 720, -180.0, 0.5, 0.15, 12.0,
        noise=RangeNoise(sigma=0.002, proportional=0.007, quantum=0.00025), rate=10.0,
        mixed_pixel=0.003, dropout=0.02, outlier=0.002,
    ),
    # LDROBOT LD19: a full turn, time of flight, few beams.
    _preset(
        "ld19", 455, -180.0, 360.0 / 455, 0.02, 12.0,
        noise=RangeNoise(sigma=0.01, quantum=0.001), rate=10.0,
        mixed_pixel=0.006, dropout=0.01, outlier=0.001,
    ),
)  # fmt: skip

#: Scanners of several kinds, by name. Beams and limits are the data sheets'; divergence, drop-outs
#: and false returns are of the size that such scanners show indoors.
SENSORS: dict[str, Sensor] = {sensor.name: sensor for sensor in _PRESETS}
