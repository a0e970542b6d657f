"""Command-line words that Hydra cannot read are refused with a replacement that it can read."""

import shlex
import subprocess

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from toys import SPRINGS

from sweeps.engine.command.line import Command
from sweeps.engine.declare.errors import ConfigurationError
from sweeps.engine.resolve.overrides import read_jobs

WIDE = "\N{FULLWIDTH DIGIT ONE}"


def refused(*words):
    """Return the error message that refuses a command line."""
    with pytest.raises(ConfigurationError) as caught:
        read_jobs(SPRINGS, words, several=False)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def advised(sentence, before="quote it, "):
    """Return the word advised at the end of a message, as a shell passes it on."""
    _, found, word = sentence.partition(before)
    assert found
    shell = ["sh", "-c", f"printf %s {word}"]
    passed = subprocess.run(shell, check=True, capture_output=True, text=True).stdout
    assert [passed] == shlex.split(word)
    return passed


PATHS = ["größe.stl", "hull(1)=3.stl", "a;b & c", "a\"b'c", "ü\\'", WIDE]


@pytest.mark.parametrize("path", PATHS)
def test_error_advises_quoting_paths_hydra_cannot_parse(path):
    sentence = refused(f"store={path}", "seed=1")
    assert sentence.startswith(f"store={path} cannot be read: quote it, ")
    [job] = read_jobs(SPRINGS, [advised(sentence), "seed=1"], several=False)
    assert job.store == path


@settings(max_examples=12, deadline=None)
@given(st.text("aß1.()=;&$!`'\"\\ ~#*?<>|%@:/-+", min_size=1))
def test_any_text_is_parsed_or_quoting_is_advised(text):
    try:
        [job] = read_jobs(SPRINGS, [f"cluster.queue={text}"], several=False)
    except ConfigurationError as error:
        if "quote it, " not in str(error):
            assert "a text that is not empty" in str(error)  # the word may be a number
            return
        [word] = shlex.split(str(error).partition("quote it, ")[2])
        [job] = read_jobs(SPRINGS, [word], several=False)
        assert job.choices.values["cluster.queue"] == (text,)


def test_error_rejoins_words_split_by_the_shell():
    word = advised(refused("spring.mass=[1,", "2]", "seed=1"))
    [job] = read_jobs(SPRINGS, [word], several=False)
    assert job.choices.values["spring.mass"] == (1, 2)
    sentence = refused("cluster.queue=[größe,", "x]")
    assert sentence.startswith("cluster.queue has 2 values, but must have one")


STEPS = "give steps, 'spring.mass={start: 1, stop: 7, step: 2}'"
SWEEP = "or sweep over it, -m"
CAUSES = {
    "spring.mass=[0 30]": "at least 0.1 kg; a list has commas, 'spring.mass=[0, 30]'",
    "spring.mass=3;2": "has '3;2', but must be a finite number at least 0.1 kg; a list has commas",
    "spring.mass=1:9:2": "; steps are 'spring.mass={start: 1, stop: 9, step: 2}'",
    f"spring.mass=[{WIDE},30]": f"has '{WIDE}', but must be a finite number at least 0.1 kg",
    "spring.mass": "spring.mass has no value, but must be KEY=VALUE",
    "spring.mass=range(1,9,2)": f"a list: {STEPS}; {SWEEP} 'spring.mass=range(1,9,2)'",
    "spring.mass=[range(1,9,2)]": f"[range(1,9,2)], but must be one value or a list: {STEPS}",
    "spring.mass=choice(1,2)": f"one value or a list: {SWEEP} 'spring.mass=choice(1,2)'",
    "spring.mass=1,2": f"or as a text, \"spring.mass='1,2'\"; {SWEEP} spring.mass=1,2",
    "spring.größe=3": "spring.größe is not a key of the configuration; ",
}


@pytest.mark.parametrize("word", CAUSES)
def test_unparsable_values_get_specific_advice(word):
    assert CAUSES[word] in refused(word, "seed=1")


def test_settings_given_as_options_are_refused(capsys):
    for word, advised in {"--spring.mass=3": "spring.mass=3", "--dry-run": "dry_run=VALUE"}.items():
        assert Command(SPRINGS).main([word]) == 2
        sentence = f"springs: {word} is not an option; give it without dashes, {advised}\n"
        assert capsys.readouterr().err == sentence
