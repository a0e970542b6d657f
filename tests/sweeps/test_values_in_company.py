"""Every stage that computes values together: each comes out the same, to the bit, alone."""

from collections import Counter

from commands import FAST, chosen
from company import company

from sweeps.experiment import EXPERIMENT

SHIPS = "grid.ship=[duncan,texas] grid.aspect=[0,60]"
PROFILES = f"{SHIPS} grid.pulse_width=30"
SWEEPS = {
    "range": f"{PROFILES} grid.frame_count=[2,3,8] grid.vigilance=[0.9,0.97] grid.replicate=2 "
    "classifier=all classifier.mnn.epochs=20 classifier.left_out=[false,true] "
    "classifier.gain_sigma=[0,1] classifier.label_rule=[majority,first] "
    "classifier.score_rule=[ship,category] classifier.orders=2 ladar.subpixel_offsets=2 "
    "classifier.learn_in_test=[false,true]",
    "infrared": f"{SHIPS} sensor=infrared infrared.range=50 infrared.frame_count=[2,5] "
    "infrared.vigilance=[0.8,0.9] infrared.segmentation=[matched,otsu] "
    "infrared.inner_radius=[0.5,0.7] infrared.interpolation=[nearest,bilinear] "
    "infrared.subpixel_offsets=2 infrared.orders=2 classifier.label_rule=[majority,first] "
    "classifier.score_rule=[ship,category] infrared.super_resolution=[none,shifted]",
    "both": f"{PROFILES} sensor=both classifier=fusion grid.range=50 infrared.subpixel_offsets=2 "
    "grid.frame_count=[2,8] infrared.frame_count=[2,5] classifier.gain_sigma=[0,1] "
    "infrared.super_resolution=none",
    "irar": "sensor=irar grid.ship=roberts grid.aspect=175 grid.pulse_width=[30,50] "
    "irar.ifov=1500 irar.samples=30 irar.line_rate=20 irar.pulse_rate=2000 irar.detectors=2 "
    "irar.range=3 irar.profile_frames=[4,16] classifier=acn",
    "run_time": "sensor=run_time grid.ship=duncan grid.aspect=60 grid.pulse_width=[30,50] "
    "render.pixel=[1,2] render.roll=[0,30] ladar.spread=[0,0.5] run_time.repeats=1",
    "scan": "sensor=scan grid.ship=[duncan,texas] grid.aspect=[30,60] grid.range=50 "
    "grid.frame_count=[2,5] grid.replicate=2 scan.known_views=2",
}
MOST = 4  # cells of a stage that are computed alone


def test_every_value_is_the_same_alone_and_in_company():
    compared: Counter[str] = Counter()
    for overrides in SWEEPS.values():
        compared.update(company(EXPERIMENT, chosen(*FAST, *overrides.split()), most=MOST))
    together = {stage.name for stage in EXPERIMENT.stages if stage.along}
    assert len(together) > 10
    assert {name for name, cells in compared.items() if cells >= 2} == together
