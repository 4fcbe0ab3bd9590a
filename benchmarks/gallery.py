"""Draws the pictures of docs/gallery.md from recordings.

Run: python benchmarks/gallery.py, with LINEAMENT_DATA.
"""

import io
from pathlib import Path

from matplotlib.figure import Figure
from PIL import Image
from recordings import DATA

from lineament import Extractor, open_log, plot
from lineament.output.canvas import figure_bytes, new_figure
from lineament.output.figures import map_figure

FOLDER = Path(__file__).parents[1] / "docs" / "gallery"
#: Name of each picture, its log, and its scan; without one it is the map of the whole drive.
PICTURES = {
    "intel": ("carmen/intel-corrected.log.gz", 660),
    "handheld": ("rosbag1/urg_handheld_v2_old.bag", 125),
    "freiburg": ("truth/fr079_graph.npz", 75),
    "csail": ("carmen/csail-corrected.log.gz", 365),
    "killian": ("graph/killian.g2o.zip", 3250),
    "arena": ("rosbag1/jackal_mocap.bag", 110),
    "people": ("rosbag1/scans_demo.bag", 490),
    "targets": ("text/rplidar_kitchenette/scans_2025-09-04-16-51-11.json", 2),
    "ld19": ("rosbag2/ld19", 105),
    "tinyslam": ("text/tinyslam_exp1.dat.gz", 475),
    "clutter": ("carmen/intel-corrected.log.gz", 257),
    "map": ("truth/fr079_graph.npz", None),
}


def drawn(file: str, number: int | None) -> Figure:
    log = open_log(DATA / file, keep_going=True)
    if number is None:
        extract = Extractor()
        return map_figure(((scan.pose, extract(scan)) for scan in log), Path(file).name)
    figure = new_figure(4.9, 4.5)
    plot(log, number, ax=figure.subplots()).get_legend().remove()
    return figure


def main() -> None:
    FOLDER.mkdir(exist_ok=True)
    for name, (file, number) in PICTURES.items():
        # Few colours are enough for lines, in a quarter of the bytes; paper is transparent.
        dpi, colors = (140, 96) if number is not None else (80, 32)
        picture = Image.open(io.BytesIO(figure_bytes(drawn(file, number), dpi=dpi))).convert("RGB")
        few = picture.quantize(colors, dither=Image.Dither.NONE)
        path = FOLDER / f"{name}.png"
        few.save(path, optimize=True, transparency=few.getpixel((0, 0)))
        print(f"{path.name}: {few.size}, {path.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
