"""Scanners of several kinds, by name."""

import math

from ..scan import RangeNoise
from .sensor import Sensor

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
