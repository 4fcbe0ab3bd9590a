# %% [markdown]
# # From a bag to “where am I”
#
# A robot drives through a building once, and its bag becomes a plan. From then
# on a few metres of way show where on the plan the robot is, without a first
# guess, and how sure that is. The building is simulated, so we know the truth;
# people walk in it, and the wheels slip. Any other [log](../logs.md) does as
# well: two [recordings](#recorded-logs) follow, if they are at hand.

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
# where it is lost.
#
# ```sh
# lineament map monday.ros2.mcap -o plan.dxf
# lineament locate tuesday.ros2.mcap --map plan.dxf -o tuesday.csv
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
# ## Recorded logs
#
# A Jackal with a Velodyne drove through an arena of walls; its bag becomes an
# occupancy grid, as nav2 has it. Weeks before, it had turned at a lattice of
# places there, with a scan each quarter turn, seconds apart. They are located
# on the grid, without odometry. If the recordings are not at hand, Monday’s and
# Tuesday’s bags take their places. From the shell:
#
# ```sh
# lineament map DRIVE -o arena.yaml
# lineament locate VISIT --map arena.yaml --no-odometry -o visit.csv --picture visit.png
# ```

# %%
import os
from pathlib import Path

data = Path(os.environ.get("LINEAMENT_DATA", "."))
drive = data / "rosbag1/jackal_mocap.bag"
visit = data / "truth/jackal_static_data.npz"
if not (drive.exists() and visit.exists()):
    drive, visit = monday, tuesday
map_log(drive, "arena.yaml")
given = {"odometry": False, "deskewed": False, "picture": "visit.png"}
done = locate_log(visit, "arena.yaml", "visit.csv", **given)
print(done.verdicts, f"lost {done.lost} times")

# %% alt="Walls of the grid, and where the robot was on it"
from IPython.display import Image

Image("visit.png")

# %% [markdown]
# [Where on a plan](../locate.md) says how the pose is found and how often it is
# right, [Maps](../maps.md) how the plan is made.

# %% [markdown]
# ## As nav2 has it
#
# Monday's bag also becomes an occupancy grid, `map.yaml` and its image, which
# map_server and AMCL load. Tuesday's bag is played to the node, which takes
# AMCL's place ([lineament in nav2](../nav2.md)):
#
# ```sh
# lineament map monday.ros2.mcap -o map.yaml
# lineament live --from tuesday.ros2.mcap --map map.yaml
# ```
#
# Here a program without ROS subscribes to `amcl_pose`, as in
# [Live on a robot](live.md). The bag is played five times as fast.

# %%
import sys
from subprocess import PIPE, STDOUT, Popen

from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import make_idl_struct
from cyclonedds.idl.annotations import final
from cyclonedds.idl.types import array, float64, int32, uint32
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

map_log(monday, "map.yaml")
os.environ["CYCLONEDDS_URI"] = """<CycloneDDS><Domain>
<General><Interfaces><NetworkInterface address="127.0.0.1"/></Interfaces></General>
<Discovery><ParticipantIndex>auto</ParticipantIndex>
<Peers><Peer address="127.0.0.1"/></Peers></Discovery>
</Domain></CycloneDDS>"""  # this machine alone; on a robot it is left out
domain = 101 + os.getpid() % 100  # the ROS_DOMAIN_ID of the robot


def message(package, kind, **fields):
    return final(make_idl_struct(kind, f"{package}::msg::dds_::{kind}_", fields))


# fmt: off
f8 = float64
Time = message("builtin_interfaces", "Time", sec=int32, nanosec=uint32)
Header = message("std_msgs", "Header", stamp=Time, frame_id=str)
Point = message("geometry_msgs", "Point", x=f8, y=f8, z=f8)
Quaternion = message("geometry_msgs", "Quaternion", x=f8, y=f8, z=f8, w=f8)
Pose = message("geometry_msgs", "Pose", position=Point, orientation=Quaternion)
Spread = message("geometry_msgs", "PoseWithCovariance", pose=Pose, covariance=array[f8, 36])
Placed = message("geometry_msgs", "PoseWithCovarianceStamped", header=Header, pose=Spread)
# fmt: on
topic = Topic(DomainParticipant(domain), "rt/amcl_pose", Placed)
wanted = Qos(Policy.Reliability.Reliable(duration(seconds=1)))
reader = DataReader(topic.participant, topic, wanted)

options = f"live --from {tuesday} --map map.yaml --rate 5 --domain {domain}"
command = [sys.executable, "-m", "lineament", *options.split()]
node = Popen(command, stdout=PIPE, stderr=STDOUT, text=True)
off = []
for placed in reader.take_iter(timeout=duration(seconds=30)):
    stamp = placed.header.stamp.sec + placed.header.stamp.nanosec / 1e9
    at = placed.pose.pose.position
    truth = true[round(5 * stamp)]  # 5 scans a second
    off.append(np.hypot(at.x - truth[0], at.y - truth[1]))
    if len(off) == 200:
        break
node.terminate()
print(node.communicate(timeout=20)[0].splitlines()[-1])
print(f"median {1000 * np.median(off):.0f} mm, largest {1000 * max(off):.0f} mm")
