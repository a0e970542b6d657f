"""Tables and pictures of scores show the numbers of the scores."""

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.figure import Figure

from ncti.evaluate import accuracy_by_aspect, paired_difference, score

ASPECTS = [0, 3, 40, 80]
RIGHT = np.array([[True, True, False, False], [True, False, False, True]])


def test_accuracy_exports_tables_with_intervals():
    accuracy = accuracy_by_aspect(RIGHT, ASPECTS)
    table = accuracy.to_xarray()
    assert table.fraction.dims == ("aspect_bin",)
    assert table.aspect_bin.values.tolist() == ["0-3", "40", "80", "overall"]
    np.testing.assert_array_equal(table.fraction, accuracy.fraction)
    frame = accuracy.to_pandas()
    assert frame.loc["0-3", "fraction"] == 0.75 and frame.loc["overall", "n"] == 8
    html = accuracy._repr_html_()
    low, high = (100 * bounds[0] for bounds in (accuracy.ci_low, accuracy.ci_high))
    assert f"75 [{low:.0f}-{high:.0f}]" in html
    unanswered = accuracy_by_aspect(RIGHT, ASPECTS, answered=np.array(ASPECTS) != 80)
    assert "nan" not in unanswered._repr_html_().lower()


def test_leading_axes_are_exported_but_not_plotted():
    stacked = accuracy_by_aspect(np.stack([RIGHT, ~RIGHT]), ASPECTS)
    assert stacked.to_xarray().sizes == {"dim_0": 2, "aspect_bin": 4}
    assert len(stacked.to_pandas()) == 8
    with pytest.raises(ValueError, match=r"fraction has shape \(2, 4\)"):
        stacked.plot()


def test_scores_export_and_plot_the_confusion_matrix():
    mpl.use("Agg")
    truth, answers = ["duncan", "duncan", "texas"], ["duncan", "texas", "texas"]
    scores = score(truth, answers, aspect=[0, 40, 80], groups=[0, 1, 2])
    confusion = scores.to_pandas()
    assert confusion.loc["duncan", "texas"] == 1 and confusion.loc["texas", "duncan"] == 0
    assert "nan" not in scores._repr_html_()
    cells = [text.get_text() for text in scores.plot().texts]
    assert cells == ["50", "50", "0", "100"]
    drawn = scores.accuracy.plot()
    assert drawn.get_ylabel() == "correct answers [%]"
    mpl.pyplot.close("all")


def test_paired_difference_is_labelled_as_difference():
    first, second = np.ones((2, 1, 1, 20), dtype=bool)
    second = second & (np.arange(20) < 5)
    difference = paired_difference(first, second, np.full(20, 45.0), confidence=0.9)
    assert difference.fraction[-1] == -0.75
    table = difference.to_xarray()
    assert table.fraction.long_name == "difference of correct answers"
    assert table.ci_low.long_name == "lower end of the 90 % interval"
    ax = difference.plot(Figure().subplots())
    assert ax.get_ylim()[0] < 100 * difference.ci_low[-1] and "points" in ax.get_ylabel()
    assert "difference [points]" in difference._repr_html_()
