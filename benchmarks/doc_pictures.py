"""The pictures of recorded scans in docs/python.md and docs/live.md.

Run: python benchmarks/doc_pictures.py [-o docs], with LINEAMENT_DATA, and with pillow, rerun-sdk
and Xvfb (Debian: xvfb mesa-vulkan-drivers) for the screenshot of rerun.
"""

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image
from recordings import DATA

#: The log and the scan of docs/python.md, and the log of the screenshot.
SCAN = ("graph/killian.g2o.zip", 1890)
LOG = "rosbag1/jackal_mocap.bag"
#: What rerun's messages cover on the right is cut off [pixel, of a picture twice as wide].
WINDOW, CUT = (1500, 700), 1120


def run(*words: object) -> None:
    subprocess.run([str(word) for word in words], check=True)


def lineament(*words: object) -> None:
    run(sys.executable, "-m", "lineament", *words, "-q")


def shrink(picture: Path, to: Path, colours: int) -> None:
    with Image.open(picture) as image:
        image.convert("RGB").quantize(colours, dither=Image.Dither.NONE).save(to, optimize=True)
    print(f"{to}: {to.stat().st_size / 1000:.0f} kB")


def screenshot(folder: Path) -> Path:
    """What rerun's viewer shows of a log, from above."""
    import rerun.blueprint as rrb

    log, layout, picture = folder / "drive.rrd", folder / "layout.rbl", folder / "rerun.png"
    lineament("extract", DATA / LOG, "-o", log)
    eye = rrb.EyeControls3D(position=(0.5, -2.4, 5.6), look_target=(0.5, -1.0, 0.0))
    view = rrb.Spatial3DView(origin="world", name="scan and features", eye_controls=eye)
    panels = (rrb.SelectionPanel(state="hidden"), rrb.BlueprintPanel(state="hidden"))
    time = rrb.TimePanel(state="collapsed", timeline="scan")
    beside = rrb.Horizontal(view, rrb.TextDocumentView(), column_shares=(3, 1))
    rrb.Blueprint(beside, *panels, time).save("lineament", str(layout))
    size = "x".join(map(str, WINDOW))
    viewer = Path(sys.executable).with_name("rerun")
    run("xvfb-run", "-a", "-s", "-screen 0 1920x1200x24", viewer, log, layout,
        "--screenshot-to", picture, "--window-size", size)  # fmt: skip
    with Image.open(picture) as image:
        scale = image.width / WINDOW[0]
        cut = image.convert("RGB").crop((0, 0, round(CUT * scale), image.height))
        cut.resize((CUT, WINDOW[1]), Image.Resampling.LANCZOS).save(picture)
    return picture


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path, default=Path("docs"))
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        picture = Path(folder) / "scan.png"
        lineament("plot", DATA / SCAN[0], "--scan", SCAN[1], "-o", picture)
        shrink(picture, given.output / "scan.png", 64)
        shrink(screenshot(Path(folder)), given.output / "rerun.png", 128)


if __name__ == "__main__":
    main()
