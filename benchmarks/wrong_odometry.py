"""Odometry that is wrong: how far a robot goes before it is left out (`OdometryCheck`).

    python benchmarks/wrong_odometry.py [intel_wheels.npz]

Of each recording the odometry as it is, and made wrong: mirrored, of a scanner that looks back or
to the left, of half the way, half a second late, or standing still. The last rows are simulated
storeys with wheels that slip, among ten people. Poses of most recordings are corrected ones, those
of loop5 are of its wheels; a recording as for ``calibrating.py --real`` has its wheels, too. The
constants were chosen with the recordings at hand, but Killian.
"""

import math
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path

from calibrating import recorded
from recordings import DATA, logs

import lineament as ln
from lineament.mapping.wheels import OdometryCheck
from lineament.scan import Pose
from lineament.scan.poses import compose
from lineament.simulation import SENSORS, Wheels, office

LOGS = logs("Intel lab", "fr079", "ACES", "CSAIL", "Acapulco", "Killian") | {
    "loop5": "text/dpslam_loop5.log.gz",
    "arena": "truth/jackal_mocap_02171554.npz",
}
WRONG = {
    "as it is": lambda pose: pose,
    "mirrored": lambda pose: (pose[0], -pose[1], -pose[2]),
    "looks back": lambda pose: compose(pose, (0.0, 0.0, math.pi)),
    "looks left": lambda pose: compose(pose, (0.0, 0.0, math.pi / 2)),
    "half the way": lambda pose: (pose[0] / 2, pose[1] / 2, pose[2]),
    "stands": lambda _: (0.0, 0.0, 0.0),
}
LATE = 0.5


def late(scans: list[ln.LaserScan]) -> Iterator[tuple[ln.LaserScan, Pose]]:
    """Yield each scan with the pose of one half a second before it."""
    k = 0
    for scan in scans:
        while scans[k + 1].stamp <= scan.stamp - LATE:
            k += 1
        if scans[k].stamp <= scan.stamp - LATE:
            yield scan, scans[k].pose


def left_out(scans: list[ln.LaserScan], given: list[tuple[ln.LaserScan, Pose]]) -> str:
    """Return the way until odometry is left out [m], and the share of scans without it [%]."""
    check, first = OdometryCheck(), None
    kept = 0
    for scan, odometry in given:
        is_believed = check(scan, odometry) is not None
        kept += is_believed
        if not is_believed and first is None:
            first = scan
    if first is None:
        return "–"
    way, before = 0.0, scans[0].pose
    for scan in scans:
        way, before = way + math.dist(before[:2], scan.pose[:2]), scan.pose
        if scan is first:
            break
    return f"{way:.0f}, {100 * (1 - kept / len(given)):.0f} %"


def row(name: str, scans: list[ln.LaserScan]) -> None:
    """Print what becomes of the odometry of a drive, right and wrong."""
    cells = [left_out(scans, [(s, wrong(s.pose)) for s in scans]) for wrong in WRONG.values()]
    delayed = list(late(scans)) if scans[-1].stamp > scans[0].stamp else []
    cells.append(left_out(scans, delayed) if delayed else "no stamps")
    print(f"| {name} | {' | '.join(cells)} |", flush=True)


def main() -> None:
    """Print the table."""
    warnings.simplefilter("ignore", ln.LineamentWarning)
    print(f"| log | {' | '.join(WRONG)} | late |\n|---{(len(WRONG) + 1) * '|--:'}|")
    for name, path in LOGS.items():
        row(name, [scan for scan in ln.open_log(DATA / path) if scan.pose is not None])
    for path in sys.argv[1:]:
        row(Path(path).stem, recorded(Path(path)))
    for seed in range(1, 5):
        driven = office(seed, (40, 24)).drive(
            SENSORS["ld19"], seed=seed, speed=1.0, rate=8, people=10, wheels=Wheels()
        )
        row(f"storey {seed}", list(driven[0]))


if __name__ == "__main__":
    main()
