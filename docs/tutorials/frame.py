# %% [markdown]
# # A bag to a data frame
#
# From a recording to the questions one asks of it with pandas. The log is a ROS 1
# bag of two Hokuyo scanners that stand in an office while people walk by. Where
# that recording is not at hand, a simulated drive takes its place; the code is
# the same for every [format](../logs.md).

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
# `lineament info` reports what a log holds, and `ln.plot` draws a scan of it.
# Measurements have the colour of their cluster, diamonds are corners, smaller and
# lighter ones edges, where a wall ends before what is behind it.

# %% alt="A scan of the log, with segments, corners and clusters"
axes = ln.plot(path, scan=40)

# %% [markdown]
# ## Extract
#
# `lineament extract LOG -o features.parquet` does this from the shell: all scans,
# one row for each feature, in memory that does not grow with the log. Where a log
# has several topics, a column names that of each row.

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
# Columns that a kind does not fill are null: segments have a length, corners a
# quality, arcs a radius. [Formats](../formats.md#parquet-one-row-a-feature) lists
# them all.
#
# ## Ask
#
# How much wall is seen in each scan, and how many corners that can be relied on?

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
# And how well are they known? The covariance of a corner is in `cov_00`, `cov_01`
# and `cov_11`; the square root of its trace is the error to expect. Corners whose
# walls are long and near are known to a millimetre, those of short walls or far
# away to some centimetres. The axis is logarithmic.

# %% alt="Histogram of the standard deviations of the corners"
corners = frame.query("kind == 'corner'")
error = 1000 * (corners.cov_00 + corners.cov_11) ** 0.5
axes = error.plot.hist(
    bins=[0.5 * 1.3**k for k in range(22)], logx=True, figsize=(7, 3)
)
axes.set_xlabel("standard deviation of a corner [mm]")
_ = axes.set_ylabel("corners")

# %% [markdown]
# The same questions without pandas: DuckDB reads the file as it is,
#
# ```sql
# SELECT scan, sum(length) FROM 'features.parquet' WHERE kind = 'segment' GROUP BY scan;
# ```
#
# and polars, Arrow and Spark do as well. Next: [the same corners in the frame of
# the world](world.md).
