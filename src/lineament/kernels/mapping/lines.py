"""Lines of walls by what is seen of them: robust least squares, as if the poses were known."""

import math

from .. import helper, kernel
from ..arrays import Floats2, Ints2

#: Words of a record of `sights.SIGHT`; and of `walls.WALL`.
FRAME, SEEN, PLACE, ANGLE, SPREAD = 0, 1, 2, 4, 5
CENTROID, DIRECTION, COVARIANCE = 4, 6, 7
#: Of the scratch, columns for each wall: three sums of information, two of errors.
SUMS = 5
#: What is known of a line before: 1 km and 1 krad.
_WEAK = 1e-6


@helper
def _wrapped(angle):
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


@helper
def _placed(sight, pose):
    """Centroid and angle of a sight in the frame of the poses."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    x, y = sight[PLACE], sight[PLACE + 1]
    return pose[0] + c * x - s * y, pose[1] + s * x + c * y, pose[2] + sight[ANGLE]


@helper
def _begin(sights, numbers, poses, lines, sums):
    """Begin with the mean of the sights, each by how sure it is."""
    for k in range(len(sights)):
        x, y, angle = _placed(sights[k], poses[numbers[k, FRAME]])
        total = sums[numbers[k, SEEN]]
        sure, firm = 1.0 / sights[k, SPREAD], 1.0 / sights[k, SPREAD + 3]
        total[0] += sure
        total[1] += sure * x
        total[2] += sure * y
        total[3] += firm * math.cos(angle)
        total[4] += firm * math.sin(angle)
    for w in range(len(lines)):
        weight = max(sums[w, 0], 1e-12)
        lines[w, CENTROID], lines[w, CENTROID + 1] = sums[w, 1] / weight, sums[w, 2] / weight
        lines[w, DIRECTION] = math.atan2(sums[w, 4], sums[w, 3])


@helper
def _add_up(sights, numbers, poses, lines, sums, most):
    """Add up what sights say of the offset and the angle of their line."""
    for k in range(len(sights)):
        x, y, angle = _placed(sights[k], poses[numbers[k, FRAME]])
        line, total = lines[numbers[k, SEEN]], sums[numbers[k, SEEN]]
        ux, uy = math.cos(line[DIRECTION]), math.sin(line[DIRECTION])
        rx, ry = x - line[CENTROID], y - line[CENTROID + 1]
        along, off, turn = ux * rx + uy * ry, ux * ry - uy * rx, _wrapped(angle - line[DIRECTION])
        v00, v01, v11 = sights[k, SPREAD], sights[k, SPREAD + 1], sights[k, SPREAD + 3]
        det = v00 * v11 - v01 * v01
        square = (v11 * off * off - 2.0 * v01 * off * turn + v00 * turn * turn) / det
        share = most / max(square, most) / det
        w00, w01, w11 = share * v11, -share * v01, share * v00
        # Where the line turns, its offset there changes by the way along it.
        total[0] += w00
        total[1] += along * w00 + w01
        total[2] += along * (along * w00 + 2.0 * w01) + w11
        total[3] += w00 * off + w01 * turn
        total[4] += along * (w00 * off + w01 * turn) + w01 * off + w11 * turn


@kernel
def fit_lines(
    sights: Floats2, numbers: Ints2, poses: Floats2, most: float, lines: Floats2, sums: Floats2
):
    """Fit the line of each wall to its sights, of which those beyond a square count less.

    `sights` and `numbers` are the words of records of sights as floats and as whole numbers,
    `lines` those of walls; `sums` is scratch of 0, (walls, SUMS).
    """
    _begin(sights, numbers, poses, lines, sums)
    for _ in range(2):
        for w in range(len(sums)):
            for column in range(SUMS):
                sums[w, column] = 0.0
        _add_up(sights, numbers, poses, lines, sums, most)
        for w in range(len(lines)):
            line, total = lines[w], sums[w]
            h00, h01, h11 = total[0] + _WEAK, total[1], total[2] + _WEAK
            det = h00 * h11 - h01 * h01
            v00, v01, v11 = h11 / det, -h01 / det, h00 / det
            line[COVARIANCE], line[COVARIANCE + 3] = v00, v11
            line[COVARIANCE + 1] = line[COVARIANCE + 2] = v01
            step = v00 * total[3] + v01 * total[4]
            ux, uy = math.cos(line[DIRECTION]), math.sin(line[DIRECTION])
            line[CENTROID] -= step * uy
            line[CENTROID + 1] += step * ux
            line[DIRECTION] = _wrapped(line[DIRECTION] + v01 * total[3] + v11 * total[4])
