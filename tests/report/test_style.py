"""Pictures can be read: colours, offsets, fonts, and texts that stay in their places."""

from itertools import combinations, pairwise

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.text import Text

from sweeps.report import figures
from sweeps.report.style import LINE_COLOURS, OFFSET, SHIP_COLOURS, nested, offset

# Linear RGB as seen by people who lack one kind of cone: Machado, Oliveira and Fernandes, "A
# Physiologically-based Model for Simulation of Color Vision Deficiency", IEEE Transactions on
# Visualization and Computer Graphics 15 (2009), doi:10.1109/TVCG.2009.113, at severity 1.
VISION = {
    "normal": np.eye(3),
    "protanopia": [
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    "deuteranopia": [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ],
    "tritanopia": [
        [1.255528, -0.076749, -0.178779],
        [-0.078411, 0.930809, 0.147602],
        [0.004733, 0.691367, 0.303900],
    ],
}
TO_XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
JUST_NOTICEABLE = 2.3  # difference in CIE L*a*b*


def lab(colour, vision):
    """CIE L*a*b* of a colour as seen."""
    rgb = np.array(to_rgb(colour))
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    xyz = TO_XYZ @ np.clip(np.asarray(vision) @ linear, 0, 1) / TO_XYZ.sum(axis=1)
    x, y, z = np.where(xyz > 216 / 24389, np.cbrt(xyz), (24389 / 27 * xyz + 16) / 116)
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


@pytest.mark.parametrize("vision", VISION)
@pytest.mark.parametrize("palette", [LINE_COLOURS, SHIP_COLOURS], ids=["lines", "ships"])
def test_colours_are_distinct_in_every_colour_vision(palette, vision):
    seen = [lab(colour, VISION[vision]) for colour in palette]
    nearest = min(np.linalg.norm(one - other) for one, other in combinations(seen, 2))
    assert nearest > 8 * JUST_NOTICEABLE


@pytest.mark.parametrize("count", [1, 2, 3, 6])
def test_marks_are_offset_a_little_and_each_differently(count):
    shifts = np.array([offset([1.0, 40.0], place, count) for place in range(count)]) / [1.0, 40.0]
    assert np.abs(shifts - 1).max() <= OFFSET + 1e-12
    assert OFFSET <= 0.02
    assert len(set(shifts[:, 1])) == count
    widths = [nested(place, count) for place in range(count)]
    for over, under in zip(widths[1:], widths, strict=False):
        assert over["lw"] < under["lw"] and over["ms"] < under["ms"]


@pytest.mark.parametrize("kind", ["classifiers", "fusion"])
def test_lines_that_coincide_can_be_told_apart(kind, smoke_store):
    """By colour and marker; a line over another is thinner, its marks smaller and beside."""
    for axes in figures.draw(kind, smoke_store).axes:
        lines = [bars.lines[0] for bars in axes.containers]
        assert len(lines) >= 3
        looks = {(line.get_color(), line.get_marker()) for line in lines}
        assert len(looks) == len(lines)
        for under, over in pairwise(lines):
            assert over.get_linewidth() < under.get_linewidth()
            assert over.get_markersize() < under.get_markersize()
            assert over.get_zorder() >= under.get_zorder()
        ticks = axes.get_xticks()
        for line in lines:
            places = np.asarray(line.get_xdata(), dtype=float)
            near = np.abs(places[:, None] / ticks - 1).min(axis=1)
            assert near.max() <= OFFSET + 1e-12


FROM_SMOKE = sorted(
    set(figures.KINDS)
    - {"flight", "validation", "sensitivity", "measured", "runtime_vs_error", "scan", "spacing"}
)


@pytest.mark.parametrize("kind", FROM_SMOKE)
def test_texts_are_legible_and_stay_out_of_other_panels(kind, smoke_store):
    figure = figures.draw(kind, smoke_store)
    FigureCanvasAgg(figure).draw()
    # Nothing that is drawn leaves the page, by more than a pixel.
    drawn, (width, height) = figure.get_tightbbox(), figure.get_size_inches()
    assert min(drawn.x0, drawn.y0, width - drawn.x1, height - drawn.y1) > -1 / figure.dpi
    smallest = 6.5 * width / 10  # [points], of a page some 10 inches wide
    texts = [text for text in figure.findobj(Text) if text.get_text().strip()]
    assert min(text.get_fontsize() for text in texts) >= smallest
    panels = [axes for axes in figure.axes if axes.axison]
    for own in panels:
        others = [axes for axes in panels if axes is not own]
        for text in own.texts:
            box = text.get_window_extent()
            assert not any(box.overlaps(axes.get_window_extent()) for axes in others), text
