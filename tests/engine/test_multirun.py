"""Multiruns as one sweep: what is crossed, what runs together, what keeps apart."""

from dataclasses import replace

import numpy as np
import pytest
from hydra._internal.config_loader_impl import ConfigLoaderImpl
from omegaconf import OmegaConf
from small_stores import files, opened
from toys import CALLS, SPRINGS, Spring, go

from sweeps.engine.command import Command
from sweeps.engine.errors import ConfigurationError
from sweeps.engine.multirun import Job, crossed, fused, jobs_of
from sweeps.engine.settings import read_choices
from sweeps.engine.store import read_attributes

CONF = {
    "config.yaml": """
        defaults:
          - sweep_schema
          - cluster: inline
          - spring: soft
          - _self_
          - override hydra/launcher: fused
        hydra:
          run: {dir: "outputs/${now:%H-%M-%S-%f}"}
          sweep: {dir: "multirun/${now:%H-%M-%S-%f}"}
        """,
    "spring/soft.yaml": "{limit: 50, mass: 1}",
    "spring/hard.yaml": "{limit: 90, mass: 2}",
    "spring/stiff.yaml": "{limit: 90, mass: 3}",
    "experiment/short.yaml": """
        # @package _global_
        measured: {length: 2, rule: max}
        """,
    "experiment/long.yaml": """
        # @package _global_
        measured: {length: [3, 4], rule: mean}
        """,
}


@pytest.fixture
def command(tmp_path, monkeypatch):
    """Run a command line in a folder of its own; its exit status."""
    for name, text in CONF.items():
        file = tmp_path / "conf" / name
        file.parent.mkdir(parents=True, exist_ok=True)
        lines = text.strip("\n").splitlines()
        indent = min(len(line) - len(line.lstrip()) for line in lines if line.strip())
        file.write_text("\n".join(line[indent:] for line in lines))
    monkeypatch.chdir(tmp_path)
    command = Command(replace(SPRINGS, conf=tmp_path / "conf"))

    def start(*arguments):
        CALLS.clear()
        return command.main(["cache=cache", *arguments])

    return start


def test_swept_settings_are_crossed_into_one_cube(command, tmp_path):
    arguments = ("spring.mass=2,1,5", "spring.limit=60,50", "spring.stiffness=[1,2],[2,4]")
    assert command("-m", "store=m.zarr", *arguments[:2]) == 0
    go(tmp_path / "s.zarr", spring__mass=[1, 2, 5], spring__limit=[50, 60])
    assert files(tmp_path / "m.zarr") == files(tmp_path / "s.zarr")
    # Lists within jobs are as if all their values had been crossed, where they can be.
    assert command("-m", "store=l.zarr", *arguments) == 0
    assert files(tmp_path / "l.zarr") == files(tmp_path / "s.zarr")


def test_a_large_multirun_is_one_job(command, tmp_path, monkeypatch):
    composed = []
    compose = ConfigLoaderImpl.load_configuration

    def counted(*arguments, **how):
        composed.append(how)
        return compose(*arguments, **how)

    monkeypatch.setattr(ConfigLoaderImpl, "load_configuration", counted)
    grid = ("spring.mass=range(1,61)", "spring.limit=range(51,101)", "dry_run=true")
    grid += ("measured.draw=1", "measured.length=2", "measured.rule=max", "spring.stiffness=1")
    assert command("-m", "store=m.zarr", *grid) == 0
    assert len(composed) == 2 and not (tmp_path / "m.zarr").exists()
    # Without a list: once for each job, and once for what they have in common.
    composed.clear()
    jobs = ("store=m-${spring.mass}.zarr", "spring.mass=1,2", "spring.stiffness=1")
    assert command("-m", *jobs, "measured.draw=1") == 0
    assert len(composed) == 1 + 2 and len(list(tmp_path.glob("m-*.zarr"))) == 2
    assert len(list(tmp_path.glob("multirun/*/multirun.yaml"))) == 1


def test_the_choices_of_a_group_run_together_under_its_name(command, tmp_path):
    assert command("-m", "store=m.zarr", "spring=hard,soft", "measured.draw=1") == 0
    springs = opened(tmp_path / "m.zarr", "springs")
    assert springs.period.dims == ("stiffness", "spring")
    assert springs.spring.values.tolist() == ["hard", "soft"]
    assert springs.limit.values.tolist() == [90, 50] and springs.mass.values.tolist() == [2, 1]
    go(tmp_path / "s.zarr", spring__limit=[50, 90], spring__mass=[1, 2], measured__draw=1)
    whole = opened(tmp_path / "s.zarr", "springs")
    for name, limit, mass in (("hard", 90, 2), ("soft", 50, 1)):
        expected = whole.period.sel(limit=limit, mass=mass).values
        np.testing.assert_array_equal(springs.period.sel(spring=name), expected)
    joint = read_attributes(tmp_path / "m.zarr")["joint"]
    assert joint == [
        ["spring", ["spring.mass", "spring.limit"], [[2, 90], [1, 50]], ["hard", "soft"]]
    ]


