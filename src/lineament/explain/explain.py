"""Why a beam is part of a feature, or of no feature: a trace in words."""

import math
from dataclasses import dataclass

import numpy as np

from ..methods.trace import Trace
from ..scan.fields import is_whole
from .measurements import Line, Measurements, along_beam, spans, why_invalid

#: Fewer measurements than this are no line in any of the methods.
_FEW = 4
#: The method that finds clusters alone.
_PARTS_ONLY = "pdbs"
#: Angle below which neighbouring lines may be taken for one wall that bends [°].
_SHALLOW = 20.0
#: An examined corner is reported with the beams up to this far from it.
_NEAR = 3


@dataclass(frozen=True, slots=True)
class Explanation:
    """What became of one beam, stage by stage.

    Attributes
    ----------
    beam : int
        Index of the beam.
    outcome : str
        "invalid", "spike", "noise" (in no cluster), "unexplained" (in a cluster, but in no
        feature), "clustered" (the method fits nothing), "segment" or "arc".
    summary : str
        The answer in one sentence.
    steps : tuple of (str, str)
        Stage and what was found there, in the order of the stages.
    """

    beam: int
    outcome: str
    summary: str
    steps: tuple[tuple[str, str], ...]


def explain(trace: Trace, beam: int) -> Explanation:
    """Return what became of a beam in a run of a method, and why.

    Thresholds, responses and evidence are those of the trace. Lines through measurements that are
    in no feature are fitted here.

    The trace is of one scan, from `Extractor.trace` or `lineament.trace`; beams count from 0. There
    is a ValueError if the beam is not there, and a TypeError for something else than a trace.

    Examples
    --------
    >>> import lineament as ln
    >>> ranges = [2.0] * 9 + [float("nan"), 3.5, 0.0]
    >>> trace = ln.trace(ln.LaserScan(ranges, angle_min=0.0, angle_increment=0.01))
    >>> explain(trace, 9).summary
    'Invalid: the range is NaN, no measurement.'
    >>> explain(trace, 10).outcome, explain(trace, 4).outcome
    ('noise', 'segment')
    """
    if not isinstance(trace, Trace):
        raise TypeError(
            f"trace is of type {type(trace).__name__}, expected a Trace: lineament.trace(scan)"
        )
    n = len(trace.scan)
    if not is_whole(beam) or not 0 <= beam < n:
        raise ValueError(f"beam is {beam!r}, expected a whole number from 0 to {n - 1}")
    return _Question(trace, int(beam)).answer()


