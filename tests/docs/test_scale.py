"""Sweeps in the report of scale have as many views as they say, and each kind a small one."""

import pytest

from docs._tables import __main__ as command
from docs._tables import scale
from sweeps.app import make_command as sweeping
from sweeps.engine.resolve.overrides import read_jobs
from sweeps.experiment import EXPERIMENT
from sweeps.stages.views import Grid


@pytest.mark.parametrize(
    ("kind", "views", "aspects"), scale.grids()[:2] + scale.grids()[4:6] + scale.grids()[10:11]
)
def test_sweeps_have_as_many_views_as_they_say(kind, views, aspects):
    jobs = read_jobs(EXPERIMENT, [*scale.SCENE, *aspects], several=False)
    [(plan, _)] = sweeping().prepare(jobs)
    swept = len(plan.choices[Grid.aspect]) * len(plan.choices[Grid.range])
    assert len(scale.SHIPS) * swept == views
    assert (kind == scale.LEARNED) == ("grid.random_aspects=0" in aspects)


def test_every_kind_has_a_sweep_of_the_least_number_of_views():
    kinds = {kind for kind, views, _ in scale.grids() if views <= scale.MIN_VIEWS}
    assert kinds == {scale.LEARNED, scale.RANDOM}
    with pytest.raises(SystemExit):
        command.main(["scale", "--most", str(scale.MIN_VIEWS - 1)])
