# %% [markdown]
# # A bag to a data frame
#
# A recording becomes a table, and pandas answers questions about it. The log is
# a ROS 1 bag of two Hokuyo scanners in an office where people walk by, or a
# simulated drive if the bag is not at hand; the code is the same for every
# [format](../logs.md).

# %%
import os
from pathlib import Path

import lineament as ln
from lineament.simulation import SENSORS, simulate_log

path = Path(os.environ.get("LINEAMENT_DATA", "."), "rosbag1/scans_demo.bag")
if not path.exists():
    path = Path("drive.npz")
    simulate_log(path, "building", SENSORS["utm30lx"], scans=300)

log = ln.open_log(path)
print(len(log), "scans on", *log.topics)

# %% [markdown]
# ## Look first
#
# `lineament info` prints what a log contains; `ln.plot` draws a scan.
# Measurements have the colour of their cluster. Diamonds are corners; smaller,
# lighter ones are edges, where a wall ends before something farther away.

# %% alt="A scan of the log, with segments, corners and clusters"
axes = ln.plot(path, scan=40)

# %% [markdown]
# ## Extract
#
# From the shell this is `lineament extract LOG -o features.parquet`: all scans,
# one row for each feature. If a log has several topics, the column `topic` names
# that of each row.

# %%
from lineament.tasks.extract import extract_log

done = extract_log(path, "features.parquet", ln.Extractor())
print(f"{done.scans} scans, {done.invalid:.1%} of beams invalid")
done.features

# %%
import pandas as pd

frame = pd.read_parquet("features.parquet")
frame.groupby("kind", observed=True)[
    ["x", "y", "length", "quality", "radius"]
].count()

# %% [markdown]
# A column that a kind does not fill is null: segments have a length, corners a
# quality, arcs a radius. [Formats](../formats.md#parquet-one-row-a-feature)
# lists them all.
#
# ## Ask
#
# How much wall does each scan see, and how many reliable corners?

# %%
scans = pd.DataFrame(
    {
        "wall [m]": frame.query("kind == 'segment'").groupby("scan").length.sum(),
        "corners": frame.query("kind == 'corner' and quality > 0.8")
        .groupby("scan")
        .size(),
    }
).fillna(0)
scans.describe().loc[["mean", "std", "min", "max"]].round(2)

# %% [markdown]
# How well are the corners known? The covariance is in `cov_00`, `cov_01` and
# `cov_11`; the square root of its trace is the error to expect: a millimetre for
# near corners of long walls, some centimetres for others. The axis is
# logarithmic.

# %% alt="Histogram of the standard deviations of the corners"
corners = frame.query("kind == 'corner'")
error = 1000 * (corners.cov_00 + corners.cov_11) ** 0.5
axes = error.plot.hist(
    bins=[0.5 * 1.3**k for k in range(22)], logx=True, figsize=(7, 3)
)
axes.set_xlabel("standard deviation of a corner [mm]")
_ = axes.set_ylabel("corners")

# %% [markdown]
# DuckDB, polars, Arrow and Spark read the same file:
#
# ```sql
# SELECT scan, sum(length) FROM 'features.parquet' WHERE kind = 'segment' GROUP BY scan;
# ```
#
# Next: [the same corners in the frame of the world](world.md).
