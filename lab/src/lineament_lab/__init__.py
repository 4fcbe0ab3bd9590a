"""The laboratory: what judges methods of `lineament`, and the experiments of the paper.

`lineament_lab.evaluation` scores features against truth, other views and beams;
`lineament_lab.reproduce` runs the experiments of the paper and more. The commands ``compare``,
``reproduce`` and ``bench`` of ``lineament`` are found by entry points, as anybody's may be.
"""
