"""GeoJSON: a plan for GIS and web pages, in metres of the plan and not in degrees."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..files import strict_json
from ..scan import Array
from .plans import Plan, PlanWriter


class GeoJsonWriter(PlanWriter):
    """Writes a wall as a LineString, an arc as a Polygon or LineString, a corner as a Point.

    Each has its `kind`, walls how often they were seen. Numbers are rounded to 1 µm. `areas` are
    polygons that are known to be free, each a list of rings (n, 2), the outer one first.
    """

    areas: Sequence[Sequence[Array]] = ()

    def _draw(self, temporary: Path, plan: Plan) -> None:
        marks = plan.markers
        rows = [feature("Polygon", list(map(_rounded, area)), kind="free") for area in self.areas]
        for ends, views in zip(marks.segments, plan.views.tolist(), strict=True):
            rows.append(feature("LineString", _rounded(ends), kind="wall", views=views))
        for strip, (arc, is_whole) in zip(marks.arc_strips(), marks.arc_rows(), strict=True):
            line, shape = _rounded(strip), "Polygon" if is_whole else "LineString"
            of = {"kind": "arc", "radius": round(arc[2], 6)}
            rows.append(feature(shape, [line] if is_whole else line, **of))
        for name, points in (("corner", marks.corners), ("edge", marks.edges)):
            rows += [feature("Point", point, kind=name) for point in _rounded(points)]
        about = {"type": "FeatureCollection", "name": plan.caption, "unit": "metre"}
        temporary.write_text(strict_json(about | {"features": rows}) + "\n", encoding="utf-8")


def feature(shape: str, coordinates: Any, **properties: Any) -> dict[str, Any]:
    """Return one feature of a collection."""
    geometry = {"type": shape, "coordinates": coordinates}
    return {"type": "Feature", "properties": properties, "geometry": geometry}


def _rounded(points: Array) -> list[Any]:
    rounded: list[Any] = points.round(6).tolist()
    return rounded
