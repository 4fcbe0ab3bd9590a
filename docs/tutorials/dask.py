# %% [markdown]
# # Many logs on Dask
#
# A folder of logs becomes one data set: a file for each log, whole or not at all,
# and a manifest that says what became of each. The work is spread over the
# workers of a Dask cluster; here two processes on this machine, elsewhere
# whatever your cluster is, if its workers see the same paths.

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
# `lineament extract logs/ -o features/ --dask tcp://scheduler:8786` is the same
# from the shell; without `--dask` the logs go to a process on each processor.

# %%
import lineament as ln
from distributed import LocalCluster
from lineament.tasks.bulk import dask_executor, extract_logs

cluster = LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None)
with cluster, dask_executor(cluster.scheduler_address) as executor:
    print(extract_logs("logs", "features", ln.Extractor(), executor=executor))

# %% [markdown]
# One log was broken. It has stopped no other, and the manifest, one line of JSON
# a log, says what is wrong with it:

# %%
import pandas as pd

manifest = pd.read_json("features/_manifest.jsonl", lines=True)
manifest = manifest.set_index("name").sort_index()
print(manifest.query("outcome == 'failed'").error.item().rpartition("/")[2])
manifest[["outcome", "scans", "invalid", "bytes", "seconds"]].round(3)

# %% [markdown]
# ## Query
#
# pyarrow, DuckDB, Spark and Dask itself read the folder as one table with a
# column `log`, and only the columns and logs that a query asks for.

# %%
import pyarrow.dataset as ds

dataset = ds.dataset("features", partitioning="hive")
corners = dataset.to_table(
    columns=["log", "scan", "quality"],
    filter=(ds.field("kind") == "corner") & (ds.field("quality") > 0.8),
)
per_scan = corners.to_pandas().groupby("log").size() / 40

# %% [markdown]
# In this case: how many good corners each scanner finds in each world.

# %% alt="Good corners in a scan, by the world it was taken in and the scanner"
names = per_scan.index.str.removesuffix(".npz").str.split("-", expand=True)
bars = per_scan.set_axis(names).unstack().set_axis(["utm30lx", "lms181"], axis=1)
axes = bars.plot.bar(figsize=(7, 3.2), rot=0, color=["#0077bb", "#ee7733"])
_ = axes.set_ylabel("good corners a scan")

# %% [markdown]
# ## Again
#
# With `resume=True` (`--resume`) a run does only what is missing, or was done by
# another version, with other parameters, or on a log that has changed since. Here
# that is the broken log, and it is tried again:

# %%
print(extract_logs("logs", "features", ln.Extractor(), resume=True))

# %% [markdown]
# [Many logs](../scale.md) has what becomes of workers that die, disks that fill
# up and logs in object stores, and what a day of a fleet of 10,000 robots costs.
