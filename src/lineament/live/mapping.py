"""`LiveMapper`: where a robot is on a map that is made of its scans meanwhile."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from ..errors import NothingFoundError
from ..features import Features
from ..files import check_outputs
from ..mapping import LineMap
from ..mapping.following import Whereabouts
from ..mapping.grids import all_files
from ..mapping.mapper import Mapper
from ..scan import Array, LaserScan, Pose
from ..scan.poses import Twist
from .config import LiveConfig
from .localiser import Localiser


class LiveMapper(Localiser):
    """Follows a robot as a `Localiser` does, on the map that its first scanner makes."""

    def __init__(self, config: LiveConfig, extract: Callable[[LaserScan], Features]) -> None:
        super().__init__(config, None, extract)
        assert config.mapping is not None
        read = [path for path in (config.log, config.dock_shape) if path is not None]
        check_outputs(all_files(config.mapping), read)
        self._following: _Following | None = None

    @property
    def plan(self) -> LineMap | None:
        """The map so far; None before there is one."""
        draft = None if self._following is None else self._following.mapper.draft
        return None if draft is None else draft.map

    def problems(self) -> Iterator[str]:
        """Yield what keeps the robot from being placed, and whether no loops are closed."""
        yield from super().problems()
        if self._following is not None and not self._following.mapper.is_making:
            yield "the process that closes loops has ended: the map is made when the node stops"

    def save(self) -> str:
        """Write the map; return a line about it."""
        path = self._config.mapping
        if self._following is None or path is None:
            return "no map: there was no scan"
        try:
            made = self._following.mapper.finish()
        except NothingFoundError as error:
            return f"no map: {error}"
        made.write(path)
        way, unsure = sum(made.ways), sum(way for *_, way in made.unsure)
        parts = f" in {made.parts.count} parts" if made.parts.count > 1 else ""
        return f"{path}: {made.map}{parts}, not sure on {unsure:.1f} m of {way:.1f} m"

    def close(self) -> None:
        """End what runs beside it."""
        if self._following is not None:
            self._following.mapper.close()

    @property
    def _is_ready(self) -> bool:
        return True

    def _follower(self, frame: str) -> _Following:
        if self._following is None:
            self._following = _Following(frame)
        if self._following.frame != frame:
            raise ValueError(
                f"its frame is {frame!r}, but a map is made of {self._following.frame!r} alone"
            )
        return self._following


class _Following:
    """A mapper in the place of a `Follower`."""

    def __init__(self, frame: str) -> None:
        self.frame, self.mapper = frame, Mapper()

    @property
    def twist(self) -> Twist | None:
        """Velocity of the sensor: it is not estimated."""
        return None

    def __call__(self, features: Features, odometry: Pose | None, skew: Pose) -> Whereabouts:  # noqa: ARG002
        """Take in the next scan."""
        return self.mapper.step(features, odometry)

    def suppose(self, pose: Pose, covariance: Array | None) -> None:
        """Do nothing: a map begins where the robot stands."""
