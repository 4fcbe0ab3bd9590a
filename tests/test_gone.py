"""What was seen and looked through since: people who stood there, doors that opened."""

import numpy as np
import pytest

from lineament import Extractor
from lineament.mapping.drive_map import Drive
from lineament.mapping.gone import _covering, pieces_of
from lineament.mapping.making import make_map
from lineament.simulation import SENSORS, World, drive
from lineament.walls import lengths_of, walls_of

ROOM = [(-3, -2, 3, -2), (3, -2, 3, 3), (3, 3, -3, 3), (-3, 3, -3, -2)]
BOX = [(0.7, 0.7, 0.7, 1.3), (0.7, 1.3, 1.3, 1.3), (1.3, 1.3, 1.3, 0.7), (1.3, 0.7, 0.7, 0.7)]
WAY = [(-1.5, -1), (1.8, -1), (-1.5, -0.6), (1.8, -0.6)]


def scans_of(lines):
    """Scans of the same drive in a room of these walls."""
    world = World(np.array(lines, float))
    return list(drive(world, WAY, SENSORS["lms361"], speed=0.6, rate=3, seed=7))


def mapped(share):
    """Return the lengths of the walls of a box and of a room on a map.

    The box was there in the first scans of the drive, so many of all.
    """
    with_box, without = scans_of(ROOM + BOX), scans_of(ROOM)
    making, extract, first = Drive(), Extractor(), int(share * len(without))
    for scan in with_box[:first] + without[first:]:
        making.add(scan, extract(scan), scan.pose)
    plan = make_map(making.frames, making.scans).map
    middles = plan.ends.mean(axis=1) + without[0].pose[:2]  # a map begins at its first scan
    is_box = (abs(middles - 1.0) < 0.5).all(axis=1)
    return lengths_of(plan.walls[is_box]).sum(), lengths_of(plan.walls[~is_box]).sum()


@pytest.mark.parametrize(("share", "length"), [(0.0, 0.0), (0.25, 0.0), (0.9, 1.8), (1.0, 1.8)])
def test_a_box_is_on_the_map_if_more_see_it_than_look_through_it(share, length):
    box, room = mapped(share)
    assert box == pytest.approx(length, abs=0.15)
    assert room == pytest.approx(22.0, abs=0.4)


def test_pieces_lie_along_their_walls():
    pieces, of = pieces_of(walls_of(np.array([[(0, 0), (1.2, 0)], [(0, 0), (0, 0.4)]])))
    assert of.tolist() == [0, 0, 0, 1]
    np.testing.assert_allclose(pieces["start"], [(0, 0), (0.4, 0), (0.8, 0), (0, 0)])
    np.testing.assert_allclose(pieces["end"], [(0.4, 0), (0.8, 0), (1.2, 0), (0, 0.4)])


def test_sights_cover_places_of_their_wall_alone():
    spans = np.array([3, 3, 4]), np.array([-1.0, 0.0, 0.0]), np.array([1.0, 2.0, 9.0])
    walls, along = np.array([3, 3, 3, 4, 5, -1]), np.array([-0.5, 0.5, 5.0, 5.0, 5.0, 0.5])
    assert _covering(spans, walls, along).tolist() == [1, 2, 0, 1, 0, 0]
