"""What a configuration names: the extractor, the plan, and what is docked to."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..extractor import Extractor
from ..methods import get_method
from ..motion import Dock
from .config import LiveConfig

if TYPE_CHECKING:
    from ..docking import ShapeDock
    from ..mapping import LineMap


def extractor_of(config: LiveConfig) -> Extractor:
    """Make the extractor that is configured."""
    return Extractor(get_method(config.method, **config.parameters), noise=config.noise)


def plan_of(config: LiveConfig) -> LineMap | None:
    """Read the plan that is configured, if it is a file."""
    if config.map is None or config.map_topic is not None:
        return None
    from ..mapping import LineMap

    layers = config.layers.split(",") if config.layers else None
    return LineMap.read(config.map, layers, units=config.units, limits=config.limits)


def dock_of(config: LiveConfig) -> Dock | ShapeDock:
    """Make what follows the corner, or the shape, that is configured."""
    if config.dock_shape is None:
        return Dock(config.dock, track=config.dock_track)
    from ..docking import Shape, ShapeDock

    assert config.dock is not None
    return ShapeDock(Shape.read(config.dock_shape), config.dock)
