"""The report of workers of a scheduler is right for three workers and twelve cells."""

from benchmarks import toy, workers


def test_scheduler_benchmark_runs_with_few_workers(monkeypatch):
    monkeypatch.setattr(workers, "HOSTS", 1)
    (row,) = workers.measure(counts=(3,), calls=4).rows
    assert row["workers"] == 3 and row["cells"] == 12 and 1 <= row["tasks"] <= 12
    assert row["seconds"] > 12 * toy.NAP / 3
    assert row["rate"] == row["tasks"] / row["seconds"]
    assert row["command_mib"] > 10 and row["scheduler_mib"] > 10
