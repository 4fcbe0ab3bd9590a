"""Figures 1, 4, 6, 7 and 8, which illustrate definitions, from computed geometry; and Table 1."""

import math
from collections.abc import Callable
from itertools import product
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from lineament.extractor import Extractor
from lineament.methods.stages import corner_response, primary_corners
from lineament.output import canvas, drawing
from lineament.scan import Array, LaserScan
from lineament.simulation import SENSORS, Sensor, World

from .experiment import Claim, Experiment, Judged, Measured, Report
from .findings import Figure, Progress, Setting
from .machine import machines
from .prose import prose

#: The support radius of the paper [beams].
RADIUS = 6
_RED, _BLUE, _GREEN = canvas.CORNER_COLOR, "#4477aa", "#228833"
_ORIGIN = (0.0, 0.0, 0.0)
#: A wall with a corner, and a nearer wall [m]; a beam between them that ends on noise, and its
#: range [m].
_CORNER, _EDGES = (3.0, -1.6), ((2.3, 0.5), (1.8, 2.2), (0.7, -1.75))
_WALLS = [[_EDGES[2], _CORNER, (3.3, 0.2)], _EDGES[:2]]
_NOISY, _NOISE = 263, 3.7
#: Vertices of the cluster of Figure 6 [m].
_STEPS = [(3.0, -1.6), (3.0, 0.3), (1.9, 0.5), (1.7, 1.6)]


def measure(_: Setting, __: Progress) -> Measured:
    """Compute the figures that illustrate definitions."""
    drawn = (_scan(), _spacing(), _chords(), _parabolas(), _tangent())
    return Measured(
        {name: numbers for name, _, numbers in drawn},
        lambda: [Figure.of(name, figure) for name, figure, _ in drawn],
    )


def report(_: Any, __: Setting) -> Report:
    """Make Table 1."""
    return prose("definitions"), (machines(),)


#: Short name, drawing, and numbers of a figure.
Drawn = tuple[str, Any, dict[str, float]]


def _line(axes: Axes, start: Any, end: Any, style: str = "-", color: str = canvas.INK) -> None:
    axes.plot(*np.transpose([start, end]), style, color=color)


def _without_noise(world: World, step: float) -> LaserScan:
    """Scan a world from the origin, over the paper's 160° in steps of so many degrees."""
    beams = round(160 / step) + 1, math.radians(-80), math.radians(step)
    return Sensor("ideal", *beams).scan(world, _ORIGIN, np.random.default_rng(0))


