"""Figure 9, Table 2 and what the paper leaves open: parts of the experiments, by hand."""

import math

import numpy as np
import pytest
from handmade import corner, features
from lineament_lab.reproduce import (
    Setting,
    grid,
    repetition,
    scans,
    two_corners,
)
from lineament_lab.reproduce.grid import Parameters
from lineament_lab.reproduce.two_corners import DISTANCE, POSES, WORLD, A, B
from small_experiments import PAPER

import lineament as ln
from lineament.methods.stages import bilateral_filter
from lineament.simulation import truth


class TestRepetition:
    @pytest.fixture
    def made(self):
        """Every form at three radii and three thresholds; the tangent as the paper has it."""
        ar = {("tangent", 8, 6, 0.66): 0.9, ("tangent", 8, 8, 0.66): 0.91}
        ar |= {("product", 2, 8, 0.66): 0.7, ("product", 2, 6, 0.5): 0.6}
        other = {"f1": 0.5}
        return {
            p: other | {"half_sum": ar.get(p, 0.1 * (p[0] != "relative")), "repetition": 1 - p[3]}
            for form in grid.FORMS
            for half_width in grid.HALF_WIDTHS
            for radius in (5, 6, 8)
            for threshold in (0.5, 0.66, 0.8)
            for p in [Parameters(form, half_width, radius, threshold)]
        }

    def test_largest_is_among_those_asked_for(self, made):
        assert grid.largest(made, "half_sum") == ("tangent", 8, 8, 0.66)
        assert grid.largest(made, "half_sum", response="product") == ("product", 2, 8, 0.66)
        fixed = {"response": "product", "support_radius": 6}
        assert grid.largest(made, "half_sum", **fixed) == ("product", 2, 6, 0.5)
        assert grid.largest(made, "repetition", threshold=0.8).threshold == 0.8
        assert grid.largest(made, "repetition").threshold == 0.5

    def test_readings_are_alike_whose_peak_is_at_the_papers_parameters(self, made):
        flat = [paper.reading for paper in repetition._papers() if paper.response != "relative"]
        flat.remove("product, half-width 2")

        def alike():
            peaks = repetition._peaks(made, "half_sum")
            alike = [reading for reading, at in peaks.items() if at["lead"] >= 0]
            assert repetition._alike({"peaks": {"half_sum": peaks}}, "half_sum") == len(alike)
            return alike

        assert alike() == flat
        made[Parameters("tangent", 8, 8, 0.66)]["half_sum"] = 0.95
        flat.remove("tangent, half-width 8")
        assert alike() == flat

    def test_average_repetition_by_hand(self):
        turn = 0.002
        before = features(corners=[corner(*p) for p in ((1, 0), (2, 0), (3, 0), (0, 4))])
        after = features(corners=[corner(*p) for p in ((1, 0.03), (2.04, 0), (7, 7))])
        turned = after.transform(0, 0, -turn)
        assert grid.average_repetition(before, turned, turn) == (2 / 4 + 2 / 3) / 2
        assert grid.average_repetition(before, before, 0.06) == 0.25  # One of four is near enough.
        assert grid.average_repetition(before, features(), 0.0) == 0.0
        assert math.isnan(grid.average_repetition(features(), features(), 0.0))
        # Of two views without a corner in common, whatever their numbers.
        for n, m in ((1, 0), (0, 1), (1, 1), (2, 2), (1, 3)):
            views = features(corners=[before.corners[0]] * n), features(corners=[corner(9, 9)] * m)
            assert grid.average_repetition(*views, 0.0) == 0.0

    def test_parameters_are_chosen_on_scenes_that_are_not_reported(self):
        setting = Setting(frames=50, seed=3)
        chosen_on, reported = (grid.repetition_scenes(setting, reported=r) for r in (False, True))
        assert len(chosen_on) == len(reported) == 100
        assert not set(chosen_on) & set(reported)
        later = grid.repetition_scenes(Setting(frames=50, seed=4), reported=False)
        assert not set(reported) & set(later)


class TestTwoCorners:
    def test_both_corners_are_seen_well_from_all_five_places(self):
        assert math.dist(A, B) == pytest.approx(2.302, abs=1e-12)
        for pose in POSES:
            seen = truth(WORLD, pose, PAPER).transform(*pose)
            for vertex, convex in ((A, True), (B, False)):
                is_it = np.hypot(*(seen.corners["position"] - vertex).T) < 1e-9
                assert is_it.sum() == 1
                assert seen.corners["convex"][is_it][0] == convex
                sides = seen.corners["segments"][is_it][0]
                assert (seen.segments["n_points"][sides] >= 6).all()
            # No wall is a side of both: their errors are independent.
            assert len(set(seen.corners["segments"].ravel())) >= 4
            found = two_corners.found_distances([truth(WORLD, pose, PAPER)], pose)
            assert found == pytest.approx([DISTANCE], abs=1e-9)

    def test_distance_is_of_the_nearest_corners_and_of_nothing_too_far(self):
        along = (B - A) / DISTANCE
        views = [
            features(corners=[corner(*p) for p in positions])
            for positions in (
                (A - 0.01 * along, A + 0.2 * along, B),
                (A,),
                (A, B + 0.26 * along),
                (A - 0.24 * along, B),
                (),
            )
        ]
        found = two_corners.found_distances(views, (0.0, 0.0, 0.0))
        assert found == pytest.approx([DISTANCE + 0.01, DISTANCE + 0.24])

    def test_a_method_that_never_finds_both_corners_is_named(self):
        some, none = ([two_corners._numbers(np.array(d), 4)] for d in ([DISTANCE], []))
        n = {"places": {"liu": some, "iepf": none}, "all": {"liu": some[0], "iepf": none[0]}}
        n |= {"bound": np.array([0.003]), "all_bound": 0.003}
        assert two_corners.report(n, Setting())[0][-1] == "iepf: no scan has both corners."


class TestSensitivity:
    """What the paper leaves open: its filter more than once."""

    def test_ranges_are_filtered_so_many_times(self):
        scan = ln.LaserScan([2.0, 2.0, 2.05, 2.0, 2.0, 2.1], -0.3, 0.1, range_min=0.2, range_max=9)
        assert scans.filtered(scan, 0) is scan
        once = ln.LaserScan(bilateral_filter(scan), -0.3, 0.1, range_min=0.2, range_max=9)
        for times, expected in ((1, once.ranges), (2, bilateral_filter(once))):
            found = scans.filtered(scan, times)
            np.testing.assert_allclose(found.ranges, expected)
            assert np.abs(found.ranges - scan.ranges).max() > 0.01
            assert (found.angle_min, found.angle_increment) == (-0.3, 0.1)
            assert (found.range_min, found.range_max) == (0.2, 9.0)
