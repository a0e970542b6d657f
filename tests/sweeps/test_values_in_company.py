"""Every stage that computes values together: each comes out the same, to the bit, alone."""

from collections import Counter
from pathlib import Path

import yaml
from commands import FAST, chosen
from company import company

from sweeps.experiment import EXPERIMENT

SWEEPS = yaml.safe_load(Path(__file__).with_name("company.yaml").read_text())
MOST = 4  # cells of a stage that are computed alone


def test_every_value_is_the_same_alone_and_in_company():
    compared: Counter[str] = Counter()
    for overrides in SWEEPS.values():
        compared.update(company(EXPERIMENT, chosen(*FAST, *overrides), most=MOST))
    together = {stage.name for stage in EXPERIMENT.stages if stage.along}
    assert len(together) > 10
    assert {name for name, cells in compared.items() if cells >= 2} == together
