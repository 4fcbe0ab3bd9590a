"""`MergingPipeline`: the scanners of a robot as one, which stands where the robot does."""

from collections import Counter
from collections.abc import Iterator
from typing import NamedTuple

from .._copies import in_turn
from ..features import Features
from ..mapping.scanners import merge_features
from ..rosmsg.frames import Frames, Place
from ..scan import LaserScan, Pose
from ..scan.poses import Twist, compose, poses_along, relative
from .config import LiveConfig
from .pipeline import Frame, Pipeline
from .received import MANY, MOUNTINGS, ODOMETRY, Heard


class Seen(NamedTuple):
    """What a scanner saw last, when, where it is on the robot, and where that was, if known."""

    features: Features
    stamp: float
    mounting: Pose
    pose: Pose | None


class MergingPipeline(Pipeline):
    """Merges each scan of the first topic with the newest of the others, and goes on with that.

    Poses of scans are those of the robot, as is the odometry. What is merged stands in the frame of
    the robot.

    Examples
    --------
    >>> config = LiveConfig("/a", merge=("/b",), mountings={"/a": (0, 0, 0), "/b": (0, 0.1, 0)})
    >>> pipeline = MergingPipeline(config)
    >>> scan = LaserScan([2.0] * 5, angle_min=-0.02, angle_increment=0.01)
    >>> pipeline.frames("/b", scan)
    ()
    >>> (frame,) = pipeline.frames("/a", scan)
    >>> len(frame.scan), frame.scan.frame_id
    (10, 'base_link')
    """

    def __init__(self, config: LiveConfig) -> None:
        super().__init__(config)
        self._rig, self._tolerance = config.rig, config.tolerance
        self._frames, self._seen = Frames(), dict[str, Seen]()
        self._alone, self._why = Counter[str](), dict[str, str]()

    @in_turn
    def frames(self, publisher: str, scan: LaserScan) -> tuple[Frame, ...]:
        """Take a scan of one of the topics; return what all see, if it is of the first one."""
        place = self._place(publisher, scan)
        if place is None:
            return ()
        turned = scan.turned_over() if place.is_upside_down else scan
        found, twist = self._found(self._publisher(publisher), turned, place.pose)
        seen = Seen(found.features, found.scan.stamp, place.pose, found.scan.pose)
        self._seen[publisher] = seen
        if publisher != self._rig.topics[0]:
            return ()
        merged = self._merged(seen, twist)
        assert merged.scan is not None  # Merged features have one.
        merged.scan = merged.scan.with_pose(found.scan.pose, found.scan.pose_covariance)
        frame = Frame(merged.scan, merged.scan, merged, None)
        return (self._followed(self._publisher(""), frame, None),)

    @in_turn
    def hear(self, message: Heard, what: str = ODOMETRY) -> None:
        """Take what was heard beside the scans: mountings, too."""
        if isinstance(message, list) and what == MOUNTINGS:
            for link in message:
                self._frames.add(link, is_fixed=True)
        super().hear(message, what)

    def problems(self) -> Iterator[str]:
        """Yield why a scanner is left out, too."""
        yield from super().problems()
        yield from sorted(self._why.values())

    def _place(self, topic: str, scan: LaserScan) -> Place | None:
        """Where a scanner is on the robot; None if that is not known."""
        try:
            return self._rig.place(topic, scan.frame_id, self._frames)
        except LookupError as error:
            self._note_alone(topic, f"{error}, expected on /tf_static")
            return None

    def _merged(self, first: Seen, twist: Twist | None) -> Features:
        """Merge what the first scanner sees with what the others saw at about that time."""
        together = [first]
        for topic in self._rig.topics[1:]:
            seen = self._seen.get(topic)
            if seen is not None and abs(seen.stamp - first.stamp) <= self._tolerance:
                together.append(seen)
                self._alone[topic] = 0
            else:
                within = f"within {self._tolerance:g} s of those of {self._rig.topics[0]}"
                self._note_alone(topic, f"it has none {within}")
        return merge_features(
            [seen.features for seen in together],
            [_pose(seen, first, twist) for seen in together],
            self._rig.covariance,
            frame_id=self._rig.base_frame,
        )

    def _note_alone(self, topic: str, why: str) -> None:
        self._alone[topic] += 1
        if self._alone[topic] >= MANY:
            self._why[topic] = f"scans of {topic} are left out: {why}"


def _pose(seen: Seen, first: Seen, twist: Twist | None) -> Pose:
    """Return where a scanner was, from where the robot is at the time of the first scan.

    Where it went in between is known by the poses of a log, else by its twist.
    """
    if seen.pose is not None and first.pose is not None:
        return compose(relative(first.pose, seen.pose), seen.mounting)
    if twist is None:
        return seen.mounting
    x, y, theta = poses_along(twist, [seen.stamp - first.stamp])[0].tolist()
    return compose((x, y, theta), seen.mounting)
