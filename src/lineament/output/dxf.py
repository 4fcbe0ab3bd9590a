"""DXF: a plan for CAD, in metres, with the layers WALLS, CORNERS, EDGES, ARCS, ELLIPSES."""

from pathlib import Path

import numpy as np

from .. import drawings  # noqa: F401 (silences ezdxf before it is imported)

# isort: split
from ezdxf import units
from ezdxf.document import Drawing
from ezdxf.filemanagement import new

from .plans import Plan, PlanWriter

#: Layers and their colours, as numbers of AutoCAD: black or white, red, light red, magenta, grey.
LAYERS = {"WALLS": 7, "CORNERS": 1, "EDGES": 11, "ARCS": 6, "ELLIPSES": 8}
#: Name under which each wall has the number of views in which it was seen.
APPLICATION = "LINEAMENT"
#: Points are drawn as crosses of this size [m].
CROSS, CROSS_SIZE = 3, 0.1


class DxfWriter(PlanWriter):
    """Writes LINE, POINT, ARC or CIRCLE and ELLIPSE entities into the model space (R2010)."""

    def _draw(self, temporary: Path, plan: Plan) -> None:
        drawing = new("R2010", units=units.M)
        drawing.header["$PDMODE"], drawing.header["$PDSIZE"] = CROSS, CROSS_SIZE
        drawing.header.custom_vars.append("lineament", plan.caption)
        drawing.appids.add(APPLICATION)
        for name, color in LAYERS.items():
            drawing.layers.add(name, color=color)
        _add(drawing, plan)
        drawing.saveas(temporary)


def _add(drawing: Drawing, plan: Plan) -> None:
    space, markers = drawing.modelspace(), plan.markers
    for (start, end), views in zip(markers.segments.tolist(), plan.views.tolist(), strict=True):
        line = space.add_line(start, end, {"layer": "WALLS"})
        line.set_xdata(APPLICATION, [(1000, "views"), (1071, views)])
    for layer, points in (("CORNERS", markers.corners), ("EDGES", markers.edges)):
        for point in points.tolist():
            space.add_point(point, {"layer": layer})
    on_arcs = {"layer": "ARCS"}
    for (x, y, radius, *turn), is_whole in markers.arc_rows():
        if is_whole:
            space.add_circle((x, y), radius, on_arcs)
        else:
            first, last = np.degrees(turn) % 360
            space.add_arc((x, y), radius, first, last, dxfattribs=on_arcs)
    for x, y, a, b, direction in markers.ellipses:
        if a > 0:  # CAD knows no ellipse without an extent, and no thinner one than this
            axis = (a * np.cos(direction), a * np.sin(direction))
            space.add_ellipse((x, y), axis, max(b / a, 1e-6), dxfattribs={"layer": "ELLIPSES"})
