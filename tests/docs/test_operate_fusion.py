"""The table of both sensors beside the better one is right for shares that are known."""

import numpy as np
import pytest
import xarray as xr

from docs._tables.operate import fusion

PROFILE, SILHOUETTE = [0.6, 0.9, 1.0, 1.0], [0.9, 0.7, 0.7, 0.7]


def shares(both):
    axes = {"channel": ["profile", "silhouette", "both"], "frame_count": [2, 4, 8, 16]}
    share = xr.DataArray([PROFILE, SILHOUETTE, both], axes)
    return xr.Dataset({"share": share, "resampled": share.expand_dims(resample=20)})


def test_loss_counts_only_settings_where_fusion_is_worse():
    report = fusion(shares([0.92, 0.88, 1.0, 1.0]))
    *_, above, whole = report.rows
    assert whole["settings"] == 4 and above["settings"] == 2
    assert whole["mean"] == pytest.approx(0) and whole["loss"] == pytest.approx(0.5)
    assert whole["surely"] == pytest.approx(25) and above["loss"] == 0
    assert "100.00 %" not in report.notes[0]


def test_contours_that_need_more_frames_are_counted():
    later = fusion(shares([0.9, 0.9, 0.94, 1.0])).notes[0]
    assert "100.00 % lie at more frames" in later and np.isfinite(
        fusion(shares(PROFILE)).rows[-1]["mean"]
    )
