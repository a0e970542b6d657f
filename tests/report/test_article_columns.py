"""The article's figures stand beside ours only where views and settings are the article's."""

import copy

import numpy as np
import pytest
from commands import chosen
from made import SOURCE, categories, displayed, scores
from pages import stored

from ncti.article import article_figures
from sweeps.engine.declare.settings import nested
from sweeps.experiment import EXPERIMENT
from sweeps.report.frames import read_frames
from sweeps.stages.classifier import draw_aspects

AXES = {"pulse_width": [10.0, 30.0], "range": 100.0, "vigilance": [0.9, 0.95]}
BINS = ("0-27", "30-57", "60-90", "overall")


def found(tmp_path, attributes=SOURCE, **more):
    axes = AXES | {"frame_count": [4, 16]} | more
    table = scores(prefixes=("", "training_"), bins=BINS, **axes)
    path = stored(tmp_path / "s.zarr", attributes, tables__acn=displayed(table))
    return read_frames(path)["scores"].rows


def test_table_4_is_compared_only_with_matching_rows(tmp_path):
    rows = found(tmp_path)
    compared = rows[rows.article_percent_correct.notna()]
    assert set(compared.pulse_width_ns) == {30.0} and set(compared.vigilance) == {0.95}
    printed = article_figures()["table4_percent_correct"]
    for frames, kind in ((4, "test"), (16, "test"), (None, "training")):
        rows_here = compared[compared.kind == kind]
        rows_here = rows_here[rows_here.frame_count == frames] if frames else rows_here
        expected = printed["frames"][frames] if frames else printed["training"]
        assert rows_here.sort_values("aspect_bin_deg").article_percent_correct.tolist() == expected


@pytest.mark.parametrize(
    ("place", "value"),
    [
        ("configuration.grid.aspect", [0, 90]),
        ("configuration.grid.aspect", list(range(0, 91, 2))),
        ("configuration.grid", {"aspect": [*range(0, 91, 3), 20], "random_aspects": 1}),
        ("configuration.ladar.cnr", 20.0),
        ("configuration.ladar.place", "random"),
        ("configuration.classifier.unknown", ["texas"]),
        ("mesh_digests.duncan", "0"),
        ("mesh_transforms.duncan", "scale: 0.5"),
    ],
)
def test_other_views_or_settings_are_not_compared_with_article(place, value, tmp_path):
    attributes = copy.deepcopy(SOURCE)
    *above, last = place.split(".")
    inner = attributes
    for key in above:
        inner = inner.setdefault(key, {})
    inner[last] = value
    assert "article_percent_correct" not in found(tmp_path, attributes)


@pytest.mark.parametrize("axis", [{"range": 50.0}, {"aspects": ["between"]}], ids=str)
def test_other_axis_values_are_not_compared_with_article(axis, tmp_path):
    assert "article_percent_correct" not in found(tmp_path, **axis)


@pytest.mark.parametrize("number", [1, 10])
def test_article_is_compared_with_learned_but_not_random_aspects(number, tmp_path):
    attributes = copy.deepcopy(SOURCE) | {"seed": 3}
    grid = attributes["configuration"]["grid"]
    grid["aspect"] = sorted({*grid["aspect"], *draw_aspects(0.0, 90.0, number, seed=3)})
    grid["random_aspects"] = number
    rows = found(tmp_path, attributes, aspects=["learned", "random"])
    assert set(rows[rows.article_percent_correct.notna()].aspects) == {"learned"}


def test_swept_setting_is_compared_only_at_the_article_value(tmp_path):
    attributes = copy.deepcopy(SOURCE)
    attributes["configuration"]["ladar"]["cnr"] = [29.0, 32.0]
    rows = found(tmp_path, attributes, cnr=[29.0, 32.0])
    cnr = next(name for name in rows if name.startswith("cnr"))
    assert set(rows[rows.article_percent_correct.notna()][cnr]) == {32.0}


@pytest.mark.parametrize("views", [124, 123])
def test_table_3_is_compared_only_with_categories_of_all_views(views, tmp_path):
    table = categories(20, views, pulse_width=[10.0, 30.0], vigilance=[0.9, 0.95], range=[100.0])
    path = stored(tmp_path / "s.zarr", SOURCE, tables__categories_acn=table)
    rows = read_frames(path)["categories"].rows
    if views < 124:
        assert "article_categories" not in rows
        return
    compared = rows[rows.article_categories.notna()]
    assert compared.article_categories.tolist() == [26, 18] and set(compared.vigilance) == {0.95}


def test_bound_is_maximum_likelihood_with_largest_gain_sigma(tmp_path):
    axes = {"range": [50.0, 100.0], "frame_count": [4, 16]}
    bound = scores(1, bins=BINS, **axes, gain_sigma=[0.0, 1.0])
    ours = scores(2, bins=BINS, **axes)
    path = stored(
        tmp_path / "s.zarr",
        tables__likelihood=displayed(bound, "likelihood"),
        tables__acn=displayed(ours),
    )
    rows = read_frames(path)["scores"].rows
    acn = rows[rows.classifier == "acn"]
    assert (acn.bound_gain_sigma == 1.0).all()
    keys = ["range_km", "frame_count", "aspect_bin_deg"]
    best = rows[(rows.classifier == "likelihood") & (rows.gain_sigma == 1.0)].set_index(keys)
    for row in acn.itertuples():
        expected = best.percent_correct[row.range_km, row.frame_count, row.aspect_bin_deg]
        assert row.points_below_bound == pytest.approx(expected - row.percent_correct, abs=0.11)
    unknown = rows[(rows.classifier == "likelihood") & (rows.gain_sigma == 0.0)]
    assert np.isfinite(unknown.points_below_bound).all()  # knows the gain: may be above


@pytest.mark.parametrize("name", ["paper", "draws", "table4"])
def test_reproduction_experiments_are_compared_with_the_article(name, tmp_path):
    choices = chosen(f"+experiment={name}")
    settings = (setting for setting in EXPERIMENT.declared if setting.key in choices.values)
    configuration = {setting.key: setting.kind.as_input(choices[setting]) for setting in settings}
    rows = found(tmp_path, SOURCE | {"configuration": nested(configuration)})
    assert rows.article_percent_correct.notna().any()


def test_shifted_images_count_the_frames_of_all_positions(smoke_store):
    rows = read_frames(smoke_store)["infrared_super_resolution"].rows
    positions = rows.super_resolution.map({"none": 1, "perfect": 1, "shifted": 4})
    assert (rows.frames_in_all == rows.frame_count * positions).all()
