"""Many recorded scans on one sheet, and the stages of each: to be looked at.

Run: python benchmarks/contact_sheet.py [-m METHOD] [--new SEED] -o FOLDER, with LINEAMENT_DATA.
By `--new` two scans by chance of each of fifteen recordings, six a sheet, in place of those that
are always drawn. By `--plans FOLDER` one sheet of the walls of all grids (.yaml) in a folder, such
as nav2_bringup/maps.
"""

import argparse
from pathlib import Path
from random import Random

from matplotlib.collections import LineCollection
from recordings import DATA

from lineament import Extractor, open_log
from lineament.errors import LineamentError
from lineament.mapping import LineMap
from lineament.output.canvas import INK, figure_bytes, new_panels, style_plane
from lineament.output.figures import scan_title, scans_figure
from lineament.output.stages import trace_figure
from lineament.walls import lengths_of

#: Scans that are drawn, by the number that `lineament plot --scan` takes: first those at which
#: faults were seen, then one of each further recording.
SHEET = (
    ("rosbag1/jackal_mocap.bag", 231),
    ("carmen/acapulco-corrected.log.gz", 22),
    ("carmen/acapulco-corrected.log.gz", 200),
    ("text/rplidar_kitchenette/scans_2025-09-04-16-43-09.json", 0),
    ("text/rplidar_kitchenette/scans_2025-09-04-16-51-11.json", 2),
    ("text/dpslam_loop5.log.gz", 200),
    ("carmen/intel-corrected.log.gz", 257),
    ("carmen/intel-corrected.log.gz", 300),
    ("carmen/csail-corrected.log.gz", 100),
    ("carmen/aces-corrected.log.gz", 100),
    ("graph/killian.g2o.zip", 1900),
    ("truth/fr079_graph.npz", 700),
    ("truth/jackal_static_data.npz", 175),
    ("rosbag1/corridor_alternating_beams.bag", 2400),
    ("rosbag1/demo_stationary_simple_environment.bag", 600),
    ("rosbag1/scans_demo.bag", 330),
    ("rosbag1/urg_handheld_v2_old.bag", 180),
    ("rosbag1/urg_v1_2.bag", 60),
    ("rosbag2/ld19", 200),
    ("rosbag2/two_publishers", 250),
    ("text/tinyslam_exp1.dat.gz", 380),
    ("text/lidar01.csv", 0),
)
#: Recordings that `--new` leaves out: few scans, or the same data as another.
FEW = ("jackal_mocap.bag", "scans_2025", "lidar01", "urg_v1_2", "two_publishers", "stationary")


def new_scans(seed: int) -> list[tuple[str, int]]:
    """Return two scans of each recording, by chance."""
    logs = {file: None for file, _ in SHEET if not any(part in file for part in FEW)}
    logs |= dict.fromkeys(("truth/obstdet_front_scan.npz", "truth/jackal_mocap_02171554.npz"))
    chance, there = Random(seed), [file for file in logs if (DATA / file).exists()]
    lengths = [len(open_log(DATA / file, keep_going=True)) for file in there]
    return [
        (file, k)
        for file, n in zip(there, lengths, strict=True)
        for k in sorted(chance.sample(range(n), 2))
    ]


def draw_plans(folder: Path, output: Path) -> None:
    """Draw the walls of each grid in a folder that is one."""
    plans = {}
    for path in sorted(folder.glob("*.yaml")):
        try:
            plans[path.name] = LineMap.read(path)
        except LineamentError as error:
            print(error)
    figure, panels = new_panels(len(plans), 2)
    for axes, (name, plan) in zip(panels, plans.items(), strict=True):
        about = f"{len(plan.walls)} walls, {lengths_of(plan.walls).sum():.0f} m"
        style_plane(axes, name, about, plan.ends.reshape(-1, 2))
        axes.add_collection(LineCollection(list(plan.ends), colors=INK, linewidths=0.6))
    (output / "plans.png").write_bytes(figure_bytes(figure, dpi=110))
    print(f"{len(plans)} plans, drawn in {output}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("-m", "--method", default="optimal")
    parser.add_argument("--new", type=int, metavar="SEED")
    parser.add_argument("--plans", type=Path, metavar="FOLDER")
    given = parser.parse_args()
    given.output.mkdir(parents=True, exist_ok=True)
    if given.plans:
        draw_plans(given.plans, given.output)
        return
    extract, scans = Extractor(given.method), []
    for file, number in SHEET if given.new is None else new_scans(given.new):
        if not (DATA / file).exists():
            continue
        scan = open_log(DATA / file, keep_going=True).scan(number)
        title = scan_title(file, number, scan)
        scans.append((title, scan, extract(scan)))
        figure = trace_figure(extract.trace(scan), title=f"{title} · {given.method}")
        (given.output / f"trace_{len(scans):02}.png").write_bytes(figure_bytes(figure, dpi=75))
    for k in range(0, len(scans) if given.new is not None else 0, 6):
        sheet = scans_figure(scans[k : k + 6], title="")
        (given.output / f"new_{k // 6}.png").write_bytes(figure_bytes(sheet, dpi=110))
    for name, dark in (("light", False), ("dark", True)):
        sheet = scans_figure(scans, title=f"What {given.method} finds", dark=dark)
        (given.output / f"scans_{name}.png").write_bytes(figure_bytes(sheet, dpi=75))
    print(f"{len(scans)} scans, drawn in {given.output}")


if __name__ == "__main__":
    main()
