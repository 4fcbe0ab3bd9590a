"""The public benchmark of polyline extraction (PLE): its data, its scores, our maps."""
