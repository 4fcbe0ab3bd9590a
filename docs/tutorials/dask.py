# %% [markdown]
# # Many logs on Dask
#
# A folder of logs becomes one data set: a file for each log, and a manifest
# that says how each ended. Here two processes on this machine do the work; the
# workers of a cluster have to see the same paths.

# %%
from pathlib import Path

from lineament.simulation import SCENES, SENSORS, simulate_log

Path("logs").mkdir()
for robot, sensor in enumerate(("utm30lx", "lms181")):
    for world in SCENES:
        path = f"logs/{world}-{robot}.npz"
        simulate_log(path, world, SENSORS[sensor], scans=40, seed=robot)
Path("logs/broken.bag").write_bytes(b"#ROSBAG V2.0\n")
print(*sorted(path.name for path in Path("logs").iterdir()))

# %% [markdown]
# ## Extract
#
# From the shell this is `lineament extract logs/ -o features/ --dask
# tcp://scheduler:8786`. Without `--dask` a process on each processor works.

# %%
import lineament as ln
from distributed import LocalCluster
from lineament.tasks.bulk import dask_executor, extract_logs

cluster = LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None)
with cluster, dask_executor(cluster.scheduler_address) as executor:
    print(extract_logs("logs", "features", ln.Extractor(), executor=executor))

# %% [markdown]
# One log is broken. It stops no other, and the manifest says what is wrong
# with it:

# %%
import pandas as pd

manifest = pd.read_json("features/_manifest.jsonl", lines=True)
manifest = manifest.set_index("name").sort_index()
print(manifest.query("outcome == 'failed'").error.item().rpartition("/")[2])
manifest[["outcome", "scans", "invalid", "bytes", "seconds"]].round(3)

# %% [markdown]
# ## Query
#
# pyarrow, DuckDB, Spark and Dask read the folder as one table with a column
# `log`, and only the columns and logs that a query asks for.

# %%
import pyarrow.dataset as ds

dataset = ds.dataset("features", partitioning="hive")
corners = dataset.to_table(
    columns=["log", "scan", "quality"],
    filter=(ds.field("kind") == "corner") & (ds.field("quality") > 0.8),
)
per_scan = corners.to_pandas().groupby("log").size() / 40

# %% [markdown]
# How many good corners does each scanner find in each world?

# %% alt="Good corners in a scan, by the world it was taken in and the scanner"
names = per_scan.index.str.removesuffix(".npz").str.split("-", expand=True)
bars = per_scan.set_axis(names).unstack().set_axis(["utm30lx", "lms181"], axis=1)
axes = bars.plot.bar(figsize=(7, 3.2), rot=0, color=["#0077bb", "#ee7733"])
_ = axes.set_ylabel("good corners a scan")

# %% [markdown]
# ## Again
#
# With `resume=True` (`--resume`) a run takes only the logs that are missing,
# have changed, or were done by another version or with other parameters. Here
# that is the broken one:

# %%
print(extract_logs("logs", "features", ln.Extractor(), resume=True))

# %% [markdown]
# [Many logs](../scale.md) says what happens if a worker dies or a disk is full,
# and what a day of a fleet of 10,000 robots costs.
