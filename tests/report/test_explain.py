"""`--explain` has a meaning for every word of the tables, and near words for unknown ones."""

import pytest
from commands import ran
from pages import read_page
from rich.cells import cell_len
from stores import reported

from sweeps.report.explain import glossary, meaning
from sweeps.report.frames import read_frames
from sweeps.report.outputs import page_file


@pytest.mark.parametrize("word", ["ACN", "acn", "points below bound", "Range-Profile"])
def test_both_commands_explain_glossary_terms(word, monkeypatch, capsys):
    assert reported(monkeypatch, "--explain", *word.split()) == 0
    captured = capsys.readouterr()
    assert ran("--explain", *word.split()) == 0
    assert capsys.readouterr() == captured
    term, *lines = captured.out.splitlines()
    assert any(term in names for names in glossary()) and captured.err == ""
    assert " ".join("".join(f"{line} " for line in lines).split()) == meaning(word)
    assert max(map(cell_len, lines)) < 80 and not set("`*[") & set(captured.out)


@pytest.mark.parametrize(
    ("word", "near"),
    [("ACM", "ACN"), ("vigilanse", "vigilance"), ("qqq", "--explain")],
)
def test_unknown_term_is_refused_with_suggestions(word, near, monkeypatch, capsys):
    status = reported(monkeypatch, "--explain", word)
    captured = capsys.readouterr()
    assert status == 2 and captured.out == "" and captured.err.count("\n") == 1
    assert repr(word) in captured.err and near in captured.err


def test_every_table_heading_is_in_the_glossary(smoke_store):
    for frame in read_frames(smoke_store).values():
        names = [*frame.figures, *frame.varying_axes]
        words = {frame.columns[name].words for name in names}
        assert not {word for word in words if not meaning(word)}, frame.name


def test_page_table_headings_have_glossary_tooltips(smoke_store):
    page = read_page(page_file(smoke_store))
    section = page.root.only("section", id="table-scores")
    heads = {head.text: head.attrs.get("title") for head in section.all("th", scope="col")}
    assert heads["pulse width [ns]"] == meaning("pulse width")
    assert meaning("classifier") in heads["classifier, channel, scored"]
    assert heads["overall"] == meaning("overall")
