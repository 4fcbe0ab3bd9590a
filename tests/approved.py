"""Results as text that was looked at and approved: what changes it is to be explained.

``LINEAMENT_APPROVE=1 pytest FILE`` writes the texts anew, for git to show what changed.
"""

import os
import re
from pathlib import Path

import numpy as np
import pytest
from matplotlib.colors import to_hex

FOLDER = Path(__file__).with_name("approved")
NUMBER = re.compile(r"(?<![\w#.])[+-]?\d+\.?\d*(?:e[+-]?\d+)?(?![\w.])")


def assert_approved(name, lines):
    """Compare lines with those of a file, numbers that are not whole to a thousandth."""
    path, text = FOLDER / f"{name}.txt", "\n".join(lines) + "\n"
    if os.environ.get("LINEAMENT_APPROVE"):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8", newline="\n")
    expected = path.read_text(encoding="utf-8").splitlines()
    for line, other in zip(text.splitlines(), expected, strict=True):
        assert NUMBER.sub("0", line) == NUMBER.sub("0", other)
        for here, there in zip(NUMBER.findall(line), NUMBER.findall(other), strict=True):
            is_whole = here.isdigit() and there.isdigit()
            near = pytest.approx(float(there), rel=0 if is_whole else 1e-3, abs=2e-5)
            assert float(here) == near, (line, other)


def numbers_of(value, path=""):
    """Yield a line for each row of numbers and texts in nested results, with the way to it."""
    pairs = value.items() if isinstance(value, dict) else enumerate(value)
    plain, nested = [], []
    for key, one in pairs:
        (nested if isinstance(one, dict | list) else plain).append((key, one))
    if plain:
        of_dict = isinstance(value, dict)
        parts = (f"{key} {_short(one)}" if of_dict else _short(one) for key, one in plain)
        yield f"{path}: {' | '.join(parts)}"
    for key, one in nested:
        yield from numbers_of(one, f"{path}/{key}")


def _short(value):
    return f"{round(value, 5) + 0.0:.5g}" if isinstance(value, float) else str(value)


def _row(values):
    """Write a few numbers, of many how many, the ends and a sum that depends on their order."""
    values = np.ravel(np.ma.filled(np.ma.asarray(values, float), np.nan))
    if len(values) > 8:
        good = values[np.isfinite(values)]
        total = good @ np.arange(1, len(good) + 1) / max(len(good), 1)
        values = [len(values), len(good), *values[:2], *values[-2:], total]
    return ",".join(_short(float(value)) for value in values)


def _color(color):
    if isinstance(color, str) and color in ("none", "auto"):
        return color
    colors = np.reshape(np.array(color, object), -1)
    if len(colors) > 4 or np.ndim(color) > 1:
        return "/".join(dict.fromkeys(to_hex(c, keep_alpha=True) for c in color))
    return to_hex(color, keep_alpha=True)


def figure_lines(figure):
    """Describe all that is drawn in a figure, but what the sizes of letters decide.

    In a figure that is settled these are the limits of plans and the places of labels.
    """
    is_settled = "Constrained" not in type(figure.get_layout_engine()).__name__
    yield f"figure {_row(figure.get_size_inches())} {_color(figure.get_facecolor())}"
    yield from map(_text, figure.texts)
    yield from map(_legend, figure.legends)
    for axes in figure.axes:
        yield from _panel(axes, is_settled)


def _panel(axes, is_settled):
    spec = axes.get_subplotspec()
    grid = spec.get_gridspec()
    place, heights = map(int, spec.get_geometry()), grid.get_height_ratios() or []
    yield f"panel {','.join(map(str, place))} of heights {_row(heights)}"
    for side in ("left", "center", "right"):
        if axes.get_title(side):
            title = {"left": axes._left_title, "right": axes._right_title}.get(side, axes.title)
            yield f"title {side} {_text(title)} {_row(axes.titleOffsetTrans.get_matrix()[:2, 2])}"
    for name, axis in zip("xy", (axes.xaxis, axes.yaxis), strict=True):
        limits, ticks = getattr(axes, f"get_{name}lim")(), axis.get_ticklabels()
        look = [f"{t.get_size():g} {_color(t.get_color())}" for t in ticks[:1]]
        look += [f"{g.get_lw():g} {_color(g.get_color())}" for g in axis.get_gridlines()[:1]]
        look += [_row(limits)] * (not is_settled or axes.get_aspect() == "auto")
        look += [" ".join(t.get_text() for t in ticks)] * (not is_settled)
        label = f"{axis.get_label_text()!r} {axis.label.get_size():g}"
        yield f"{name} {axis.get_scale()} {label} {' '.join(look)}"
    aspect = axes.get_aspect()
    frame = _color(axes.spines["left"].get_edgecolor())
    yield f"paper {_color(axes.get_facecolor())} {frame} {axes.get_axisbelow()} aspect {aspect}"
    for line in axes.lines:
        look = [line.get_marker(), _row([line.get_ms(), line.get_mew()])]
        look += map(_color, (line.get_mfc(), line.get_mec()))
        yield (
            f"line {_common(line)} {line.get_ls()} {line.get_lw():g} {_color(line.get_color())} "
            f"{look} {line.get_transform() == axes.transData} {_row(line.get_xydata())}"
        )
    for group in axes.collections:
        paths = [_row(path.vertices) for path in group.get_paths()[:4]]
        yield (
            f"{type(group).__name__} {_common(group)} {_row(group.get_linewidths())} "
            f"{_color(group.get_facecolors())} {_color(group.get_edgecolors())} "
            f"{_row(group.get_sizes() if hasattr(group, 'get_sizes') else [])} "
            f"{len(group.get_paths())} {paths} at {_row(group.get_offsets())}"
        )
    for patch in axes.patches:
        outline = patch.get_patch_transform().transform(patch.get_path().vertices)
        yield (
            f"patch {_common(patch)} {patch.get_linewidth():g} {_color(patch.get_facecolor())} "
            f"{_color(patch.get_edgecolor())} {_row(outline)}"
        )
    for text in axes.texts:
        yield _text(text, is_settled)
    if axes.get_legend():
        yield _legend(axes.get_legend())


def _common(artist):
    label = str(artist.get_label())
    name = "" if label.startswith("_") else repr(label)
    return f"{name} {artist.get_zorder():g} {artist.get_alpha()}"


def _text(text, is_settled=False):
    place = getattr(text, "xy", text.get_position())
    places = [_row(place)]
    if hasattr(text, "xy") and not (is_settled and text.get_zorder() == 7):
        places += [_row(text.get_position()), str(text.xycoords), str(text.anncoords)]
    arrow = getattr(text, "arrow_patch", None)
    look = [_color(arrow.get_edgecolor())] if arrow else []
    return (
        f"text {text.get_text()!r} {text.get_size():.4g} {_color(text.get_color())} "
        f"{text.get_ha()} {text.get_va()} {text.get_weight()} {text.get_zorder():g} "
        f"{' '.join(places + look)}"
    )


def _legend(legend):
    texts = [text.get_text() for text in legend.get_texts()]
    sizes = _row([text.get_size() for text in legend.get_texts()[:1]])
    title = legend.get_title()
    return (
        f"legend {texts} {sizes} {legend._ncols} {legend._loc} {legend.get_frame_on()} "
        f"{title.get_text()!r} {title.get_size():g} {_color(title.get_color())}"
    )
