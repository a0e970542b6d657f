"""What the likelihood classifier takes as known, and what it gains."""

from once import sharing_ships

from benchmarks import bounds, repeated
from sweeps.engine.cluster import ClusterChoice


def test_every_combination_of_what_is_known_has_a_row(monkeypatch, tmp_path):
    """Two draws of two aspects between those learned: knowing all is not worse."""
    monkeypatch.setattr(repeated, "cache_folder", lambda: sharing_ships(tmp_path))
    inline = ClusterChoice(kind="inline")
    report = bounds.measure(2, 6.0, (4, 16), ("grid.ship=[duncan,texas]",), inline)
    rows = [(row["aspect"], row["floor"], row["gain"]) for row in report.rows]
    assert len(set(rows)) == len(rows) == 12
    assert [column.key for column in report.columns][3:] == ["4", "16"]
    means = {
        row: float(one["16"].split(" ")[0]) for row, one in zip(rows, report.rows, strict=True)
    }
    assert means["known", "known", "known"] >= means["unknown", "unknown", "unknown"]
