"""What settings of classifiers decide together: checks, files of choices, experiments, commands."""

from dataclasses import replace

import pytest
from omegaconf import OmegaConf
from test_classifier_configuration import OURS, configured, sentence, value_of
from test_configuration import composed, refused

from sweeps.app import check_jobs, conf_folder, replace_axes
from sweeps.classifier_schema import CLASSIFIERS, ClassifierConfig
from sweeps.errors import ConfigurationError
from sweeps.prepare import prepare


def test_views_that_are_learned():
    """All by default; without ships that are unknown, at training aspects."""
    given = ("grid.ship=[duncan,horne]", "grid.aspect=[0,1.5,3]")
    assert configured(*given).learned().tolist() == [[True] * 3] * 2
    for unknown in ("duncan", "[duncan]"):
        found = configured(*given, f"classifier.unknown={unknown}").learned()
        assert found.tolist() == [[False] * 3, [True] * 3]
    for aspects in ("[3,0]", "{start: 0, stop: 3, step: 3}"):
        found = configured(*given, f"classifier.training_aspect={aspects}").learned()
        assert found.tolist() == [[True, False, True]] * 2
    both = ("classifier.unknown=horne", "classifier.training_aspect=1.5")
    assert configured(*given, *both).learned().tolist() == [[False, True, False], [False] * 3]


@pytest.mark.parametrize("value", ["noisy", "[expected,noisy]"])
def test_noisy_profiles_are_learned_of_other_replicates(value):
    """One draw leaves nothing to learn from that is not tested."""
    given = ("classifier.name=correlation", f"classifier.training={value}")
    told = sentence(*given)
    assert told.startswith("grid.replicate is 1, but must be at least 2 where classifier.training")
    assert "noisy" in told
    assert "noisy" in value_of(configured(*given, "grid.replicate=2"), "training")


# What each check is of, what it refuses, and who has to run for it to matter.
CHECKED = [
    (("classifier.training=noisy",), "grid.replicate is 1", ("correlation",)),
    (
        ("classifier.left_out=true", "grid.aspect=0"),
        "classifier.left_out has True",
        ("correlation", "likelihood"),
    ),
    (
        ("ladar.receiver=peak_pulse", "ladar.target_free_ifovs=0"),
        "ladar.receiver is 'peak_pulse'",
        ("likelihood", "fusion"),
    ),
]


@pytest.mark.parametrize("sensor", ["range", "infrared", "both"])
@pytest.mark.parametrize(("given", "said", "users"), CHECKED, ids=lambda value: str(value)[:30])
def test_settings_are_checked_for_those_who_use_them(given, said, users, sensor):
    """An experiment's settings stand when one of its classifiers is asked for alone."""
    for name in CLASSIFIERS:
        if name == "fusion" and sensor != "both":
            continue
        asked = (f"classifier.name=[{name},acn]" if name != "acn" else "classifier.name=acn",)
        if name in users and sensor != "infrared":
            assert sentence(*asked, *given, f"sensor={sensor}").startswith(said)
        else:
            assert configured(*asked, *given, f"sensor={sensor}").classifiers[0] == name


@pytest.mark.parametrize("receiver", ["first_pulse", "peak_pulse"])
@pytest.mark.parametrize("names", ["likelihood", "[acn,likelihood]"])
def test_likelihood_knows_the_moments_of_one_receiver(receiver, names):
    given = (f"classifier.name={names}", "ladar.target_free_ifovs=0")
    told = sentence(*given, f"ladar.receiver={receiver}")
    assert told.startswith(f"ladar.receiver is '{receiver}', but must be full_profile for the ")
    assert "likelihood" in told
    others = "classifier.name=[acn,mnn,correlation]"
    config = configured(*given, others, f"ladar.receiver={receiver}")
    assert config.ladar.receiver == receiver


def test_fusion_sees_every_range_with_both_sensors():
    name = "classifier.name=fusion"
    told = sentence(name)
    assert told == "sensor is 'range', but must be both for the classifier fusion"
    ranges = ("sensor=both", "grid.range=[50,100]")
    told = sentence(name, *ranges, "infrared.range=[25,100]")
    assert told.startswith("grid.range has 50, but every value must be one of 25, ")
    config = configured(name, *ranges, "infrared.range=[25,50,100]")
    assert value_of(config, "name") == ("fusion",)


