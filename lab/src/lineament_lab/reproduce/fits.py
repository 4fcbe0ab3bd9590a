"""Line fits on the measurements of true walls: what weights and normalisation change."""

from lineament.simulation import SCENES, SENSORS

from ..evaluation.line_fits import FITS, SIGMAS, fit_walls
from ..evaluation.scores import Scores, evaluate
from .experiment import Experiment, Measured, Report
from .findings import Columns, Numbers, Progress, Setting, Table, each
from .prose import prose
from .scans import frames_of

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
            name: Scores.total(
                evaluate(fit_walls(f.scan, f.truth, fit), f.truth) for f in frames
            ).summary()
            for name, fit in each(FITS, progress, sensor)
        }
    return Measured(numbers)


def report(n: Numbers, _: Setting) -> Report:
    """Make a table for each sensor."""
    titles = ((f"{sensor}: fits of true walls", of) for sensor, of in n.items())
    return prose("fits", sigmas=SIGMAS), (
        Table.of_numbers(title, of, _COLUMNS) for title, of in titles
    )


EXPERIMENT = Experiment("Line fits, given the walls", measure, report)
