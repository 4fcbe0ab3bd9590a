"""The two files of an occupancy grid: a flat YAML, and the image that it names."""

import math
import os
import re
import warnings
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..drawings import check_file, plan_error
from ..errors import LineamentError
from ..limits import Limits
from ..scan import Pose
from ..scan.fields import checked_place

#: Values of cells, as in ROS.
FREE, OCCUPIED, UNKNOWN = 0, 100, -1
#: Modes of map_server, what it takes where a file says nothing, and how YAML writes truth.
_MODES = _, SCALE, RAW = "trinary", "scale", "raw"
_DEFAULTS = {"mode": "trinary", "negate": "0", "occupied_thresh": "0.65", "free_thresh": "0.25"}
_TRUE, _FALSE = ("1", "true", "yes", "on"), ("0", "false", "no", "off")
#: Shade of white: 255 for each of one, two, three or four channels is a part of it.
WHITE = 255 * 12
_FORMATS = ("PNG", "PPM")
#: Farther away, coordinates are too coarse to be believed [m].
_FARTHEST = 1e8
_FIELD = re.compile(r"""(["']?)([\w-]+)\1\s*:(\s.*)?""")


class About(NamedTuple):
    """What the YAML of a grid says: its image, cells [m], lower left corner, and what is what."""

    image: str
    resolution: float
    origin: Pose
    occupied: float
    free: float
    mode: str
    negate: bool


def read_about(path: str | os.PathLike[str], limits: Limits) -> About:
    """Return what the YAML of a grid says; a LineamentError if it makes no sense."""
    error = plan_error(path)
    check_file(path, limits)
    try:
        # Names of files need not be UTF-8: other bytes are kept, as the system has them.
        text = Path(path).read_text(encoding="utf-8-sig", errors="surrogateescape")
        return _checked(_DEFAULTS | parse_flat(text))
    except OSError as problem:
        raise error(problem.strerror or "cannot be read") from None
    except ValueError as problem:
        raise error(f"is no grid of map_server: {problem}") from None


def parse_flat(text: str) -> dict[str, str]:
    r"""Return the fields of a flat YAML file as texts; a list has commas between its items.

    Raises ValueError for what is not flat: it is never guessed at.

    Examples
    --------
    >>> parse_flat('image: "a b.pgm"  # the walls\norigin: [1, 2.5, 0]')
    {'image': 'a b.pgm', 'origin': '1, 2.5, 0'}
    """
    found: dict[str, str] = {}
    name = ""
    for number, row in enumerate(text.splitlines(), 1):
        line = _without_comment(row).rstrip()
        if line.strip() in ("", "---", "..."):
            continue
        item = line.lstrip()
        if item.startswith("- ") and name and (not found[name] or found[name].endswith(",")):
            found[name] += f" {item[2:].strip()},"
            continue
        field = _FIELD.fullmatch(line)
        if field is None:
            raise ValueError(f"line {number} is {row.strip()!r}, expected `name: value`")
        name, value = field[2], (field[3] or "").strip()
        if name in found:
            raise ValueError(f"line {number} has {name} again")
        if value[:1] in ("'", '"', "["):
            closing = "]" if value[0] == "[" else value[0]
            if len(value) < 2 or value[-1] != closing:
                raise ValueError(f"line {number}: {name} has no closing {closing}")
            value = value[1:-1]
        found[name] = value
    return {name: value.strip().rstrip(",") for name, value in found.items()}


def _without_comment(line: str) -> str:
    """Return a line up to its comment: a # at its beginning, or after a blank, in no quotes."""
    quote = ""
    for k, letter in enumerate(line):
        if quote:
            quote = "" if letter == quote else quote
        elif letter in "\"'" and (not line[:k].strip() or line[:k].rstrip()[-1] in ":[,-"):
            quote = letter
        elif letter == "#" and (k == 0 or line[k - 1].isspace()):
            return line[:k]
    return line


