# %% [markdown]
# # Corners in the world
#
# Features are found in the frame of the scanner. If a log has poses, lineament
# moves the features into the world and turns their covariances. This tutorial
# makes a map of corners from a drive, and asks how well one knows a corner that
# was seen many times. The log is a drive through an office building in Freiburg
# with the poses of a SLAM system, or a simulated one if that is not at hand.

# %%
import os
from pathlib import Path

import lineament as ln
from lineament.simulation import SENSORS, simulate_log
from lineament.tasks.extract import extract_log

path = Path(os.environ.get("LINEAMENT_DATA", "."), "truth/fr079_graph.npz")
if not path.exists():
    path = Path("building.npz")
    simulate_log(path, "building", SENSORS["utm30lx"])

done = extract_log(path, "world.parquet", ln.Extractor(), world=True)
print(done.scans, "scans,", done.features["corners"], "corners")

# %% [markdown]
# From the shell that is
#
# ```sh
# lineament extract LOG -o world.parquet --world
# lineament extract LOG.bag -o world.parquet --world \
#     --poses '/tf:map->odom->base_link->laser'
# ```
#
# For a bag, you say [which poses](../logs.md#poses). Each row has the pose of
# its scan. Standard deviations are the roots of the variances, here in mm:

# %%
import pandas as pd

frame = pd.read_parquet("world.parquet")
corners = frame.query("kind == 'corner' and corner == 'corner' and quality > 0.9")
corners = corners.assign(
    sd_x=1000 * corners.cov_00**0.5, sd_y=1000 * corners.cov_11**0.5
)
columns = ["scan", "pose_x", "pose_y", "pose_theta", "x", "y", "sd_x", "sd_y"]
corners[columns].head().round(3)

# %% [markdown]
# Walls and corners in one frame are a map:

# %% alt="Walls of the whole drive, its corners, and the way of the scanner"
import numpy as np
from matplotlib import pyplot as plt
from matplotlib.collections import LineCollection

walls = frame.query("kind == 'segment' and length > 0.3")
ends = walls[["start_x", "start_y", "end_x", "end_y"]].to_numpy().reshape(-1, 2, 2)
figure, axes = plt.subplots(figsize=(8, 6))
axes.add_collection(LineCollection(list(ends), colors="#1b1f24", lw=0.6, alpha=0.2))
axes.plot(corners.x, corners.y, ".", color="#cc3311", ms=3, mew=0)
axes.plot(frame.pose_x, frame.pose_y, color="#0077bb")
_ = axes.set(aspect="equal", xlabel="x [m]", ylabel="y [m]")

# %% [markdown]
# ## One corner, seen many times
#
# Take the corner with the most neighbours within 10 cm, and draw each sighting
# with the ellipse that should hold 95 % of its errors. The ellipses point in
# different directions: a wall at a grazing angle shows little of where along it
# the corner is.

# %% alt="The sightings of one corner, with their 95 % ellipses"
from matplotlib.patches import Ellipse

xy = corners[["x", "y"]].to_numpy()
near = np.array([(np.hypot(*(xy - p).T) < 0.1).sum() for p in xy])
place = np.hypot(*(xy - xy[near.argmax()]).T) < 0.1
covariances = corners[["cov_00", "cov_01", "cov_01", "cov_11"]].to_numpy()
covariances = covariances.reshape(-1, 2, 2)

figure, axes = plt.subplots(figsize=(6, 5))
for p, covariance in zip(xy[place], covariances[place]):
    sizes, axis = np.linalg.eigh(covariance)
    turn = np.degrees(np.arctan2(*axis[::-1, 0]))
    size = 2 * np.sqrt(5.99 * sizes)
    axes.add_patch(
        Ellipse(p, *size, angle=turn, fill=False, ec="#cc3311", alpha=0.5)
    )
axes.plot(*xy[place].T, ".", color="#1b1f24", ms=3)
_ = axes.set(aspect="equal", xlabel="x [m]", ylabel="y [m]")

# %% [markdown]
# ## What the ellipses leave out
#
# The ellipses show the noise of the scanner. The squared distances of the
# sightings from their weighted mean, over their covariances, should be χ² with
# two degrees of freedom, whose median is 1.39. In a simulation they are. On a
# real drive they are far larger: the poses are off by centimetres, and that
# limits the map.

# %%
weights = np.linalg.inv(covariances[place])
weighted = np.einsum("nij,nj->i", weights, xy[place])
mean = np.linalg.solve(weights.sum(axis=0), weighted)
off = xy[place] - mean
chi2 = np.median(np.einsum("ni,nij,nj->n", off, weights, off))
print(f"{place.sum()} sightings of ({mean[0]:.3f}, {mean[1]:.3f}) m")
print(f"scatter {1000 * off.std():.1f} mm, median of χ² {chi2:.1f}, expected 1.4")

# %% [markdown]
# The poses of a bag may have covariances (`PoseWithCovarianceStamped`,
# `Odometry`). `--world` adds them to the covariance of each feature; in Python
# `features.transform(*scan.pose, scan.pose_covariance)` does.
# [Formats](../formats.md#in-the-world-world) has the formula.
