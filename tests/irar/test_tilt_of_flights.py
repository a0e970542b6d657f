"""What flights past whole ships still lean by once corrected, by geometry.

Connole at 3 km, Roberts at 3.9 km and Duncan at 4 km, at 6.7 deg, with the defaults of a flight.
"""

import numpy as np
import pytest
from flown import flight

from ncti import ships
from ncti.irar import Correction, fly
from ncti.irar.chain import places
from ncti.irar.scene import RAYS

SLANT_RANGE = {"connole": 3000.0, "roberts": 3900.0, "duncan": 4000.0}


def flown(ship, aspect):
    """A pass by a ship."""
    wide = {} if aspect == 175 else {"samples": 240, "pulse_rate": 30e3}
    return fly(ships.load(ship), flight(aspect, slant_range=SLANT_RANGE[ship], cnr=100.0, **wide))


NEAR_STERN = [(ship, 175) for ship in SLANT_RANGE]


def leans(passed):
    """Mast and waterline [deg] by where rays' points are put, no image; and those places' scatter.

    Where samples are put, and where the snapshot shows what their rays meet, in pixels: slopes of
    columns on rows, and of rows on columns, by linear regression.
    """
    seen, returns = passed.plan.flight, passed.returns
    returns = returns.without_leading(seen.detectors - 1)
    line, sample = np.divmod(returns.place, returns.shape[1])
    time = passed.plan.time(np.arange(seen.samples))[line, sample]
    part = (np.arange(RAYS) - (RAYS - 1) / 2) / RAYS * seen.ifov
    upward, rightward = np.divmod(returns.ray, RAYS)
    along = seen.scan_angles(np.arange(seen.samples))[sample]
    ways = seen.directions(along + part[rightward], part[upward])
    points = seen.position(time) + returns.distance[:, None] * ways
    shown = pictured(seen, points - seen.position(np.zeros(())))
    row, column, _ = places(passed.noiseless(), Correction())
    # A ray is beside the middle of its sample by as much as their directions are apart.
    middle = pictured(seen, seen.directions(along, np.zeros_like(along)))
    put = np.stack([row[line, sample], column[line, sample]]) + pictured(seen, ways) - middle
    terms = np.stack([np.ones_like(shown[0]), *shown], axis=1)
    slopes, squares = np.linalg.lstsq(terms, put.T, rcond=None)[:2]
    (height, mast), (waterline, width) = slopes[1:]
    found = np.degrees(np.arctan([mast / height, waterline / width]))
    return *found, np.sqrt(squares.sum() / len(terms))


def pictured(seen, ways):
    """(row and column, ...) of directions in the snapshot [pixel], as the truth has its rays."""
    right, up, away = np.moveaxis(ways @ seen.snapshot_axes.T, -1, 0)
    return np.stack([up, right]) / away / seen.ifov


@pytest.mark.parametrize(
    ("ship", "aspect"), [*NEAR_STERN, ("connole", 45), ("roberts", 66), ("duncan", 90)]
)
def test_corrections_put_what_rays_meet_where_the_snapshot_shows_it(ship, aspect):
    """A tenth of what is asked of images.

    A sample has one range, for rays that on a deck are metres apart: 10 m of it, seen from 20 m
    aside, at 4 km, are 10 / 4000 * 20 m, a sixteenth of a pixel.
    """
    mast, waterline, scatter = leans(flown(ship, aspect))
    assert abs(mast) < 0.01
    assert abs(waterline) < 0.01
    assert scatter < 1 / 16
