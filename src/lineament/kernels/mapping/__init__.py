"""A map of walls: which of them lie near, what a beam meets, where a local map fits."""