def _scan() -> Drawn:
    """Figure 1: the coordinates, and what a scan shows of edges, corners and noise."""
    scan = _without_noise(World.of_polygons(_WALLS), 1 / 3)
    ranges = scan.ranges.copy()
    ranges[_NOISY] = _NOISE
    scan = LaserScan(ranges, scan.angle_min, scan.angle_increment)
    found = Extractor("liu:scale_free")(scan)
    figure, (axes,) = canvas.new_panels(1, 1)
    shown = drawing.draw_beams(axes, scan, found.clusters)
    canvas.style_plane(axes, "Figure 1", "", shown)
    bearings = np.column_stack((np.cos(scan.angles), np.sin(scan.angles)))
    view = 0.6 * bearings
    axes.plot(*np.vstack(((0, 0), view, (0, 0))).T, color=canvas.FAINT)
    axes.text(*view[len(scan) // 2], " 160°", va="bottom")
    axes.text(*view[0], r" $\theta_1 = -80°$", va="top")
    beam = 330
    x, y = point = scan.points[beam]
    _line(axes, (0, 0), point, color=_BLUE)
    _line(axes, (x, 0), point, ":", color=_BLUE)
    _line(axes, (0, y), point, ":", color=_BLUE)
    axes.axhline(0, color=canvas.FAINT)
    axes.axvline(0, color=canvas.FAINT)
    turn = 1.1 * bearings[len(scan) // 2 : beam + 1]
    axes.plot(*turn.T, color=_BLUE)
    axes.text(*turn[len(turn) // 2], r" $\theta_i$", color=_BLUE)
    axes.text(*(point / 2), r"$\rho_i$ ", color=_BLUE, ha="right", va="bottom")
    axes.text(x, y, " $(x_i, y_i)$", color=_BLUE, va="bottom")
    drawing.draw_breakpoints(axes, found.breakpoints)
    drawing.draw_points(axes, found, extent=np.inf)
    for name, color, *places in (
        ("corner", _RED, _CORNER),
        ("noise point", canvas.LIGHT.text, scan.points[_NOISY]),
        ("breakpoint", canvas.BREAK_COLOR, *_EDGES),
    ):
        for place in places:
            drawing.draw_name(axes, name, np.array(place), np.zeros(2), color)
    corners, breaks = found.corners["position"], found.breakpoints["position"]
    off = [_away(corners, _CORNER), *(_away(breaks, edge) for edge in _EDGES)]
    labelled = float(found.clusters[_NOISY] < 0)
    return "fig1", figure, {"off": max(off), "corners": len(corners), "noise": labelled}


def _away(points: Array, place: tuple[float, float]) -> float:
    return float(np.hypot(*(points - place).T).min(initial=math.inf))


def _spacing() -> Drawn:
    """Figure 4: the spacing of points grows with range and incidence, and so does the threshold."""
    wall = World.of_polygons([[(0.4, -0.75), (5.4, 1.6)]])
    scan = _without_noise(wall, 5.0)
    trace = Extractor("liu", half_width=0).trace(
        SENSORS["paper"].scan(wall, _ORIGIN, np.random.default_rng(0))
    )
    figure, (plan, axes) = canvas.new_panels(2, 2)
    points = scan.points[scan.valid]
    canvas.style_plane(plan, "Figure 4", "beams 5° apart", np.vstack((points, (0, 0))))
    for point in points:
        _line(plan, (0, 0), point, color=canvas.FAINT)
    plan.plot(*points.T, "o", color=_BLUE)
    drawing.draw_sensor(plan)
    steps = []
    for pair in (points[:2], points[-2:]):
        _line(plan, pair[0], pair[1], color=_RED)
        steps.append(math.dist(*pair))
        middle, (x, y) = pair.mean(axis=0), pair[1] - pair[0]
        behind = middle + np.array((y, -x))
        drawing.draw_name(plan, f"{steps[-1]:.2f} m", middle, behind, _RED)
    canvas.style(axes, "", "beams ⅓° apart", "range [m]", "spacing of neighbours [m]")
    order = np.argsort(trace.scan.ranges)
    order = order[np.isfinite(trace.spacing[order])]
    far, spacing, limit = (
        of[order] for of in (trace.scan.ranges, trace.spacing, trace.distance_threshold)
    )
    least = far * trace.scan.angle_increment
    axes.plot(far, spacing, ".", color=_BLUE, label="spacing on the wall")
    axes.plot(far, least, ":", color=canvas.INK, label=r"$\rho\,\Delta\varphi$")
    axes.plot(far, limit, color=_RED, label=r"threshold $T_d$ (equation 10)")
    axes.legend(frameon=False)
    beyond = float((spacing > limit).mean())
    return "fig4", figure, {"ratio": steps[-1] / steps[0], "beyond": beyond}


def _chords() -> Drawn:
    """Figure 6: the point farthest from the chord is a primary corner; then on both its sides."""
    scan = _without_noise(World.of_polygons([_STEPS]), 1 / 3)
    points = scan.points[scan.valid]
    found = primary_corners(points, response="relative", threshold=0.5, support_radius=RADIUS)
    figure, panels = canvas.new_panels(3, 3)
    ends = [0, len(points) - 1]
    for k, (axes, candidate) in enumerate(zip(panels, found, strict=False)):
        beam, distance = int(candidate["beam"]), float(candidate["chord_distance"])
        first = max(end for end in ends if end < beam)
        last = min(end for end in ends if end > beam)
        start, end, corner = points[first], points[last], points[beam]
        along = (end - start) / math.dist(start, end)
        verdict = "accepted" if candidate["accepted"] else "rejected, the branch ends"
        about = f"step {k + 1}: d = {distance:.2f} m, {verdict}"
        canvas.style_plane(axes, "" if k else "Figure 6", about, points)
        axes.plot(*points.T, ".", color=canvas.FAINT)
        axes.plot(*points[first : last + 1].T, ".", color=_BLUE)
        _line(axes, start, end, "--")
        _line(axes, corner, start + along * ((corner - start) @ along), color=_RED)
        axes.plot(*corner, "D", mfc="none", mec=_RED)
        axes.annotate("  first", start, va="bottom")
        axes.annotate("  last", end, va="top")
        axes.plot(*np.transpose([start, end]), "o", color=canvas.INK)
        if candidate["accepted"]:
            ends.append(beam)
    corners = points[found["beam"][found["accepted"]]]
    off = max(_away(corners, vertex) for vertex in _STEPS[1:-1])
    return "fig6", figure, {"off": off, "corners": len(corners)}


def _parabolas() -> Drawn:
    """Figure 7: the distance to the tangent grows with the curvature of a parabola."""
    bends, x = (1.6, 0.6), np.linspace(-0.75, 0.75, 2 * RADIUS + 1)
    figure, (plan, axes) = canvas.new_panels(2, 2)
    about = f"support radius {RADIUS}"
    canvas.style(plan, "Figure 7", about, "along the tangent", "distance to it")
    fine = np.linspace(x[0], x[-1])
    for bend, color in zip(bends, (_RED, _BLUE), strict=True):
        plan.plot(fine, bend * fine**2, color=color, label=f"$y = {bend} x^2$")
        plan.vlines(x, 0, bend * x**2, color=color)
        plan.plot(x, bend * x**2, "o", color=color)
        axes.plot(2 * bend, bend * (x**2).sum(), "o", color=color)
    for k, name in ((RADIUS + 4, "A"), (RADIUS + 5, "B")):
        plan.plot(x[k], 0, "o", color=canvas.INK)
        plan.text(x[k], 0, f" {name}", va="bottom")
    plan.axhline(0, color=canvas.INK)
    plan.legend(frameon=False, loc="upper center")
    about = "corner_response, form “tangent”"
    canvas.style(axes, "", about, "curvature at the vertex", "cumulative distance to the tangent")
    curvatures = np.linspace(0.0, 4.0, 17)
    sampled = (np.column_stack((x, k / 2 * x**2)) for k in curvatures)
    given: dict[str, Any] = {"support_radius": RADIUS, "response": "tangent"}
    responses = [corner_response(points, **given)[RADIUS] for points in sampled]
    axes.plot(curvatures, responses, color=canvas.INK, label="of sampled parabolas")
    axes.legend(frameon=False)
    off = float(np.abs(responses - curvatures / 2 * (x**2).sum()).max())
    return "fig7", figure, {"off": off}


def fitted(points: Array, at: int, radius: int) -> tuple[Array, Array, Array]:
    """Return equations 15–19 by definition: arc lengths s (m,), slopes b and bends a, (2,) each.

    x(s) = a₁ s² + b₁ s + x_i, and y likewise, through the support of one point of a cluster.
    """
    support = points[at - radius : at + radius + 1]
    steps = np.hypot(*np.diff(support, axis=0).T)
    s = np.concatenate(([0.0], steps.cumsum()))
    s -= s[radius]
    design = np.column_stack((s**2, s))
    bends, slopes = np.linalg.lstsq(design, support - points[at], rcond=None)[0]
    return s, slopes, bends


def _tangent() -> Drawn:
    """Figure 8: the support of a point, by arc length; two parabolas; the tangent; distances."""
    vertex = np.array((3.0, 1.0))
    arms = vertex - np.array((0.0, 1.0)), vertex - np.array((0.8, -0.4))
    world = World.of_polygons([[arms[0], vertex, arms[1]]])
    scan = _without_noise(world, 1.0)
    points = scan.points[scan.valid]
    at = int(np.hypot(*(points - vertex).T).argmin())
    s, slopes, bends = fitted(points, at, RADIUS)
    support, target = points[at - RADIUS : at + RADIUS + 1], points[at]
    tangent = slopes / np.hypot(*slopes)
    normal = np.array((-tangent[1], tangent[0]))
    distances = (support - target) @ normal
    feet = support - np.outer(distances, normal)
    total = float(np.abs(distances).sum())
    figure, (support_at, *by_arc, last) = canvas.new_panels(6, 3)
    for axes, letter, about in (
        (support_at, "Figure 8  (a)", f"support of a target, radius {RADIUS}"),
        (last, "(f)", f"tangent, and distances to it: Σ d = {total:.2f} m"),
    ):
        canvas.style_plane(axes, letter, about, np.vstack((support, feet)))
        axes.plot(*points.T, ".", color=canvas.FAINT)
        axes.plot(*support.T, "o", color=_BLUE)
        axes.plot(*target, "o", color=_RED)
    fine = np.linspace(s[0], s[-1])
    kinds = product(("{} by arc length", "{}(s), fitted"), enumerate("xy"))
    for axes, letter, (about, (k, name)) in zip(by_arc, "bcde", kinds, strict=True):
        canvas.style(axes, f"({letter})", about.format(name), "arc length s [m]", f"{name} [m]")
        axes.plot(s, support[:, k], "o", color=_BLUE)
        axes.plot(0, target[k], "o", color=_RED)
        if "fitted" in about:
            axes.plot(fine, bends[k] * fine**2 + slopes[k] * fine + target[k], color=_GREEN)
            slope = f"${name}'(0) = {slopes[k]:.2f}$"
            axes.plot(fine, slopes[k] * fine + target[k], ":", color=canvas.INK, label=slope)
            axes.legend(frameon=False)
    _line(last, feet[0], feet[-1], color=_GREEN)
    for point, foot in zip(support, feet, strict=True):
        _line(last, point, foot, color=_RED)
    stage = corner_response(points, support_radius=RADIUS, response="tangent")[at]
    return "fig8", figure, {"sum": total, "stage": float(stage)}


def _claim(name: str, margin: Callable[[Any], float], about: str, paper: str) -> Claim:
    """Declare what a figure shows here and in the paper, and by how much its numbers do."""
    return Claim(
        f"Figure {name[3:]}", paper, lambda n: Judged(about, [margin(n[name])]), figure=name
    )


_SUM = "By definition and by the code: the same sum"
_TABLE_1 = Judged("Other hardware, compiled code", ())
CLAIMS = (
    _claim("fig1", lambda n: 0.02 - n["off"], "Each found where it is drawn",
           "Breakpoint, corner and noise point of a scan"),
    _claim("fig4", lambda n: min(n["ratio"] - 1, -n["beyond"]), "So is the threshold",
           "Points are farther apart at a distance"),
    _claim("fig6", lambda n: 0.02 - n["off"], "Corners within a beam",
           "Primary corners are farthest from the chord"),
    _claim("fig7", lambda n: 1e-9 - n["off"], "Proportional",
           "Distance to the tangent grows with the curvature"),
    _claim("fig8", lambda n: 1e-9 - abs(n["sum"] - n["stage"]), _SUM,
           "Support, arc length, parabolas, tangent"),
    Claim("Table 1", "Hardware and software", lambda _: _TABLE_1),
)  # fmt: skip
TITLE = "Definitions (Figures 1, 4, 6, 7, 8) and the machine (Table 1)"
EXPERIMENT = Experiment(TITLE, measure, report, CLAIMS, once=True)
