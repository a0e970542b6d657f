"""Silhouettes are the library's, and two are told apart as often as theory says."""

import math

import numpy as np
import pytest
import trimesh
from scipy.special import ndtr

from ncti.infrared import Imager, silhouette
from studies.operate.silhouettes import SilhouetteMatch, silhouettes
from studies.operate.survey import draw_views, seen_views

IMAGER = Imager(0.25, 2.16, 0.181e-3, 0.8, 0.3, 0.3)


@pytest.mark.parametrize("footprint", [2.5, 7.5, 15.0])
def test_silhouettes_match_the_library(footprint):
    mesh = trimesh.creation.box((90, 12, 20)).apply_translation((0, 0, 10))
    views = draw_views(mesh, [0.0, 40.0, 90.0], spacing=0.5)
    places = [(0.1, 0.2), (0.7, 0.4), (0.5, 0.9)]
    seen = seen_views(views, places, footprint=footprint)
    window = {"length": 120.0, "height": 30.0, "depression": 3.84}
    images = silhouettes(seen, footprint=footprint, coverage_rule=0.25, **window)
    for image, view, place in zip(images, views, places, strict=True):
        exact = silhouette(view, footprint=footprint, phase=place, margin=0).target(0.25)
        # They are equal but for sea around; the curvature of the wave moves no pixel here.
        rows, columns = np.nonzero(image.any(axis=1))[0], np.nonzero(image.any(axis=0))[0]
        ours = image[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
        rows, columns = np.nonzero(exact.any(axis=1))[0], np.nonzero(exact.any(axis=0))[0]
        assert np.array_equal(ours, exact[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1])


def test_ship_larger_than_the_window_is_refused():
    views = draw_views(trimesh.creation.box((90, 12, 20)), [90.0], spacing=0.5)
    seen = seen_views(views, [(0.5, 0.5)], footprint=5.0)
    with pytest.raises(ValueError, match="length and height are 30 and 30 m"):
        silhouettes(seen, footprint=5.0, coverage_rule=0.25, length=30, height=30, depression=3.84)


@pytest.mark.parametrize(("frames", "slant_range"), [(1, 50e3), (16, 50e3), (16, 80e3)])
def test_accuracy_for_two_silhouettes_matches_theory(frames, slant_range):
    count = 20_000
    templates = np.zeros((2, 1, 4, 12), bool)
    templates[0, 0, 1:3, 1:9] = templates[1, 0, 1:3, 1:11] = True  # 4 pixels apart
    true = np.arange(count) % 2
    match = SilhouetteMatch(templates, templates[true, 0], templates, np.random.default_rng(1))
    evidence = match.evidence(frames, imager=IMAGER, slant_range=slant_range, gain_sigma=0.0)
    right = (evidence.argmax(axis=1) == true).mean()
    sigma = math.sqrt(0.3**2 + 0.8**2 / frames)
    expected = ndtr(IMAGER.contrast(slant_range) * 2 / (2 * sigma))
    assert abs(right - expected) < 5 * math.sqrt(expected * (1 - expected) / count)
