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
from ..scan import LaserScan, Pose
from .config import LiveConfig
from .localiser import Localiser


class LiveMapper(Localiser):
    """Follows a robot as a `Localiser` does, on the map that its first scanner makes."""

    def __init__(self, config: LiveConfig, extract: Callable[[LaserScan], Features]) -> None:
        super().__init__(config, None, extract)
        assert config.mapping is not None
        read = [path for path in (config.log, config.dock_shape) if path is not None]
        check_outputs(all_files(config.mapping), read)
        self._mapper: Mapper | None = None
        self._frame = ""

    @property
    def plan(self) -> LineMap | None:
        """The map so far; None before there is one."""
        draft = None if self._mapper is None else self._mapper.draft
        return None if draft is None else draft.map

    def problems(self) -> Iterator[str]:
        """Yield what keeps the robot from being placed, and whether no loops are closed."""
        yield from super().problems()
        if self._mapper is not None and not self._mapper.is_making:
            yield "the process that closes loops has ended: the map is made when the node stops"

    def save(self) -> str:
        """Write the map; return a line about it."""
        path = self._config.mapping
        if self._mapper is None or path is None:
            return "no map: there was no scan"
        try:
            made = self._mapper.finish()
        except NothingFoundError as error:
            return f"no map: {error}"
        made.write(path)
        way, unsure = sum(made.ways), sum(way for *_, way in made.unsure)
        parts = f" in {made.parts.count} parts" if made.parts.count > 1 else ""
        return f"{path}: {made.map}{parts}, not sure on {unsure:.1f} m of {way:.1f} m"

    def close(self) -> None:
        """End what runs beside it."""
        if self._mapper is not None:
            self._mapper.close()

    @property
    def _is_ready(self) -> bool:
        return True

    def _followed(
        self,
        features: Features,
        scan: LaserScan,
        laser: Pose | None,
        *,
        is_deskewed: bool,  # noqa: ARG002
    ) -> Whereabouts:
        """Take the next scan into the map."""
        frame = scan.frame_id
        if self._mapper is None:
            self._mapper, self._frame = Mapper(), frame
        if self._frame != frame:
            raise ValueError(f"its frame is {frame!r}, but a map is made of {self._frame!r} alone")
        return self._mapper.step(features, laser)
