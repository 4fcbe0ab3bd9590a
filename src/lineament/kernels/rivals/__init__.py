"""Kernels of the methods that `optimal` and `liu` are compared with."""
