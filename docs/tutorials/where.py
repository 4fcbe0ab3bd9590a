# %% [markdown]
# # From a bag to “where am I”
#
# A robot drives through a building once, and its bag becomes a plan. From then
# on a few metres of way show where on the plan the robot is, without a first
# guess, and how sure that is. The building is simulated, so we know the truth;
# people walk in it, and the wheels slip. Any other [log](../logs.md) does as
# well.

# %%
import lineament as ln
from lineament.simulation import SENSORS, office
from lineament.simulation.wheels import Wheels
from lineament.tasks.extract import extract_log


def record(name, building, seed):
    """Drive through a building; return a bag of ROS 2 and the true poses."""
    scans, truth = building.drive(
        SENSORS["utm30lx"], seed=seed, rate=5, people=3, wheels=Wheels()
    )
    ln.logs.save_log(f"{name}.npz", scans)
    extract_log(f"{name}.npz", f"{name}.ros2.mcap", ln.Extractor())
    return f"{name}.ros2.mcap", truth


storey = office(4, (30, 20))
monday, monday_truth = record("monday", storey, seed=1)
tuesday, tuesday_truth = record("tuesday", storey, seed=2)
print(len(monday_truth), "scans on Monday,", len(tuesday_truth), "on Tuesday")

# %% [markdown]
# ## Ten lines
#
# Monday’s bag becomes a plan. On Tuesday, when other people are about, the
# robot is switched on somewhere and drives a few metres:

# %%
from itertools import islice

from lineament.mapping import LineMap, LocalMap, locate
from lineament.tasks.mapping import map_log

map_log(monday, "plan.dxf")
plan = LineMap.read("plan.dxf", sigma=0.01)
extract, tracker, local = ln.Extractor(), ln.Tracker(), LocalMap()
for scan in islice(ln.open_log(tuesday), 200, 230):
    features = extract(scan)
    local.add(features, tracker(features))
where = locate(local, plan)
where

# %% [markdown]
# The [verdict](../locate.md) is one of four: located, ambiguous, a direction
# unobserved, or not on this map. Rely on a pose only if it is *located*. `sigma`
# says that the walls of the plan may be 1 cm off. The frame of the plan is that
# of Monday's first scan:

# %%
import numpy as np
from lineament.motion import relative

truth = relative(monday_truth[0], tuesday_truth[229])
x, y, turn = relative(truth, where.pose)
print(f"off by {1000 * np.hypot(x, y):.1f} mm and {np.degrees(turn):.2f}°")

# %% [markdown]
# A `LocalMap` keeps the last 5 m of the way. A single scan shows less; if rooms
# are alike, it may be ambiguous:

# %%
print(locate(features, plan))

# %% [markdown]
# ## A whole log
#
# From the shell two commands do this. The second follows the robot, and reports
# where it is lost. `--no-deskew` says that a scan is taken at once, as in this
# simulation.
#
# ```sh
# lineament map monday.ros2.mcap -o plan.dxf
# lineament locate tuesday.ros2.mcap --map plan.dxf -o tuesday.csv --no-deskew
# lineament view tuesday.ros2.mcap --map plan.dxf    # to look at it
# ```
#
# The table has a row for each scan: verdict, pose, covariance and evidence.

# %%
import pandas as pd
from lineament.tasks.locate import locate_log

done = locate_log(tuesday, "plan.dxf", "tuesday.csv", deskewed=False)
print(done.verdicts, f"lost {done.lost} times")
rows = pd.read_csv("tuesday.csv")
rows[["stamp", "verdict", "x", "y", "theta", "cov_xx", "explained"]].head(3)

# %% alt="The plan, where the robot was located on Tuesday, and what it saw at one place"
from matplotlib import pyplot as plt
from matplotlib.collections import LineCollection

figure, axes = plt.subplots(figsize=(6, 6))
axes.add_collection(LineCollection(list(plan.ends), colors="#1b1f24", lw=1))
true = np.array([relative(monday_truth[0], pose) for pose in tuesday_truth])
axes.plot(true[:, 0], true[:, 1], color="#bbbbbb", lw=4, label="truth")
colors = {"located": "#009988", "ambiguous": "#ee7733"}
for verdict, found in rows.groupby("verdict"):
    color = colors.get(verdict, "#cc3311")
    axes.plot(found.x, found.y, ".", ms=3, color=color, label=verdict)
c, s = np.cos(where.pose[2]), np.sin(where.pose[2])
seen = scan.points[scan.valid] @ [[c, s], [-s, c]] + where.pose[:2]
axes.plot(*seen.T, ".", ms=1, color="#0077bb", label="seen at one place")
axes.plot(*where.pose[:2], "o", color="#0077bb")
axes.legend(fontsize=7, loc="upper left", bbox_to_anchor=(1, 1))
_ = axes.set(aspect="equal", xlabel="x [m]", ylabel="y [m]")

# %% [markdown]
# Tuesday's errors, where it is located:

# %%
located = (rows.verdict == "located").to_numpy()
off = np.hypot(*(rows[["x", "y"]].to_numpy() - true[:, :2])[located].T)
print(f"{located.mean():.0%} located; median {1000 * np.median(off):.0f} mm,")
print(f"largest {1000 * off.max():.0f} mm")

# %% [markdown]
# The plan has Monday’s furniture. If all of it has moved, too many beams pass
# through where it was, and the verdict is that this is not the map:

# %%
wednesday, _ = record("wednesday", storey.refurnished(7), seed=3)
print(locate_log(wednesday, "plan.dxf", "wednesday.csv", deskewed=False).verdicts)

# %% [markdown]
# On the plan of another building the robot is nowhere:

# %%
other = LineMap.from_lines(office(5, (30, 20)).plan.segments)
print(locate(local, other).verdict)

# %% [markdown]
# [Where on a plan](../locate.md) says how the pose is found and how often it is
# right, [Maps](../maps.md) how the plan is made.
