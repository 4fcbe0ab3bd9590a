"""What the methods share: the check of their parameters, the run over scans, the trace."""

from dataclasses import fields
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..features import Features
from ..scan import LaserScan
from .trace import Trace, intermediates
from .workspace import Block


class MethodBase:
    """A method that calls its kernels one by one, for one scan after the other.

    Methods inherit from this, declare their parameters (`parameters.parameter`), and say in `find`
    what they do.
    """

    __slots__ = ()

    name: ClassVar[str]
    presets: ClassVar[tuple[str, ...]] = ()
    #: What the response of a candidate exceeds where the first search accepts it.
    least_response: ClassVar[float] = 0.0

    def __post_init__(self) -> None:
        # Each gets the type of its default: kernels are compiled for that.
        for field in fields(self):  # type: ignore[arg-type]  # every subclass is a dataclass
            bounds, value = field.metadata.get("bounds"), getattr(self, field.name)
            if bounds is not None:  # a plain field of somebody's method is taken as it is
                bounds.check(field.name, value)
                object.__setattr__(self, field.name, bounds.kind(value))

    def own_arrays(self, beams: int) -> Any:
        """Make what the method needs besides a block, for scans of so many beams."""

    def find(self, block: Block) -> None:
        """Find and measure the features of the scan that a block has taken, in its workspace."""
        raise NotImplementedError

    def run(self, block: Block) -> None:
        """Find and measure the features of the scans of a block."""
        for row in range(block.rows):
            block.take(row)
            self.find(block)

    def trace(self, scan: LaserScan, features: Features, noise: NDArray[np.float64]) -> Trace:
        """Run again on a scan from which these features came, and keep every intermediate.

        `noise` is the row that was given then: what was estimated is estimated again. Candidates
        and cuts are those of the first search, before anything was merged.
        `lineament.Extractor.trace` does both.
        """
        block = Block(scan, noise, 1, self.own_arrays(len(scan)))
        block.load(scan.ranges)
        self.run(block)
        given: dict[str, Any] = {"scan": scan, "method": self.name, "features": features}
        return Trace(**given, clusters=features.clusters, **self.intermediates(block))

    def intermediates(self, block: Block) -> dict[str, Any]:
        """Return what a trace has besides the features of the scan that was run, by name."""
        return intermediates(block, self.least_response)