def test_a_group_of_which_one_setting_differs_is_that_settings_axis(command, tmp_path):
    assert command("-m", "store=m.zarr", "spring=hard,stiff") == 0
    springs = opened(tmp_path / "m.zarr", "springs")
    assert springs.period.dims == ("stiffness", "mass") and springs.mass.values.tolist() == [2, 3]


def test_groups_cross_with_settings_and_grow(command, tmp_path):
    assert command("-m", "store=m.zarr", "spring=soft,hard", "measured.rule=max") == 0
    assert command("-m", "store=m.zarr", "spring=soft,hard", "measured.rule=max,mean") == 0
    assert CALLS.keys() == {"answers"} and CALLS["answers"] == 2 * 2 * 2
    assert command("-m", "store=n.zarr", "spring=soft,hard", "measured.rule=max,mean") == 0
    assert files(tmp_path / "m.zarr") == files(tmp_path / "n.zarr")
    # A third choice computes only itself.
    assert command("-m", "store=m.zarr", "spring=soft,hard,stiff", "measured.rule=max,mean") == 0
    assert CALLS["period"] == 3
    springs = opened(tmp_path / "m.zarr", "springs")
    assert springs.spring.values.tolist() == ["hard", "soft", "stiff"]


def test_experiments_that_no_product_makes_are_jobs(command, tmp_path):
    assert command("-m", "store=m.zarr", "+experiment=short,long", "measured.draw=1") == 0
    answers = opened(tmp_path / "m.zarr", "answers")
    assert answers.answer.dims == ("mass", "job")
    assert answers.length.values.tolist() == [2, 3, 4]
    assert answers.rule.values.tolist() == ["max", "mean", "mean"]
    assert answers.job.values.tolist() == [
        "length=2,rule=max",
        "length=3,rule=mean",
        "length=4,rule=mean",
    ]
    one = ("experiment=long", "measured.draw=1", "store=s.zarr")
    assert command("+" + one[0], *one[1:]) == 0
    alone = opened(tmp_path / "s.zarr", "answers").answer
    np.testing.assert_array_equal(answers.answer[:, 1:], alone)


def test_a_store_that_differs_by_job_keeps_jobs_apart(command, tmp_path):
    assert command("-m", "store=m-${spring.mass}.zarr", "spring.mass=1,2", "spring.limit=9,8") == 0
    for mass in (1, 2):
        springs = opened(tmp_path / f"m-{mass}.zarr", "springs")
        assert springs.period.dims == ("stiffness", "mass", "limit")
        assert springs.mass.values.tolist() == [mass] and springs.limit.values.tolist() == [8, 9]


def test_what_refers_to_what_is_swept_follows_it(command, tmp_path):
    assert command("-m", "store=m.zarr", "spring.mass=10,2", "spring.limit=${spring.mass}") == 0
    springs = opened(tmp_path / "m.zarr", "springs")
    assert springs.period.dims == ("stiffness", "mass")
    assert springs.mass.values.tolist() == ["2", "10"]  # what was written, as numbers ascend
    assert springs.spring_mass.values.tolist() == springs.limit.values.tolist() == [2, 10]


def test_batches_extend_the_store(command, tmp_path):
    batches = ("hydra.sweeper.max_batch_size=1", "spring=soft,hard", "+experiment=short,long")
    assert command("-m", "store=m.zarr", *batches) == 0
    assert CALLS["period"] == 6  # each but once
    assert command("-m", "store=n.zarr", *batches[1:]) == 0
    assert files(tmp_path / "m.zarr") == files(tmp_path / "n.zarr")


def test_hydras_own_launcher_has_a_store_a_job(command, tmp_path):
    assert command("-m", "hydra/launcher=basic", "spring.mass=1,2", "measured.draw=1") == 0
    stores = sorted((tmp_path / "multirun").glob("*/*/sweep.zarr"))
    assert [store.parent.name for store in stores] == ["0", "1"]
    assert [read_attributes(one)["configuration"]["spring"]["mass"] for one in stores] == [1, 2]


def test_without_a_store_it_lies_in_the_folder_of_the_multirun(command, tmp_path):
    assert command("-m", "spring.mass=1,2", "measured.draw=1") == 0
    (store,) = (tmp_path / "multirun").glob("*/sweep.zarr")
    assert opened(store, "springs").mass.values.tolist() == [1, 2]


