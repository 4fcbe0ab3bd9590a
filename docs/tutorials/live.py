# %% [markdown]
# # Live on a robot
#
# `lineament live` listens to a scanner and publishes its features over DDS.
# Every ROS 2 node can subscribe, and ROS need not be installed. Here a log
# plays the robot, in a process beside this notebook, which subscribes to the
# features as a program on the robot would.

# %%
import os
import sys
from subprocess import PIPE, STDOUT, Popen

from lineament.logs import save_log
from lineament.simulation import SENSORS, building, drive

way = [(0.8, 5.0), (12.0, 5.0)]  # down a corridor
scans = drive(building()[0], way, SENSORS["utm30lx"], speed=0.4, rate=10)
save_log("robot.npz", scans)

os.environ["CYCLONEDDS_URI"] = """<CycloneDDS><Domain>
<General><Interfaces><NetworkInterface address="127.0.0.1"/></Interfaces></General>
<Discovery><ParticipantIndex>auto</ParticipantIndex>
<Peers><Peer address="127.0.0.1"/></Peers></Discovery>
</Domain></CycloneDDS>"""  # this machine alone; on a robot it is left out
domain = 101 + os.getpid() % 100  # the ROS_DOMAIN_ID of the robot
options = f"live --from robot.npz --track --domain {domain}".split()
command = [sys.executable, "-m", "lineament", *options]
node = Popen(command, stdout=PIPE, stderr=STDOUT, text=True)
print(next(line for line in node.stdout if "finds features" in line))

# %% [markdown]
# On a robot, `lineament live --track` is enough: it takes the scans of `/scan`.
#
# ## Subscribe
#
# The features of a scan are one `sensor_msgs/PointCloud2` on `/scan/features`. A
# ROS 2 node subscribes by `create_subscription`. Without ROS, write the type
# down for Cyclone DDS (`pip install 'lineament[live]'`):

# %%
import numpy as np
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import make_idl_struct
from cyclonedds.idl.annotations import final
from cyclonedds.idl.types import int32, sequence, uint8, uint32
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration


def message(package, kind, **fields):
    return final(make_idl_struct(kind, f"{package}::msg::dds_::{kind}_", fields))


# fmt: off
u4 = uint32
Time = message("builtin_interfaces", "Time", sec=int32, nanosec=u4)
Header = message("std_msgs", "Header", stamp=Time, frame_id=str)
Field = message("sensor_msgs", "PointField", name=str, offset=u4, datatype=uint8, count=u4)
PointCloud2 = message("sensor_msgs", "PointCloud2", header=Header, height=u4, width=u4,
                      fields=sequence[Field], is_bigendian=bool, point_step=u4,
                      row_step=u4, data=sequence[uint8], is_dense=bool)
# fmt: on
participant = DomainParticipant(domain)
topic = Topic(participant, "rt/scan/features", PointCloud2)
reader = DataReader(participant, topic)

# %% [markdown]
# ## Read
#
# Each point is a feature, and its numbers are the named
# [fields](../formats.md#feature-cloud-sensor_msgspointcloud2) of the message.
# NumPy reads them as they are:

# %%
TYPES = {5: "<i4", 6: "<u4", 7: "<f4"}  # of PointField.datatype
clouds = []
for cloud in reader.take_iter(timeout=duration(seconds=20)):
    dtype = [(field.name, TYPES[field.datatype]) for field in cloud.fields]
    clouds.append((cloud.header.stamp, np.frombuffer(bytes(cloud.data), dtype)))
    if len(clouds) == 50:
        break

for stamp, points in clouds[::10]:
    kinds = np.bincount(points["kind"], minlength=4)
    time = stamp.sec + stamp.nanosec / 1e9
    print(f"{time:.1f} s:", *kinds, "segments, corners, arcs, edges")

# %% [markdown]
# ## Tracks
#
# With `--track` the field `track` is a number that lasts from scan to scan. This
# draws the walls of the last scan, and where its corners were before, in the
# frame of the scanner: the robot drives down a corridor, and the corners come
# towards it.

# %% alt="Walls of the last scan, and the ways of its corners in the frame of the scanner"
from matplotlib import pyplot as plt

figure, axes = plt.subplots(figsize=(8, 5))
last = clouds[-1][1]
for wall in last[last["kind"] == 0]:
    x, y = wall[["start_x", "end_x"]].item(), wall[["start_y", "end_y"]].item()
    axes.plot(x, y, color="#1b1f24")
corners = [points[points["kind"] == 1] for _, points in clouds]
for corner in corners[-1]:
    way = np.concatenate(
        [scan[scan["track"] == corner["track"]] for scan in corners]
    )
    axes.plot(way["x"], way["y"], ".-", color="#cc3311", ms=3, lw=0.8)
    axes.annotate(corner["track"], (corner["x"], corner["y"]), fontsize=8)
axes.plot(0, 0, ">", color="#0077bb", ms=9)
_ = axes.set(aspect="equal", xlabel="x [m]", ylabel="y [m]")

# %% [markdown]
# ## Stop
#
# SIGINT and SIGTERM end the node cleanly. Its last lines count what it did.

# %%
node.terminate()
print(node.stdout.read().strip())
print("exit status", node.wait(20))

# %% [markdown]
# [Live](../live.md) describes the other topics (`/scan/corners`,
# `/scan/markers` for RViz, `/scan/odometry`, `/scan/dock`), the options, and how
# to see the same in Foxglove.