@pytest.mark.parametrize("names", ["fusion", "[acn,fusion]"])
@pytest.mark.parametrize(
    ("override", "said"),
    [
        ("infrared.phases=1", "infrared.phases is 1, but must be at least 2 for the classifier "),
        ("infrared.coverage_rule=[0.25,0.5]", "infrared.coverage_rule has 2 values, but must "),
        ("infrared.segmentation=[matched,otsu]", "infrared.segmentation has 2 values, but must "),
        ("infrared.inner_radius=[0.5,0.6,0.7]", "infrared.inner_radius has 3 values, but must "),
        ("infrared.interpolation=[nearest,bilinear]", "infrared.interpolation has 2 values, but "),
    ],
)
def test_fusion_sees_silhouettes_of_one_kind_in_several_phases(names, override, said):
    """None is taken for another: a list is refused, whatever stands first in it."""
    given = (f"classifier.name={names}", "sensor=both")
    assert sentence(*given, override).startswith(said)
    # Where it names nothing, it minds nothing.
    config = configured("classifier.name=[acn,fusion]", "sensor=infrared", override)
    assert config.classifiers == ("acn",)


@pytest.mark.parametrize(
    ("overrides", "silent"),
    [
        (("classifier.name=[acn,mnn,correlation,likelihood]",), ()),
        (("classifier.name=[acn,fusion]",), ("fusion",)),
        (("classifier.name=[acn,fusion]", "sensor=both"), ()),
        (("classifier.name=[fusion,acn]", "sensor=both", "infrared.range=25"), ("fusion",)),
        (("classifier.name=mnn", "sensor=infrared"), ("mnn",)),
        (
            ("classifier.name=[likelihood,acn,correlation,fusion]", "sensor=infrared"),
            ("likelihood", "correlation", "fusion"),
        ),
        (("classifier.name=likelihood", "sensor=infrared", "ladar=peak_pulse"), ("likelihood",)),
    ],
)
def test_who_names_nothing_is_told(overrides, silent):
    given = [item for item in overrides if not item.startswith("ladar=")]
    if len(given) < len(overrides):
        given += ["ladar.receiver=peak_pulse", "ladar.target_free_ifovs=0"]
    told = configured(*given).silent
    assert len(told) == len(silent)
    for name, words in zip(silent, told, strict=True):
        need = "sensor=both and every value" if name == "fusion" else "sensor=range or both"
        assert words.startswith(f"classifier.name has {name}, which names nothing here: it needs ")
        assert need in words


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        *((str(value), f"is {value}, but must be from 1 to 1000") for value in (0, -1, 1001)),
        (f"1{'0' * 30}", f"is 1{'0' * 30}, but must be from 1 to 1000"),
        *((value, "of type integer") for value in ("2.5", "nan", "inf", "many", "true", "[]")),
        *((value, "of type integer") for value in ("[1,2]", "{start: 1, stop: 2, step: 1}")),
        ("null", "must be given"),
    ],
)
def test_wrong_numbers_of_replicates(value, shown):
    told = sentence(f"grid.replicate={value}")
    assert told.startswith("grid.replicate is ")
    assert shown in told
    assert "\n" not in told


def test_replicates_are_numbered_from_0():
    for count in (1, 3, 1000):
        grid = configured(f"grid.replicate={count}").grid.expand()
        assert grid.replicate == tuple(range(count))


CONFIGURED = sorted(path.stem for path in conf_folder().glob("classifier/*.yaml"))


@pytest.mark.parametrize("name", CONFIGURED)
def test_files_hold_the_defaults_of_the_schema(name):
    found = OmegaConf.to_object(composed(f"classifier={name}").classifier)
    if name == "all":
        assert set(OURS) <= set(found.name)
        assert list(found.name) == [name for name in CLASSIFIERS if name in found.name]
    else:
        assert found.name == name
    assert replace(found, name=ClassifierConfig().name) == ClassifierConfig()


def test_every_classifier_has_a_file():
    assert {*CLASSIFIERS, "all"} == set(CONFIGURED)


