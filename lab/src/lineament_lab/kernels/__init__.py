"""Kernels of the rivals, which call those of `lineament`; see `lineament.kernels`."""

from pathlib import Path

from lineament.kernels import kernel_of

kernel = kernel_of(Path(__file__).parent)