def test_settings_run_together_by_zip(command, tmp_path):
    pairs = ("spring.mass=[3,1,3]", "spring.limit=[9,9,5]", "grid.zip=[[mass,spring.limit]]")
    assert command("store=z.zarr", *pairs) == 0
    springs = opened(tmp_path / "z.zarr", "springs")
    assert springs.period.dims == ("stiffness", "mass_limit")
    assert springs.mass.values.tolist() == [1, 3, 3]
    assert springs.limit.values.tolist() == [9, 5, 9]
    labels = ["mass=1,limit=9", "mass=3,limit=5", "mass=3,limit=9"]
    assert springs.mass_limit.values.tolist() == labels
    one = springs.sel(mass_limit="mass=3,limit=5")
    assert (one.mass, one.limit) == (3, 5)
    assert CALLS["period"] == 3 * 3
    assert springs.energy.sizes == {"stiffness": 3, "mass_limit": 3}


def test_a_dry_run_of_hydras_own_jobs_writes_no_store(command, tmp_path):
    assert command("-m", "hydra/launcher=basic", "spring.mass=1,2", "dry_run=true") == 0
    sweeper = "hydra/sweeper=basic"
    assert command("-m", sweeper, "store=m.zarr", "spring.mass=1,2", "dry_run=true") == 0
    assert not list(tmp_path.rglob("*.zarr")) and not CALLS


REFUSED = [
    (
        ("-m", "store=m.zarr", "cluster.workers=1,null"),
        "springs: cluster.workers is 1 and null in jobs of one store, but must be one: it sets "
        "where or how to run; put it into the store's path for a store each",
    ),
    (
        ("-m", "store=m.zarr", "cache_limit=1,2"),
        "springs: cache_limit is 1.0 and 2.0 in jobs of one store, but must be one: it sets where "
        "or how to run; put it into the store's path for a store each",
    ),
    (
        ("-m", "store=m.zarr", "spring.mass=1,nothing"),
        "springs: spring.mass has 'nothing', but every value must be a finite number at least 0.1",
    ),
    (
        ("-m", "store=m.zarr", "spring.mass=1,1"),
        "springs: spring.mass has 1.0 more than once, but values must differ",
    ),
    (
        ("store=z.zarr", "spring.mass=[1,2]", "grid.zip=[[mass,limit]]"),
        "springs: grid.zip has spring.mass, spring.limit, which must have equally many values, but "
        "spring.mass has 2, spring.limit has 1",
    ),
    (
        ("store=z.zarr", "grid.zip=[[mass,nothing]]"),
        "springs: grid.zip has 'nothing', which is not a setting; give a whole key",
    ),
    (
        ("store=z.zarr", "grid.zip=[[mass,mass]]"),
        "springs: grid.zip has 'spring.mass' more than once, but values must differ",
    ),
    (
        ("store=z.zarr", "grid.zip=[[mass,store]]"),
        "springs: grid.zip has 'store', but it takes one value: it sets where or how to run",
    ),
    (
        (
            "-m",
            "store=m.zarr",
            "spring.mass=[1,2],[2,3]",
            "spring.limit=[8,9]",
            "grid.zip=[[mass,limit]]",
        ),
        "springs: grid.zip has settings whose values differ between jobs of one store; put them "
        "into the store's path for a store each",
    ),
    (
        ("-m", "store=m.zarr", "spring=soft,missing"),
        "springs: spring is 'missing', but must be one of hard, soft, stiff",
    ),
    (
        ("store=m.zarr", "spring=[soft,hard]"),
        "springs: spring is [soft,hard], but must be one choice",
    ),
]


@pytest.mark.parametrize(("arguments", "sentence"), REFUSED, ids=[one[0][-1] for one in REFUSED])
def test_what_cannot_be_one_sweep_is_refused(command, tmp_path, capsys, arguments, sentence):
    assert command(*arguments) == 2
    assert capsys.readouterr().err.strip() == sentence
    assert not list(tmp_path.glob("*.zarr")) and not (tmp_path / "cache").exists()


def jobs(*settings, store="/s.zarr"):
    """Jobs of springs, with what was swept."""
    found = []
    for given in settings:
        given = {f"spring.{name}": value for name, value in given.items()}
        choices = read_choices(SPRINGS.declared, given)
        found.append(Job({key: str(value) for key, value in given.items()}, choices, store))
    return found


def test_jobs_that_are_equal_are_one():
    ((choices, store),) = fused(SPRINGS, jobs({"mass": 1}, {"mass": 1}))
    assert choices.one(Spring.mass) == 1 and store == "/s.zarr" and not choices.joint
    assert len(fused(SPRINGS, [*jobs({"mass": 1}), *jobs({"mass": 1}, store="/t.zarr")])) == 2
    assert len(fused(SPRINGS, [*jobs({"mass": 1}), *jobs({"mass": 1}, store="/./s.zarr")])) == 1