# What an experiment asks for: classifiers, axes that it has, replicates.
EXPERIMENTS = {
    "table2": (
        ("mnn",),
        {
            "mnn.tolerance": (0.1, 0.35),
            "mnn.inputs": ("raw", "floor_removed", "standardised"),
            "mnn.annealing": (True, False),
        },
        4,
    ),
    "table4": (
        OURS,
        {"training": ("expected", "noisy"), "left_out": (False, True), "gain_sigma": (0, 1)},
        4,
    ),
    "paper": (
        (*OURS, "fusion"),
        {"gain_sigma": (0, 1), "training": ("expected",), "left_out": (False,)},
        1,
    ),
    "smoke": ((*OURS, "fusion"), {}, 1),
}


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_experiments_compose(name, cache):
    names, axes, replicates = EXPERIMENTS[name]
    config = prepare(composed(f"+experiment={name}", "grid.ship=duncan", f"cache={cache}")).config
    assert value_of(config, "name") == names
    for key, values in axes.items():
        assert value_of(config, key) == values
    assert config.grid.replicate == replicates
    # What it does not name is as by default.
    rest = {"max_passes", "nugget", "learn_in_test", "learning_rate", "mnn.max_hidden"}
    for key in rest:
        assert value_of(config, key) == value_of(configured(), key)


def test_an_experiment_takes_other_classifiers():
    config = composed(
        *replace_axes(
            ["+experiment=table2", "classifier.name=[correlation,mnn]", "grid.ship=texas"]
        )
    )
    assert value_of(prepare(config).config, "name") == ("correlation", "mnn")
    config = composed("+experiment=smoke", "classifier.name=likelihood", "grid.ship=texas")
    assert value_of(prepare(config).config, "name") == ("likelihood",)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["classifier=nearest"], ("classifier is 'nearest'", *CONFIGURED)),
        # What all of them share is no classifier.
        (["classifier=settings"], ("classifier is 'settings'", *CONFIGURED)),
        (["classifier=classifier_settings"], ("classifier is 'classifier_settings'", *CONFIGURED)),
        (["classifier.name=[acn,nearest]"], ("classifier.name has 'nearest'", *CLASSIFIERS)),
        (["classifier.mnn=5"], ("classifier.mnn is 5", "epochs")),
        (["classifier.mnn=[5]"], ("classifier.mnn is a list", "epochs")),
        (["classifier.mnn.rate=5"], ("classifier.mnn.rate", "no key", "learning_rate")),
        (["classifier.learn_in_test=maybe"], ("classifier.learn_in_test is 'maybe'", "false")),
        (["classifier=correlation", "classifier.training=noisy"], ("grid.replicate is 1", "2")),
        (["classifier=likelihood", "ladar=peak_pulse"], ("ladar.receiver is 'peak_pulse'",)),
        (["classifier=all", "grid.replicate=0"], ("grid.replicate is 0", "from 1 to 1000")),
    ],
    ids=" ".join,
)
def test_the_command_leaves_with_2_and_one_line(arguments, said, tmp_path, monkeypatch, capsys):
    given = [*arguments, "grid.ship=duncan", "store=s.zarr", "cache=cache"]
    told = refused(given, tmp_path, monkeypatch, capsys)
    for word in said:
        assert word in told


def test_classifiers_of_several_jobs():
    given = ["-m", "grid.ship=duncan", "store=${hydra:job.num}.zarr"]
    check_jobs(replace_axes([*given, "classifier=acn,mnn", "classifier.mnn.epochs=[1,2],3"]))
    with pytest.raises(ConfigurationError, match=r"classifier\.mnn\.epochs has 0"):
        check_jobs(replace_axes([*given, "classifier=acn,mnn", "classifier.mnn.epochs=[1,2],0"]))


@pytest.mark.parametrize("group", ["classifier", "scene"])
def test_a_list_of_choices_is_refused(group):
    """Hydra would lay one file over the other, and the last would run alone."""
    with pytest.raises(ConfigurationError, match=rf"^{group} is \[a,b\], but must be one choice"):
        check_jobs([f"{group}=[a,b]"])
