"""The picture of how densely ships must be learned."""

import numpy as np
import pytest
from made import scores

from sweeps.report.spacing_figures import LINES, draw_spacing
from sweeps.report.style import OFFSET

BOTH = "both sensors, maximum likelihood"

AXES = {"range": [25, 50], "template_spacing": [1.5, 3.0, 6.0], "aspects": ["learned", "random"]}
BINS = ("0-27", "60-90", "overall")


def tables(**more):
    return {
        "acn": scores(1, bins=BINS, vigilance=[0.9, 0.95], **AXES, **more),
        "fusion": scores(2, bins=BINS, channel=["range", "infrared", "both"], **AXES, **more),
    }


def test_lines_are_the_scores_at_random_aspects():
    given = tables()
    figure = draw_spacing(given)
    titles = [axes.get_title() for axes in figure.axes]
    assert titles == [f"{r} km, {b}" for b in ("aspect 60–90°", "overall") for r in (25, 50)]
    names = [text.get_text() for text in figure.legends[0].get_texts()]
    assert names == [name for name, (table, *_) in LINES.items() if table in given]
    # The last panel, both sensors.
    line = figure.axes[-1].containers[names.index(BOTH)][0]
    here = given["fusion"].sel(channel="both", range=50, aspects="random", aspect_bin="overall")
    x, y = line.get_data()
    np.testing.assert_allclose(np.asarray(x, float), [1.5, 3, 6], rtol=OFFSET + 1e-12)
    wanted = here.transpose("template_spacing").accuracy.values
    np.testing.assert_allclose(y, 100 * wanted)


def test_a_sweep_of_one_spacing_is_refused():
    one = {"acn": scores(1, range=[25], template_spacing=1.5, aspects=["learned", "random"])}
    with pytest.raises(ValueError, match=r"lacks several values of classifier\.template_spacing"):
        draw_spacing(one)
    with pytest.raises(ValueError, match="none of the tables"):
        draw_spacing({"mnn": one["acn"]})
