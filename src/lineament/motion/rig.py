"""The scanners of a robot: the topics of their scans, and where each is mounted."""

import math
import statistics
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from ..rosmsg.frames import Frames, Place, frame_of
from ..rosmsg.poses import StampedPose
from ..scan import Array, Pose
from ..scan.fields import checked_mounting

#: How well mountings are known, where nothing else is said: 1 cm and 0.5°, as by a ruler.
UNSURE = 0.01, math.radians(0.5)
#: Scans are of one time that are no farther apart than such a share of the slowest one's period.
TOGETHER = 0.55


@dataclass(frozen=True, slots=True)
class Rig:
    """The scanners of a robot.

    Parameters
    ----------
    topics : tuple of str
        The topics of their scans, two or more.
    mountings : mapping
        The pose of a scanner on the robot [m, m, rad] by its topic, where no transform has it.
    base_frame : str
        The frame of the robot.
    unsure : (float, float)
        Standard deviations of the mountings [m, rad].

    Raises
    ------
    ValueError
        If there are not two topics, one is there twice, a mounting is of another one, or a number
        makes no sense.

    Examples
    --------
    >>> rig = Rig(("/front", "/rear"), {"/rear": (-0.3, 0.0, 3.0)})
    >>> rig.place("/rear", "laser", Frames()).pose
    (-0.3, 0.0, 3.0)
    """

    topics: tuple[str, ...]
    mountings: Mapping[str, Pose] = field(default_factory=dict)
    base_frame: str = "base_link"
    unsure: tuple[float, float] = UNSURE

    def __post_init__(self) -> None:
        if len(self.topics) < 2:
            known = f": {self.topics[0]} alone" if self.topics else ""
            raise ValueError(f"expected the topics of two scanners or more{known}")
        if len({*self.topics}) < len(self.topics):
            raise ValueError(f"topics are {', '.join(self.topics)}, expected each of them once")
        for topic, pose in self.mountings.items():
            if topic not in self.topics:
                raise ValueError(
                    f"the mounting is of {topic}, expected one of {', '.join(self.topics)}"
                )
            checked_mounting(pose, f"mounting of {topic}")
        if not all(0 <= part < math.inf for part in self.unsure):
            raise ValueError(f"unsure is {self.unsure}, expected two numbers ≥ 0 [m, rad]")

    @property
    def covariance(self) -> Array:
        """Covariance (3, 3) of each mounting [m, m, rad]."""
        metres, turn = self.unsure
        return np.diag([metres, metres, turn]) ** 2

    def place(self, topic: str, frame_id: str, frames: Frames) -> Place:
        """Return where the scanner of a topic is on the robot; LookupError if that is not known.

        Where it is not given, by the frame of its scans.
        """
        if topic in self.mountings:
            return Place(self.mountings[topic])
        return frames.find(frame_of(self.base_frame), frame_of(frame_id), 0.0)


def fixed(links: Iterable[StampedPose]) -> Frames:
    """Return the frames of a robot that ``/tf_static`` has."""
    frames = Frames()
    for link in links:
        frames.add(link, is_fixed=True)
    return frames


def period_of(stamps: Iterable[float]) -> float:
    """Time from scan to scan [s], of scans at these times; 0 if they do not say.

    >>> period_of([0.0, 0.1, 0.2, 0.2, 0.5])
    0.1
    """
    steps = [later - stamp for stamp, later in pairwise(stamps) if later > stamp]
    return statistics.median_low(steps) if steps else 0.0