def _checked(fields: dict[str, str]) -> About:
    """Return the fields of a grid as what they are; ValueError for one that makes no sense."""
    for name in ("image", "resolution", "origin"):
        if not fields.get(name):
            raise ValueError(f"{name} is missing")
    origin = [_number("origin", value) for value in fields["origin"].split(",")]
    if len(origin) != 3:
        raise ValueError(f"origin has {len(origin)} numbers, expected 3: x, y, yaw")
    if (far := max(map(abs, origin))) > _FARTHEST:
        raise ValueError(f"origin is {far:g} m away, expected a building")
    resolution, occupied, free = (
        _number(name, fields[name]) for name in ("resolution", "occupied_thresh", "free_thresh")
    )
    check_resolution(resolution)
    if not 0 <= free < occupied <= 1:
        raise ValueError(
            f"free_thresh is {free:g} and occupied_thresh {occupied:g}, "
            "expected 0 ≤ free_thresh < occupied_thresh ≤ 1"
        )
    mode, negate = fields["mode"].lower(), fields["negate"].lower()
    if mode not in _MODES:
        raise ValueError(f"mode is {mode!r}, expected one of {', '.join(_MODES)}")
    if negate not in _TRUE + _FALSE:
        raise ValueError(f"negate is {negate!r}, expected 0 or 1")
    x, y, yaw = checked_place(origin, "origin")
    return About(fields["image"], resolution, (x, y, yaw), occupied, free, mode, negate in _TRUE)


def check_resolution(resolution: float) -> None:
    """Refuse cells that are as large as no map's, or no number [m]."""
    if not 1e-4 <= resolution <= 10:
        raise ValueError(f"resolution is {resolution:g} m a cell, expected 0.0001 to 10")


def _number(name: str, text: str) -> float:
    try:
        value = float(text.strip().strip("\"'"))
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ValueError(f"{name} is {text.strip()!r}, expected a number")
    return value


def values_of(about: About) -> NDArray[np.int8]:
    """Return the value of a cell for each shade, of 0 to `WHITE`, as map_server does."""
    bright = np.arange(WHITE + 1) / WHITE
    if about.mode == RAW:
        values = np.rint(255 * bright)
        return np.where(values <= OCCUPIED, values, UNKNOWN).astype(np.int8)
    share = bright if about.negate else 1 - bright
    between = np.full(WHITE + 1, float(UNKNOWN))
    if about.mode == SCALE:
        between = np.rint((share - about.free) / (about.occupied - about.free) * 100)
    of_free = np.where(share < about.free, FREE, between)
    return np.where(share > about.occupied, OCCUPIED, of_free).astype(np.int8)


def read_shades(
    path: str | os.PathLike[str], about: About, limits: Limits
) -> tuple[NDArray[np.uint16], NDArray[np.bool_]]:
    """Return the shades of a grid's image, of 0 to `WHITE`, and which of its pixels are clear.

    They are means of the channels. Of mode trinary, opacity is one of them, as in map_server.
    """
    from PIL import Image  # which matplotlib brings

    name, image = f"{path}: {about.image}", Path(path).parent / about.image
    error = plan_error(name)
    check_file(image, limits, name)
    try:
        # Its own warnings of large images come before it can be asked how large they are.
        with warnings.catch_warnings(action="ignore"), Image.open(image, formats=_FORMATS) as file:
            limits.check("cells", file.width * file.height, error)
            mode = {"1": "L", "LA": "RGBA", "P": "RGBA" if "transparency" in file.info else "RGB"}
            pixels = np.asarray(file.convert(mode[file.mode]) if file.mode in mode else file)
    except LineamentError:
        raise
    except Image.DecompressionBombError:
        raise error(f"has more than the limit of {limits.cells} cells by far") from None
    # What is damaged is met by errors of half a dozen kinds.
    except Exception as problem:
        reason = f"{type(problem).__name__}: {problem}".replace(f" {str(image)!r}", "")
        raise error(f"is no whole PGM or PNG: {' '.join(reason.split())}") from None
    rows, columns = pixels.shape[:2]
    clear, channels = np.zeros((rows, columns), bool), pixels.reshape(rows, columns, -1)
    if channels.dtype != np.uint8:  # of 16 bits
        return (channels[..., 0].astype(np.uint64) * WHITE // 65535).astype(np.uint16), clear
    if channels.shape[2] == 4:
        clear = channels[..., -1] < 255
        channels = channels if about.mode == _MODES[0] else channels[..., :-1]
    sums = channels.sum(axis=2, dtype=np.uint16)
    return sums * np.uint16(WHITE // (255 * channels.shape[2])), clear
