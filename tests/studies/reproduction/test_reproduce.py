"""Sweeps of settings that the article leaves open can be extended, and have tables beside it."""

import numpy as np
import pytest
from commands import opened, swept

from ncti.article import figures
from studies.reproduction.assumptions import PRIORS, assumed
from studies.reproduction.fits import FITS

SMALL = ("+experiment=reproduce", "grid.aspect=[0,45,90]", "reproduce.draws=2")
GROUP = "reproduction"


@pytest.mark.usefixtures("one_variant")
def test_extended_store_equals_one_computed_at_once(tmp_path, cache):
    """A store of one setting, extended to two, equals one of two at once, bit for bit."""
    for count in (1, 2):
        finished = swept(
            tmp_path / "grown.zarr", tmp_path / "a", *SMALL, f"reproduce.setting={count}"
        )
        assert not finished.failures
    finished_at_once = swept(tmp_path / "once.zarr", tmp_path / "b", *SMALL, "reproduce.setting=2")
    assert not finished_at_once.failures
    settings = opened(tmp_path / "once.zarr", GROUP)
    assert settings.identical(opened(tmp_path / "grown.zarr", GROUP))
    # The recorded values are those drawn.
    values = assumed(1)
    expected = [prior.number(values[name]) for name, prior in PRIORS.items()]
    np.testing.assert_array_equal(settings.value.sel(setting=1), expected)
    assert settings.parameter.values.tolist() == list(PRIORS)
    # Tables have weights of sum one, figures within the settings', and the article's figures.
    fits = opened(tmp_path / "once.zarr", "tables/reproduction_fits")
    assert fits.fitted.values.tolist() == list(FITS)
    np.testing.assert_allclose(fits.weight.sum("setting"), 1)
    np.testing.assert_allclose(fits.weight.sel(fitted="none"), 1 / 2)
    table = opened(tmp_path / "once.zarr", "tables/reproduction")
    assert (table.least <= table.percent_low).all()
    assert (table.percent_high <= table.largest).all()
    article = [figure.value for figure in figures([0.0, 45.0, 90.0])]
    np.testing.assert_array_equal(table.article, article)
    weighted = (fits.weight * settings["mean"]).sum("setting")
    np.testing.assert_allclose(weighted.transpose("fitted", "figure"), table.percent)
