"""Line fits on the measurements of true walls: what weights and normalisation change."""

from dataclasses import replace
from typing import Any

import numpy as np

from lineament.features import Features
from lineament.scan import Array, RangeNoise
from lineament.simulation import SCENES, SENSORS

from ..evaluation.beams import MIN_BEAMS, beams_of
from ..evaluation.line_fits import FITS, Fit, LineFit
from ..evaluation.scores import Scores, evaluate
from .experiment import Experiment, Measured, Report
from .findings import Columns, Numbers, Progress, Setting, Table, each
from .scans import Frame, frames_of

#: A measurement is of the wall within so many deviations: others are mixed pixels and outliers,
#: which no fit here is made for.
_SIGMAS = 5.0
_COLUMNS: Columns = {
    "offset ÷ bound, RMS": "segment_offset_over_bound",
    "angle ÷ bound, RMS": "segment_angle_over_bound",
    "segment NEES, median": "segment_nees_median",
    "segment NEES, mean": "segment_nees",
    "corner ÷ bound, RMS": "corner_over_bound",
    "corner NEES, median": "corner_nees_median",
    "corner NEES, mean": "corner_nees",
}


def measure(setting: Setting, progress: Progress) -> Measured:
    """Fit every true wall by each fit, for each sensor."""
    numbers: dict[str, dict[str, dict[str, float]]] = {}
    for sensor in SENSORS:
        frames = frames_of(setting, SCENES, len(SCENES), sensor)
        numbers[sensor] = {
            name: Scores.total(evaluate(fitted(f, fit), f.truth) for f in frames).summary()
            for name, fit in each(FITS, progress, sensor)
        }
    return Measured(numbers)


def report(n: Numbers, _: Setting) -> Report:
    """Make a table for each sensor."""
    titles = ((f"{sensor}: fits of true walls", of) for sensor, of in n.items())
    return (_ABOUT,), (Table.of_numbers(title, of, _COLUMNS) for title, of in titles)


def fitted(frame: Frame, fit: Fit) -> Features:
    """Return the true walls as a fit has them, and their corners where they meet.

    Walls of fewer than six such measurements, see `_ABOUT`, are left out.
    """
    truth, points = frame.truth, frame.scan.points
    noise = RangeNoise() if truth.noise is None else truth.noise
    masks = beams_of(truth.segments, len(frame.scan)) & frame.scan.valid
    lines: dict[int, LineFit] = {}
    segments = truth.segments.copy()
    for k, wall in enumerate(truth.segments):
        beams = np.flatnonzero(masks[k])
        beams = np.roll(beams, -int(np.searchsorted(beams, wall["first_beam"])))
        on = points[beams[1:-1]]
        normal = np.array([-np.sin(wall["angle"]), np.cos(wall["angle"])])
        spread = np.sqrt(noise.range_variance(np.hypot(*on.T)))
        on = on[np.abs((on - wall["centroid"]) @ normal) <= _SIGMAS * spread]
        if len(on) >= MIN_BEAMS:
            lines[k] = line = fit(on, noise)
            segments[k]["centroid"], segments[k]["angle"] = line.point, line.angle
            segments[k]["covariance"] = line.covariance
    kept, corners = list(lines), []
    for corner in truth.corners:
        before, after = corner["segments"].tolist()
        if before in lines and after in lines:
            one = corner.copy()
            one["position"], one["covariance"] = meeting(lines[before], lines[after])
            one["segments"] = kept.index(before), kept.index(after)
            corners.append(one)
    found = np.array(corners, truth.corners.dtype)
    return replace(truth, segments=segments[kept], corners=found)


def meeting(before: LineFit, after: LineFit) -> tuple[Array, Array]:
    """Return where two lines meet, and the covariance that theirs give it: A⁻¹ diag(s²) A⁻ᵀ.

    Examples
    --------
    >>> sure = np.diag([1e-4, 0.0])
    >>> lines = LineFit(np.array([0, 1]), 0.0, sure), LineFit(np.array([2, 0]), 1.6, sure)
    >>> meeting(*lines)[0].round(2).tolist()
    [1.97, 1.0]
    """
    normals: Any = np.array([[-np.sin(line.angle), np.cos(line.angle)] for line in (before, after)])
    offsets = [normal @ line.point for normal, line in zip(normals, (before, after), strict=True)]
    place = np.linalg.solve(normals, offsets)
    variances = []
    for line in (before, after):
        lever = np.array([1.0, (place - line.point) @ (np.cos(line.angle), np.sin(line.angle))])
        variances.append(lever @ line.covariance @ lever)
    inverse = np.linalg.inv(normals)
    return place, inverse @ np.diag(variances) @ inverse.T


_ABOUT = (
    "Nothing is detected here: each fit is given the measurements of every true wall, within "
    f"{_SIGMAS:g} deviations of it and without the first and the last, which may be mixed, and the "
    "sensor’s noise. UTLS is total least squares without weights, its noise from the residuals; "
    "WTLS has weights 1/σ² and a² + b² + c² = 1; WCTLS is the same with a² + b² = 1, the geometric "
    "normalisation of Prieto-Fernández et al. (2026, doi 10.32604/cmes.2026.080540), written from "
    "its abstract. Its weights are not in there: ‘across the line’ has the variance of a point "
    "across the line, which incidence makes smaller than that of the range. Corners are where the "
    "fitted lines meet. NEES: 1 is right, more is overconfident."
)


EXPERIMENT = Experiment("Line fits, given the walls", measure, report)