def test_a_product_of_jobs_is_crossed_and_less_is_not():
    four = [{"mass": m, "limit": n} for m in (1, 2) for n in (8, 9)]
    ((choices, _),) = fused(SPRINGS, jobs(*four))
    assert choices[Spring.mass] == (1, 2) and choices[Spring.limit] == (8, 9)
    assert not choices.joint
    ((choices, _),) = fused(SPRINGS, jobs(*four[:3]))
    (joint,) = choices.joint
    assert joint.name == "job" and joint.points == ((1, 8), (1, 9), (2, 8))


def test_what_becomes_a_list():
    given = ["store=s-${measured.length}.zarr", "measured.length=1,2", "spring.mass=1,2"]
    assert crossed(SPRINGS, given) == [*given[:2], "spring.mass=[1,2]"]
    kept = ["spring.mass=1,2", "hydra/launcher=basic"]
    assert crossed(SPRINGS, kept) == kept
    kept = ["spring.mass=1,2", "store=${hydra:job.num}.zarr"]
    assert crossed(SPRINGS, kept) == kept
    assert crossed(SPRINGS, ["measured.rule=choice(min,max)"]) == ["measured.rule=[min,max]"]
    assert crossed(SPRINGS, ["spring.mass=range(1,4)"]) == ["spring.mass=[1,2,3]"]
    assert crossed(SPRINGS, ["cluster=inline,local"]) == ["cluster=inline,local"]
    assert crossed(SPRINGS, ["spring.mass="]) == ["spring.mass="]


def test_jobs_of_hydras_sweeper():
    def master(*overrides, sweeper="hydra.BasicSweeper"):
        node = {"overrides": {"task": list(overrides)}, "sweeper": {"_target_": sweeper}}
        return OmegaConf.create({"hydra": node})

    assert jobs_of(None, master("a=1,2", "b=3")) == [["a=1", "b=3"], ["a=2", "b=3"]]
    assert jobs_of(None, master("a=1", sweeper="some.Other")) is None


def test_a_glob_is_all_choices_of_a_group(command, tmp_path):
    assert command("-m", "store=m.zarr", "spring=glob(*)", "measured.draw=1") == 0
    springs = opened(tmp_path / "m.zarr", "springs")
    assert springs.spring.values.tolist() == ["hard", "soft", "stiff"]


class Named(str):
    """A label of something that two values of it may not share."""

    def __new__(cls, label, origin):
        named = super().__new__(cls, label)
        named.origin = origin
        return named


def test_equal_labels_of_different_things_are_refused():
    """A store has the labels only; of one thing, they are one value."""
    first = read_choices(SPRINGS.declared, {})
    alike, other = (
        [
            Job({"run": str(n)}, first.having(Spring.limit, (Named("a", origin),)), "s.zarr")
            for n, origin in enumerate(origins)
        ]
        for origins in ("xx", "xy")
    )
    [(choices, _)] = fused(SPRINGS, alike)
    assert choices[Spring.limit] == ("a",)
    with pytest.raises(ConfigurationError, match=r"^spring\.limit has 'a' for two values in jobs"):
        fused(SPRINGS, other)


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (
            ["-m", "spring.mass=range(1,1e8)"],
            "spring.mass is range(1,1e8), which has 99,999,999 values, but may have at most "
            "100,000",
        ),
        (
            ["-m", "spring.mass=range(1,inf)"],
            "spring.mass is range(1,inf), which has endless values, but may have at most 100,000",
        ),
        (
            ["-m", "seed=range(0,300000)", "spring.mass=1,2"],
            "seed is range(0,300000), which has 300,000 values, but may have at most 100,000",
        ),
        (
            ["-m", "cache_limit=range(1,201)", "cluster.workers=range(1,10)", "spring.mass=1,2"],
            "cache_limit is range(1,201), which makes 1,800 jobs, but there may be at most 1,000; "
            "a setting that may have several values is an axis of one job",
        ),
        (
            [f"spring.{name}={{start:1,stop:90000,step:1}}" for name in ("mass", "stiffness")],
            "cells, but may have at most 10,000,000; numbers of values: spring.stiffness (90,000), "
            "spring.mass (90,000)",
        ),
    ],
)
def test_grids_that_no_memory_holds_are_refused(arguments, sentence, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert Command(SPRINGS).main(["cluster=inline", "cache=cache", "store=s.zarr", *arguments]) == 2
    (said,) = capsys.readouterr().err.splitlines()
    assert said.startswith("springs: ") and sentence in said and not list(tmp_path.iterdir())
