"""Kernels that match the features of two scans, and find the motion between them."""
