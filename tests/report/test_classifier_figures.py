"""Pictures of classifiers show the store's percentages, each on its own line."""

import pytest
from stores import rows_of

from sweeps.report import figures


@pytest.mark.parametrize("kind", ["classifiers", "fusion"])
def test_a_picture_is_drawn(kind, smoke_store, tmp_path):
    figure = figures.draw(kind, smoke_store)
    figure.savefig(tmp_path / "picture.png")
    assert (tmp_path / "picture.png").stat().st_size > 10_000
    titles = [axes.get_title() for axes in figure.axes]
    assert titles == ["aspect 0–15°", "aspect 30–45°", "aspect 60–90°", "overall"]


def test_lines_are_the_tables(smoke_store):
    figure = figures.draw("classifiers", smoke_store)
    overall = figure.axes[-1]
    handles, labels = overall.get_legend_handles_labels()
    lines = dict(zip(labels, handles, strict=True))
    assert {"ACN", "MNN, ship and aspect group", "correlation"} <= set(lines)
    for name, classifier in (("ACN", "acn"), ("correlation", "correlation")):
        expected = {
            float(row["frame_count"]): float(row["percent_correct"])
            for row in rows_of(smoke_store, "classifiers")
            if row["classifier"] == classifier
            and row["pulse_width_ns"] == "30.0"
            and row["aspect_bin_deg"] == "overall"
            and row["frame_count"]
            and row["vigilance"] in ("", "0.95")
        }
        x, y = lines[name].lines[0].get_data()
        assert dict(zip(map(float, x), map(float, y), strict=True)) == expected


def test_fusion_shows_three_channels(smoke_store):
    figure = figures.draw("fusion", smoke_store)
    for axes in figure.axes:
        assert axes.get_legend_handles_labels()[1] == ["silhouette", "range profile", "both"]
