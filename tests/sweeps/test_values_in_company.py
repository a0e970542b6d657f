"""Stages that compute values together give each value, to the bit, as it is alone."""

from collections import Counter
from pathlib import Path

import yaml
from commands import FAST, chosen

from sweeps.engine.resolve.plan import Plan
from sweeps.experiment import EXPERIMENT, MODULES, stages_of
from sweeps.testing import check_pure

SWEEPS = yaml.safe_load(Path(__file__).with_name("company.yaml").read_text())
MAX_CELLS = 4  # cells of a stage that are computed alone


def of_new_sensors(compared):
    """Yield overrides of a sweep of each sensor with stages not yet compared, with value pairs."""
    for module in MODULES:
        along = [s.along for s in stages_of([module]) if s.name not in compared]
        settings = {setting for axes in along for setting in axes}
        if settings and hasattr(module, "SENSOR"):
            first_values = {setting.key: setting.values(setting.default)[0] for setting in settings}
            pairs = [f"{key}=[{value},{value + 1}]" for key, value in first_values.items()]
            yield ["grid.ship=[duncan,texas]", "grid.aspect=60", f"sensor={module.SENSOR}", *pairs]


def test_batched_and_single_results_are_identical():
    compared: Counter[str] = Counter()
    for sweeps in (SWEEPS.values(), of_new_sensors(compared)):
        for overrides in sweeps:
            choices = chosen(*FAST, *overrides)
            names = {
                bound.name
                for bound, axes in Plan(EXPERIMENT, choices).along_strides.items()
                if axes
            }
            counts = check_pure(EXPERIMENT, choices, max_cells=MAX_CELLS)
            compared.update({name: cells for name, cells in counts.items() if name in names})
    together = {stage.name for stage in EXPERIMENT.stages if stage.along}
    assert len(together) > 10
    assert {name for name, cells in compared.items() if cells >= 2} == together
