"""What a live node says on the topics of ROS of a pose on a plan, its own or somebody else's."""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING, NamedTuple

from ..output.ros_messages import RosMessages
from ..output.scene import Layer, Message, Moment
from ..scan.fields import NANO
from .config import LiveConfig
from .pipeline import Frame, stamp_of

if TYPE_CHECKING:
    from ..mapping import LineMap
    from ..mapping.evidence import Evidence
    from ..mapping.following import Whereabouts
    from ..mapping.judging import Judgement
    from .publisher import Publisher

DIAGNOSTICS = "/diagnostics"
_PLACED, _STATUSES = "geometry_msgs/PoseWithCovarianceStamped", "diagnostic_msgs/DiagnosticArray"


class Status(NamedTuple):
    """A status of diagnostics: of what, its level (0 OK, 1 warning, 2 error, 3 stale), and why."""

    name: str
    level: int
    summary: str
    values: dict[str, str]

    def message(
        self, make: RosMessages, config: LiveConfig, topic: str, time: tuple[int, int]
    ) -> Message:
        """Make the message of a node for a topic."""
        return make.diagnostics(
            topic,
            Moment(*time, "", ""),
            name=f"{config.name}: {self.name}",
            hardware_id=config.scan_topic,
            level=self.level,
            summary=self.summary,
            values=self.values,
        )


def plan_layers(plan: LineMap) -> tuple[Layer, ...]:
    """Return the walls of a plan as they are drawn."""
    return (Layer("plan", (0.5, 0.5, 0.5, 1.0), 0.02, plan.ends),)


class PlanTopics:
    """Publishes poses, the transform of the odometry and verdicts, and nothing that is not known.

    Parameters
    ----------
    publisher : Publisher
    messages : RosMessages
        Makes the messages.
    config : LiveConfig
        The pose of the scanner goes to ``TOPIC/pose``, the walls of a map that is made to
        ``TOPIC/plan``. The pose of the robot goes to ``amcl_pose``, and the transform from
        `map_frame` to `odom_frame` to ``/tf``; or the verdict on each pose of the topic `judge` to
        ``JUDGE/verdict``, and where it is wrong ours to ``JUDGE/ours``.
    """

    def __init__(self, publisher: Publisher, messages: RosMessages, config: LiveConfig) -> None:
        self._publisher, self._make, self._config = publisher, messages, config
        self._pose = f"{config.scan_topic}/pose"
        self._frame: Frame | None = None
        self._statuses: list[Status] = []
        topics = {self._pose: _PLACED}
        if (judged := config.judge_topic) is not None:
            topics |= {f"{judged}/verdict": _STATUSES, f"{judged}/ours": _PLACED}
        elif config.is_broadcasting:
            topics["/tf"] = "tf2_msgs/TFMessage"
        self._walls = f"{config.scan_topic}/plan"
        if config.mapping is not None:
            topics[self._walls] = "visualization_msgs/MarkerArray"
        for topic, kind in topics.items():
            publisher.advertise(topic, messages.kind(kind))
        if judged is None:  # As of AMCL, whose listeners ask for the last one.
            publisher.advertise(
                config.resolved("amcl_pose"), messages.kind(_PLACED), is_latched=True
            )

    def publish(self, frame: Frame, moment: Moment) -> None:
        """Publish what is known of a scan; a verdict that is another one than before, at once."""
        config, make, offer = self._config, self._make, self._publisher.offer
        before, self._frame, self._statuses = self._statuses, frame, statuses(frame, config)
        if [one[:3] for one in before] != [one[:3] for one in self._statuses]:
            self.diagnose(divmod(time.time_ns(), NANO))
        on_plan, where, placed = moment._replace(frame=config.map_frame), frame.where, frame.placed
        if where is not None and where.is_known:
            offer(self._pose, lambda to: make.placed(to, on_plan, where.pose, where.covariance))
        if config.judge_topic is not None:
            self._publish_judgement(frame, on_plan)
        elif placed is not None:
            base, odom = (placed.base, placed.covariance), placed.odom
            offer(config.resolved("amcl_pose"), lambda to: make.placed(to, on_plan, *base))
            if odom is not None and config.is_broadcasting:
                until = frame.scan.stamp_ns + round(config.transform_tolerance * NANO)
                link = Moment(*stamp_of(until), config.odom_frame, config.map_frame)
                offer("/tf", lambda to: make.transform(to, link, odom))

    def diagnose(self, time: tuple[int, int], *, is_stale: bool = False) -> None:
        """Publish verdicts on ``/diagnostics``."""
        if self._frame is None:
            return
        for status in self._statuses:
            if is_stale:
                status = status._replace(level=3, summary="no scans")
            self._publisher.publish(status.message(self._make, self._config, DIAGNOSTICS, time))
        if (plan := self._frame.plan) is not None:
            on_map, make = Moment(*time, *[self._config.map_frame] * 2), self._make
            self._publisher.offer(
                self._walls, lambda to: make.features(to, on_map, plan_layers(plan))
            )

    def _publish_judgement(self, frame: Frame, on_plan: Moment) -> None:
        """Publish the verdict on somebody else's pose, and where it is wrong ours, if known."""
        config, make, offer = self._config, self._make, self._publisher.offer
        placed, judgement, status = frame.placed, frame.judgement, self._statuses[-1]
        if judgement is None:
            return
        stamp = on_plan.seconds, on_plan.nanoseconds
        offer(f"{config.judge_topic}/verdict", lambda to: status.message(make, config, to, stamp))
        if placed is not None and judgement.off is not None and status.level == 2:
            ours = placed.base, placed.covariance
            offer(f"{config.judge_topic}/ours", lambda to: make.placed(to, on_plan, *ours))


