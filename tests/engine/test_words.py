"""Command-line words that Hydra cannot read, or reads as a sweep, are refused in one sentence."""

import pytest
from toys import SPRINGS

from sweeps.engine.command.line import Command
from sweeps.engine.declare.errors import ConfigurationError
from sweeps.engine.resolve.overrides import read_jobs

WIDE = "\N{FULLWIDTH DIGIT ONE}"
UNREADABLE = "cannot be read, but must be KEY=VALUE; quote a list with spaces, 'KEY=[1, 2]', and"
ONE_OR_LIST = "one value or a list, such as 'spring.mass=[1,2]'; -m sweeps over the values of a key"
CAUSES = {
    "store=größe.stl": f"store=größe.stl {UNREADABLE}",
    "spring.mass=[1,": f"spring.mass=[1, {UNREADABLE}",
    "spring.mass=1:9:2": "spring.mass has '1:9:2', but must be a finite number at least 0.1 kg",
    f"spring.mass=[{WIDE},30]": f"spring.mass=[{WIDE},30] {UNREADABLE}",
    "spring.mass": "spring.mass has no value, but must be KEY=VALUE",
    "spring.mass=range(1,9,2)": f"spring.mass is range(1,9,2), but must be {ONE_OR_LIST}",
    "spring.mass=[range(1,9,2)]": f"spring.mass is [range(1,9,2)], but must be {ONE_OR_LIST}",
    "spring.größe=3": "spring.größe is not a key of the configuration; ",
}


@pytest.mark.parametrize("word", CAUSES)
def test_each_word_has_its_own_cause(word):
    with pytest.raises(ConfigurationError) as caught:
        read_jobs(SPRINGS, [word, "seed=1"], several=False)
    assert CAUSES[word] in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("word", "sentence"),
    [
        (
            "--spring.mass=3",
            "--spring.mass=3 is not an option; give it without dashes, spring.mass=3",
        ),
        ("--dry-run", "--dry-run is not an option; give it without dashes, dry_run=VALUE"),
    ],
)
def test_a_setting_is_no_option(word, sentence, capsys):
    assert Command(SPRINGS).main([word]) == 2
    assert capsys.readouterr().err == f"{SPRINGS.name}: {sentence}\n"
