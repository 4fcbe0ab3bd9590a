# %% [markdown]
# # A docking pose
#
# A robot that drives to a dock needs the pose of the dock in its frame, ten
# times a second, with a covariance that its controller can rely on. A corner
# gives such a pose: the position is where two walls meet, the x axis their
# bisector. lineament follows the corner by its track, and so mistakes no other
# corner for it.

# %%
import lineament as ln
import numpy as np
from lineament.motion import Dock, Odometer, compose
from lineament.simulation import SENSORS, drive, room

world, way = room(), [(-3.0, -1.5), (-0.5, 0.0), (2.0, 0.8)]
scans = list(drive(world, way, SENSORS["utm30lx"], speed=0.5, rate=10, seed=3))
print(len(scans), "scans, the first from", scans[0].pose)

# %% [markdown]
# The drive is simulated, so we know the truth: the corner is at (3, 2) of the
# room. On a robot the scans come from a log or a topic.
#
# ## Choose a corner
#
# `Dock` takes a point in the frame of the first scan, and chooses the corner
# nearest to it, within a metre. The tracker matches features to those of the
# last scan and gives the motion between; the odometer adds the motions up.

# %% alt="The first scan, with the corner that is followed"
from lineament.motion import inverse

extract, tracker, odometer = ln.Extractor(), ln.Tracker(), Odometer()
x, y, _ = compose(inverse(scans[0].pose), (3.0, 2.0, 0.0))
dock = Dock((x, y))

axes = extract(scans[0]).plot()
_ = axes.plot(x, y, "o", ms=18, mfc="none", mec="#0077bb", mew=2)

# %% [markdown]
# ## Follow it

# %%
found = []
for scan in scans:
    features = extract(scan)
    tracks = tracker(features)
    travel = odometer(tracks, scan.stamp)
    found.append(dock(features, tracks, travel.pose))

seen = [i for i, corner in enumerate(found) if corner is not None]
last = found[seen[-1]]
print(
    f"seen in {len(seen)} of {len(scans)} scans; in the last at",
    np.round(last.pose, 3),
)
sigma = np.sqrt(np.diag(last.covariance))
print("standard deviations [mm, mm, mrad]:", (1000 * sigma).round(2))

# %% [markdown]
# Where the corner is hidden, `dock` gives None, and the controller goes on by
# odometry.
#
# ## Is the covariance right?
#
# The true pose of the scanner puts the corner into the room. Errors should stay
# within two standard deviations in 19 of 20 scans. The band narrows as the robot
# comes closer.

# %% alt="Errors of the pose of the corner along the drive, within two standard deviations"
from matplotlib import pyplot as plt

in_room = np.array([compose(scans[i].pose, found[i].pose) for i in seen])
errors = in_room - (3.0, 2.0, -3 * np.pi / 4)
sigma = []
for i in seen:
    c, s = np.cos(scans[i].pose[2]), np.sin(scans[i].pose[2])
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    sigma.append(np.sqrt(np.diag(turn @ found[i].covariance @ turn.T)))
sigma = np.array(sigma)

figure, panels = plt.subplots(3, 1, figsize=(8, 6), sharex=True)
for k, (axes, name) in enumerate(
    zip(panels, ("x [mm]", "y [mm]", "heading [mrad]"))
):
    band = 2000 * sigma[:, k]
    axes.fill_between(seen, -band, band, color="#0077bb", alpha=0.25)
    axes.plot(seen, 1000 * errors[:, k], ".", color="#1b1f24", ms=4)
    axes.set_ylabel(name)
panels[-1].set_xlabel("scan")
print(f"within two standard deviations: {(np.abs(errors) < 2 * sigma).mean():.0%}")

# %% [markdown]
# ## On the robot
#
# The node publishes the pose as `geometry_msgs/PoseWithCovarianceStamped`:
#
# ```sh
# lineament live --dock 5.3 1.8    # the corner nearest to this point, in the first scan
# lineament live --dock-track 17   # or the one with this track
# ```
#
# The covariance is that of the noise alone. Real walls are not straight: the
# field `misfit` of both segments says how far off they are.
# [Live](../live.md#docking) also follows shapes, such as a V or a pallet.