class _Question:
    """One beam of one trace; each method below answers for a stage."""

    def __init__(self, trace: Trace, beam: int) -> None:
        self.trace, self.beam, self.scan = trace, beam, trace.scan
        self.segments, self.arcs = trace.features.segments, trace.features.arcs
        self.measurements = Measurements(trace)
        self.steps: list[tuple[str, str]] = []

    def answer(self) -> Explanation:
        scan, i = self.scan, self.beam
        bearing = math.degrees(scan.angles[i])
        invalid = why_invalid(scan, i)
        if invalid:
            self._note("measurement", f"beam {i} at {bearing:.2f}°: {invalid}")
            return self._done("invalid", f"Invalid: {invalid}.")
        text = f"beam {i}: {scan.ranges[i]:.3f} m at {bearing:.2f}°"
        sigma = self._sigma(i)
        noise = f"noise {_length(sigma)} (1 σ)" if sigma else "without noise"
        self._note("measurement", f"{text}, {noise}")
        if not math.isfinite(self.trace.filtered[i]):
            return self._done(*self._left_out())
        moved = self.trace.filtered[i] - scan.ranges[i]
        if moved:
            self._note("filter", f"moved by {_signed(moved)} along its beam for the detection")
        if self.trace.clusters[i] < 0:
            return self._done("noise", self._noise())
        self._note("cluster", f"cluster {self.trace.clusters[i]}; {self._sides()}")
        self._examined()
        return self._done(*self._feature())

    def _note(self, stage: str, text: str) -> None:
        self.steps.append((stage, text))

    def _done(self, outcome: str, summary: str) -> Explanation:
        return Explanation(self.beam, outcome, summary, tuple(self.steps))

    def _sigma(self, i: int) -> float:
        noise = self.trace.features.noise
        return math.sqrt(noise.range_variance(float(self.scan.ranges[i]))) if noise else math.nan

    def _sigmas(self, off: float) -> str:
        """Return a distance in deviations of the noise, in brackets; nothing without noise."""
        sigma = self._sigma(self.beam)
        return f" ({abs(off) / sigma:.1f} σ)" if sigma else ""

    def _left_out(self) -> tuple[str, str]:
        i, ranges = self.beam, self.scan.ranges
        sides = [i - 1, i + 1]
        if not 0 < i < len(self.scan) - 1 or not self.scan.valid[sides].all():
            return "invalid", "Left out: no scanner sees that near or far."
        off = float(ranges[i] - ranges[sides].mean())
        text = f"off the mean of its neighbours by {_signed(off)}, while these agree"
        self._note("filter", text)
        return "spike", "A spike: a lone measurement before or behind a surface that goes on."

    def _noise(self) -> str:
        self._note("cluster", f"none; {self._sides()}")
        count = 1 + self._count_held(-1) + self._count_held(1)
        if count == 1:
            return "Noise: it is alone, apart from the measurements on either side."
        return f"Noise: {count} measurements hold together here, too few for a cluster."

    def _count_held(self, way: int) -> int:
        """Count the neighbours on one side, up to a spacing above its threshold."""
        here = self.beam
        for count in range(len(self.measurements)):
            there = self.measurements.neighbour(here, way)
            if there is None or not self._holds(_later(here, there, way)):
                return count
            here = there
        return len(self.measurements) - 1

    def _holds(self, i: int) -> bool:
        """Whether a measurement is near enough to the one before it."""
        t = self.trace
        limits = (t.distance_threshold[i], t.density_threshold[i])
        return any(bool(t.spacing[i] <= limit) for limit in limits)

    def _sides(self) -> str:
        return ", ".join(self._side(way) for way in (-1, 1))

    def _side(self, way: int) -> str:
        t, word = self.trace, "before" if way < 0 else "after"
        other = self.measurements.neighbour(self.beam, way)
        if other is None:
            return f"the scan ends {word}"
        i = _later(self.beam, other, way)
        limit = np.fmax(t.distance_threshold[i], t.density_threshold[i])
        apart = f"{_length(t.spacing[i])} to beam {other} {word}"
        if math.isnan(limit):
            return f"{apart}, over too many missing beams"
        if not t.spacing[i] <= limit:
            return f"{apart}, more than the {_length(limit)} that hold together"
        if t.clusters[other] != t.clusters[self.beam]:
            why = ": the lines on the two sides do not meet" if t.evidence else ""
            return f"{apart}, near enough, yet another cluster begins{why}"
        return f"{apart}, of {_length(limit)} allowed"

    def _examined(self) -> None:
        """Report the corners that were examined here, and whether they were kept."""
        t = self.trace
        if not len(t.candidates):
            return
        away = np.abs(t.candidates["beam"] - self.beam)
        inside = t.candidates["cluster"] == t.clusters[self.beam]
        order = np.argsort(away, kind="stable")
        near = [k for k in order if away[k] <= _NEAR][:2] or [k for k in order if inside[k]][:1]
        if not near:
            self._note("cut", "no corner was examined in this cluster")
        for k in near:
            beam, response = int(t.candidates["beam"][k]), t.candidates["response"][k]
            text = f"beam {beam} was examined as a corner: response {_figure(response)}"
            self._note("cut", f"{text}, {_figure(t.threshold)} asked; {self._verdict(k)}")

    def _verdict(self, k: int) -> str:
        candidate = self.trace.candidates[k]
        beam = int(candidate["beam"])
        if not candidate["accepted"]:
            return "rejected"
        if (abs(self.trace.features.corners["beam"] - beam) <= 1).any():
            return "a corner"
        inside = spans(self.segments, beam)
        for end in ("first_beam", "last_beam"):
            inside = inside & (self.segments[end] != beam)
        if inside.any():
            return "cut there first, then merged again"
        return "a border, but the lines on its sides do not meet there"

    def _feature(self) -> tuple[str, str]:
        inside = [int(k) for k in np.flatnonzero(spans(self.segments, self.beam))]
        for k in inside:
            self._in_segment(k)
        if inside:
            return "segment", f"Part of {' and '.join(f'segment {k}' for k in inside)}."
        arcs = np.flatnonzero(spans(self.arcs, self.beam))
        if len(arcs):
            return "arc", self._in_arc(int(arcs[0]))
        if self.trace.method == _PARTS_ONLY:
            return "clustered", f"In a cluster; {_PARTS_ONLY} finds no more than these."
        return "unexplained", self._unexplained()

    def _in_segment(self, k: int) -> None:
        segment, i = self.segments[k], self.beam
        length = math.dist(segment["start"], segment["end"])
        off = along_beam(self.scan, i, segment)
        text = f"segment {k}: {_extent(segment)}, {length:.2f} m, rms {_length(segment['rms'])}"
        off_line = f"{_signed(off)} along its beam{self._sigmas(off)}"
        self._note("fit", f"{text}; this measurement: {off_line}")
        evidence = self.trace.evidence.get("segments")
        if evidence is None:
            return
        asked = f"{_figure(self.trace.threshold)} asked"
        if math.isinf(evidence[k]):
            self._note("evidence", "no neighbour that it could be one line with")
        else:
            text = f"χ² would rise by {_figure(evidence[k])} if it were one line with a neighbour"
            self._note("evidence", f"{text} ({asked})")
        self._split_here(segment, asked)

    def _split_here(self, segment: np.void, asked: str) -> None:
        """Report what two lines in place of one would gain here."""
        beams = self.measurements.of(segment)
        at = beams.index(self.beam) if self.beam in beams else 0
        if at < _FEW or len(beams) - at < _FEW:
            return
        whole, left, right = (
            Line.through(self.trace, part) for part in (beams, beams[:at], beams[at:])
        )
        gain = whole.chi_square - left.chi_square - right.chi_square
        text = f"cut in two here, χ² would fall by {_figure(gain)} ({asked} for a corner)"
        if gain > self.trace.threshold:
            turn = left.turn(right)
            text += f"; yet it was not cut, and the two lines turn by {turn:.1f}°"
            text += ": one wall that bends" if turn < _SHALLOW else ""
        self._note("evidence", text)

    def _in_arc(self, k: int) -> str:
        arc, i = self.arcs[k], self.beam
        off = float(np.hypot(*(self.scan.points[i] - arc["center"])) - arc["radius"])
        text = (
            f"arc {k}: {_extent(arc)}, radius {_length(arc['radius'])}, rms {_length(arc['rms'])}"
        )
        self._note("fit", f"{text}; this measurement: {_signed(off)} off the circle")
        evidence = self.trace.evidence.get("arcs")
        if evidence is not None:
            text = f"lines in its place would cost {_figure(evidence[k])} more in χ²"
            self._note("evidence", text)
        return f"Part of arc {k}."

    def _unexplained(self) -> str:
        run = self.measurements.unexplained(self.beam)
        for k in (run.before, run.after):
            if k >= 0:
                off = along_beam(self.scan, self.beam, self.segments[k])
                text = f"off the line of segment {k} by {_signed(off)}{self._sigmas(off)}"
                self._note("neighbour", text)
        count = len(run.beams)
        where = f"{count} measurement{'s' * (count > 1)} here in no line"
        if count < _FEW:
            return f"In no feature: {where}, too few for a line."
        line = Line.through(self.trace, run.beams)
        freedom = max(count - 2, 1)
        looks = (
            f"a line through them is off by {_length(line.rms)} rms over {_length(line.length)}, "
            f"χ² {_figure(line.chi_square)} for {freedom} degrees of freedom"
        )
        self._note("fit", f"beams {run.beams[0]} to {run.beams[-1]}: {looks}")
        if line.chi_square > freedom + 3 * math.sqrt(2 * freedom):
            return f"In no feature: {where}, too crooked for a line."
        return f"In no feature: {where}; one would fit them, but {self.trace.method} found none."


def _later(i: int, j: int, way: int) -> int:
    """Return the later of two neighbours: its spacing is the one between them."""
    return i if way < 0 else j


def _extent(feature: np.void) -> str:
    first, last, count = (feature[name] for name in ("first_beam", "last_beam", "n_points"))
    return f"beams {first} to {last}, {count} measurements"


def _length(metres: float) -> str:
    return f"{1e3 * metres:.1f} mm" if abs(metres) < 1 else f"{metres:.2f} m"


def _figure(value: float) -> str:
    return f"{value:.0f}" if abs(value) >= 10 else f"{value:.2g}"


def _signed(metres: float) -> str:
    return ("+" if metres >= 0 else "−") + _length(abs(metres))