def statuses(frame: Frame, config: LiveConfig) -> list[Status]:
    """Statuses of our pose, and then of one that is judged."""
    where, placed = frame.where, frame.placed
    if where is None:
        return [Status(f"{config.scan_topic}/pose", 2, f"no map on {config.map_topic}", {})]
    level, summary = 0 if where else 1 if where.is_known else 2, where.verdict
    if where.is_known and config.is_localiser and (placed is None or placed.odom is None):
        unknown = "where the scanner is mounted" if placed is None else "odometry"
        level, summary = max(level, 1), f"{summary}, without {unknown}"
    found = [Status(f"{config.scan_topic}/pose", level, summary, _figures(where))]
    if config.judge_topic is not None:
        found.append(_status(config.judge_topic, frame.judgement))
    return found


def _status(topic: str, judgement: Judgement | None) -> Status:
    """Status of a pose that is judged; not sure while there is none, or no odometry."""
    if judgement is None:
        return Status(topic, 1, "not sure: no pose to judge", {})
    level = {"right": 0, "not sure": 1, "wrong": 2}[judgement.verdict]
    values = _shares(judgement.evidence)
    if judgement.off is not None:
        x, y, turn = judgement.off
        values |= {"off [m]": f"{math.hypot(x, y):.3f}", "off [°]": f"{math.degrees(turn):.2f}"}
    return Status(topic, level, judgement.verdict, values)


def _figures(where: Whereabouts) -> dict[str, str]:
    """Pose, deviations and evidence by name, as text."""
    (x, y, theta), variances = where.pose, where.covariance.diagonal()
    of_x, of_y, of_theta = map(math.sqrt, variances.tolist())
    return {
        "x [m]": f"{x:.3f} ± {of_x:.3f}",
        "y [m]": f"{y:.3f} ± {of_y:.3f}",
        "theta [°]": f"{math.degrees(theta):.2f} ± {math.degrees(of_theta):.2f}",
        **_shares(where.evidence),
    }


def _shares(evidence: Evidence) -> dict[str, str]:
    return {
        "explained [%]": f"{100 * evidence.explained:.1f}",
        "contradicted [%]": f"{100 * evidence.contradicted:.1f}",
        "log odds": f"{evidence.log_odds:.1f}",
    }
