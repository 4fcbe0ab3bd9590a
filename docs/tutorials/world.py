# %% [markdown]
# # Corners in the world
#
# Features are found in the frame of the scanner. Where a log has poses, lineament moves them into
# the world, covariances turned with them. This tutorial makes a map of corners from a drive, and
# asks how well one corner is known after it has been seen many times. The log is a recording of MIT
# CSAIL with the poses of a SLAM system or, where that is not at hand, a simulated building.

# %%
import os
from pathlib import Path

import lineament as ln
from lineament.simulation import SENSORS, simulate_log
from lineament.tasks.extract import extract_log

path = Path(os.environ.get("LINEAMENT_DATA", "."), "carmen/csail-corrected.log.gz")
if not path.exists():
    path = Path("building.npz")
    simulate_log(path, "building", SENSORS["utm30lx"])

print(extract_log(path, "world.parquet", ln.Extractor(), world=True))

# %% [markdown]
# From the shell that is
#
# ```sh
# lineament extract LOG -o world.parquet --world
# lineament extract LOG.bag -o world.parquet --world --poses '/tf:map->odom->base_link->laser'
# ```
#
# the second for a bag, where a topic has to say [which poses](../logs.md#ros-logs). Each row has the
# pose of its scan beside the feature:

# %%
import pandas as pd

frame = pd.read_parquet("world.parquet")
columns = ["scan", "pose_x", "pose_y", "pose_theta", "x", "y", "cov_00", "cov_01", "cov_11"]
corners = frame.query("kind == 'corner' and corner == 'corner' and quality > 0.9")
corners[columns].head().round(4)

# %% [markdown]
# Walls and corners, all in one frame, are a map:

# %% alt="Walls of the whole drive, its corners, and the way of the scanner"
import numpy as np
from matplotlib import pyplot as plt
from matplotlib.collections import LineCollection

walls = frame.query("kind == 'segment' and length > 0.3")
ends = walls[["start_x", "start_y", "end_x", "end_y"]].to_numpy().reshape(-1, 2, 2)
figure, axes = plt.subplots(figsize=(8, 6))
axes.add_collection(LineCollection(list(ends), colors="#1b1f24", linewidths=0.6, alpha=0.3))
axes.plot(corners.x, corners.y, ".", color="#cc3311", ms=2, label="corners")
axes.plot(frame.pose_x, frame.pose_y, ",", color="#0077bb")
axes.set(aspect="equal", xlabel="x [m]", ylabel="y [m]")
axes.autoscale()

# %% [markdown]
# ## One corner, seen many times
#
# Take the corner with the most neighbours within 10 cm, and draw each of its sightings with the
# ellipse that should hold 95 % of its errors. The ellipses point in different directions: a wall
# seen at a grazing angle says little about where along it the corner is, and that direction has been
# turned into the world with the rest.

# %% alt="The sightings of one corner, with their 95 % ellipses"
from matplotlib.patches import Ellipse

xy = corners[["x", "y"]].to_numpy()
near = np.array([(np.hypot(*(xy - p).T) < 0.1).sum() for p in xy])
place = np.hypot(*(xy - xy[near.argmax()]).T) < 0.1
covariances = corners[["cov_00", "cov_01", "cov_01", "cov_11"]].to_numpy().reshape(-1, 2, 2)

figure, axes = plt.subplots(figsize=(6, 5))
for p, covariance in zip(xy[place], covariances[place]):
    sizes, axis = np.linalg.eigh(covariance)
    width, height = 2 * np.sqrt(5.99 * sizes)
    turn = np.degrees(np.arctan2(*axis[::-1, 0]))
    axes.add_patch(Ellipse(p, width, height, angle=turn, fill=False, ec="#cc3311", alpha=0.5))
axes.plot(*xy[place].T, ".", color="#1b1f24", ms=3)
axes.set(aspect="equal", xlabel="x [m]", ylabel="y [m]")

# %% [markdown]
# ## What the ellipses leave out
#
# Weighted by their covariances, the sightings have a mean, and the mean a covariance. Where poses are
# exact, the sightings scatter by what their ellipses say, and χ² is near 1 per coordinate. Poses of a
# real drive are off by centimetres: then χ² is far above 1, and what limits the map is the poses.

# %%
weights = np.linalg.inv(covariances[place])
mean = np.linalg.solve(weights.sum(axis=0), np.einsum("nij,nj->i", weights, xy[place]))
off = xy[place] - mean
chi2 = np.einsum("ni,nij,nj->n", off, weights, off)
print(f"{place.sum()} sightings, mean ({mean[0]:.3f}, {mean[1]:.3f}) m")
print(f"scatter {1000 * off.std():.1f} mm, median χ² {np.median(chi2) / 1.39:.1f} times what is expected")

# %% [markdown]
# Bags say how well their poses are known, as `PoseWithCovarianceStamped` or `Odometry`. `--world`
# then adds that to the covariance of each feature, and in Python
# `features.transform(*scan.pose, scan.pose_covariance)` does. It is the same error for all features
# of a scan: [formats](../formats.md#in-the-world-world) has the formula, and what a mean over many
# scans does not take away.
