# %% [markdown]
# # lineament in five minutes
#
# In five minutes you find the walls and corners of a scan, look at them, and
# write those of a whole log into a table.
#
# ## Install
#
# With Python 3.11 or newer:
#
# ```sh
# pip install lineament-*.whl    # or, from a checkout: pip install . (compiles some minutes)
# lineament --help
# ```
#
# ## A scan
#
# You give ranges and the geometry of the scanner. Here a simulated Hokuyo
# UTM-30LX stands in a hall with round columns:

# %%
import lineament as ln
import numpy as np
from lineament.simulation import SENSORS, scene

world, pose = scene("hall", seed=5)
ranges = SENSORS["utm30lx"].scan(world, pose, np.random.default_rng(1)).ranges

features = ln.extract(
    ranges, angle_min=-2.356, angle_increment=0.004363, range_max=30.0
)
features

# %% [markdown]
# A scan takes well below a millisecond. A notebook shows this table and picture.
# Each kind of feature is an array with named
# [fields](../reference/lineament.features.md#lineament.features.CORNER). These
# are the corners that will most likely be found again from another place, those
# with a [quality](../optimal.md#quality) above 0.9:

# %%
corners = features.corners[features.corners["quality"] > 0.9]
for corner in corners[:4]:
    x, y = corner["position"]
    sx, sy = 1000 * np.sqrt(np.diag(corner["covariance"]))
    print(f"{corner['kind']:6} at ({x:6.3f}, {y:6.3f}) m, ±({sx:.1f}, {sy:.1f}) mm")

# %% [markdown]
# ## A picture
#
# [Formats](../formats.md#pictures-of-plot-and-demo) explains the marks; `ax=`
# draws on your own axes.

# %% alt="The scan with its walls, corners and columns"
axes = features.plot()

# %% [markdown]
# ## Your own log
#
# Bags of ROS 1 and ROS 2, MCAP, CARMEN, g2o, CSV, npz and [others](../logs.md)
# open alike. Put yours in the place of this simulated one:

# %%
from lineament.simulation import simulate_log

simulate_log(
    "drive.npz", "building", SENSORS["utm30lx"], scans=200
)  # in place of drive.bag
log = ln.open_log("drive.npz")
log

# %% [markdown]
# From the shell:
#
# ```sh
# lineament info drive.bag             # topics, scans, rates, what is invalid
# lineament view drive.bag             # in the browser: play, compare, ask why
# lineament plot drive.bag --scan 40 -o scan.png
# ```
#
# ## A table
#
# `lineament extract drive.bag -o features.parquet` writes a row for each
# feature. In Python:

# %%
import pyarrow as pa

extract = ln.Extractor()  # keeps its buffers from scan to scan
tables = [extract(scan).to_arrow(scan=i) for i, scan in enumerate(log)]
corners = pa.concat_tables(tables).to_pandas().query("kind == 'corner'")
corners[["scan", "stamp", "x", "y", "quality", "corner"]].head()

# %% [markdown]
# ## Go on
#
# - The tutorials: [a bag to a data frame](frame.md), [corners in the
#   world](world.md), [where am I](where.md), [a docking
#   pose](dock.md), [live on a robot](live.md), [many logs
#   on Dask](dask.md).
# - [Real scans](../gallery.md), and [how good the results are](../results.md).
# - [The methods](../methods.md), and all of it [from Python](../python.md).
