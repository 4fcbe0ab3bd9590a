"""What the methods share: the check of their parameters, the run over scans, the trace."""

from __future__ import annotations

from dataclasses import fields
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..features import Features
from ..scan import LaserScan
from .steps import estimate_noise
from .trace import Trace, trace_of
from .workspace import Block

__all__ = ["MethodBase"]


class MethodBase:
    """A method that calls its kernels one by one, for one scan after the other.

    Methods inherit from this, declare their parameters (`parameters.parameter`), and say in `find`
    what they do.
    """

    __slots__ = ()

    name: ClassVar[str]
    presets: ClassVar[tuple[str, ...]] = ()

    def __post_init__(self) -> None:
        # Each gets the type of its default, for numba compiles for each type.
        for field in fields(self):  # type: ignore[arg-type]  # every subclass is a dataclass
            bounds, value = field.metadata.get("bounds"), getattr(self, field.name)
            if bounds is not None:  # a plain field of somebody's method is taken as it is
                bounds.check(field.name, value)
                object.__setattr__(self, field.name, bounds.kind(value))

    def own_arrays(self, beams: int) -> Any:
        """Make what the method needs besides a block, for scans of so many beams."""

    def find(self, block: Block, row: int) -> None:
        """Find and measure the features of scan `row` of a block.

        It is in the block's workspace, and its noise is there.
        """
        raise NotImplementedError

    def run(self, block: Block) -> None:
        """Find and measure the features of the scans of a block."""
        for row in range(block.rows):
            block.take(row)
            estimate_noise(block, row)
            self.find(block, row)

    @property
    def least_response(self) -> float:
        """What the response of a candidate exceeds where the first search accepts it."""
        return 0.0

    def trace(self, scan: LaserScan, features: Features, noise: NDArray[np.float64]) -> Trace:
        """Run again on a scan from which these features came, and keep every intermediate.

        `noise` is the row that was given then: what was estimated is estimated again. Candidates
        and cuts are those of the first search, before anything was merged.
        `lineament.Extractor.trace` does both.
        """
        block = Block(scan, noise, 1, self.own_arrays(len(scan)))
        block.load(scan.ranges)
        self.run(block)
        return trace_of(
            block, self.name, scan, features, self.least_response, self.report_evidence(block)
        )

    def report_evidence(self, block: Block) -> dict[str, NDArray[np.float64]]:  # noqa: ARG002
        """Report how much evidence there is for each feature of the last scan, by table."""
        return {}
