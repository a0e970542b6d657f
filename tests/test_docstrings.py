"""Public names of the library have a summary, an example, See Also and references."""

import ast
import inspect
import re
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

import ncti
from ncti.checks import UNITS

ARTICLE = (
    '"Non-Cooperative Identification of Ships with Electrooptical Data", The Lincoln Laboratory '
    "Journal"
)
OF_A_SOURCE = r"\barticle\b|\b(Equation|Table|Figure|Appendix) [A-Z0-9]"
ROOT = Path(ncti.__file__).parent.parent
LIBRARY = sorted(path for name in ("ncti", "studies") for path in (ROOT / name).rglob("*.py"))
NO_SUMMARY = r"(What|Where|When|How|Whether|That|Who|Whose|Which|Why)\b"


def sections(text: str) -> dict[str, str]:
    """Return the text of each section of a docstring by title, with the body before them."""
    parts = re.split(r"^(\S.*)\n-{3,}\n", text, flags=re.MULTILINE)
    return {"body": parts[0], **dict(zip(parts[1::2], parts[2::2], strict=True))}


def problems(name: str, thing: Any) -> Iterator[str]:
    """Yield faults of the docstring of one public function or class."""
    text = inspect.cleandoc(thing.__doc__ or "")
    summary, *after = text.split("\n", 2)
    found = sections(text)
    if not re.fullmatch(r"[A-Z].*[^.]\.", summary) or (after and after[0]):
        yield f"{name}: its docstring must begin with one sentence on one line"
    if re.match(NO_SUMMARY, summary):
        yield f"{name}: '{summary}' must begin with what is returned or done"
    if ">>> " not in found.get("Examples", ""):
        yield f"{name}: no Examples with >>>"
    if not found.get("See Also", "").strip():  # the site's build resolves its names
        yield f"{name}: no See Also"
    yield from sources(name, text, found)


def sources(name: str, text: str, found: dict[str, str]) -> Iterator[str]:
    """Yield faults of the references of one docstring."""
    references = " ".join(found.get("References", "").split())
    before = text.partition("References\n---")[0]
    if re.search(OF_A_SOURCE, before) and not references:
        yield f"{name}: it speaks of a source, but has no References"
    if re.search(r"\barticle\b", before, flags=re.IGNORECASE) and ARTICLE not in references:
        yield f"{name}: its References lack the full reference of the article"
    for number in re.findall(r"\.\. \[(\w+)\]", references):
        if f"[{number}]_" not in before:
            yield f"{name}: reference [{number}] is never cited"
    for number in re.findall(r"\[(\w+)\]_", before):
        if f".. [{number}]" not in references:
            yield f"{name}: there is no reference [{number}]"


@pytest.mark.parametrize("package", ncti.__all__)
def test_public_names_are_documented(package):
    module = import_module(f"ncti.{package}")
    public = {name: getattr(module, name) for name in module.__all__}
    documented = {
        name: thing
        for name, thing in public.items()
        if inspect.isclass(thing) or inspect.isroutine(inspect.unwrap(thing))
    }
    assert documented
    found = [one for name, thing in documented.items() for one in problems(name, thing)]
    assert not found, "\n".join(found)


def documented_units() -> Iterator[tuple[str, str]]:
    """Yield parameters of every docstring of the library, and their units, empty without one."""
    text = "\n".join(path.read_text(encoding="utf-8") for path in LIBRARY)
    entry = r"^( *)(\w+(?:, \w+)*) : .*\n((?:\1    .*\n)+)"
    for _, names, meaning in re.findall(entry, text, re.MULTILINE):
        listed = names.split(", ")
        found = re.search(r"\[([a-z][^\]]*)\]", meaning, re.IGNORECASE)
        units = found[1].split(", ") if found else [""]
        yield from zip(listed, units if len(units) > 1 else units * len(listed), strict=False)
    # In prose an entry has a shape, a unit or both: `ifov` [rad], `aspect` (view,) [deg].
    shape = r" \((?:\.\.\.|[\w+. ]*,[\w+., ]*)?\)"
    prose = rf"(`\w+`(?:(?:,| and) `\w+`)*)(?:{shape}(?: \[([^\]]*)\])?| \[([^\]]*)\])"
    for names, *unit in re.findall(prose, " ".join(text.split())):
        yield from ((name, "".join(unit).strip("1")) for name in re.findall(r"`(\w+)`", names))


def test_messages_have_the_units_of_the_docstrings():
    units: dict[str, set[str]] = {}
    for name, unit in documented_units():
        units.setdefault(name, set()).add(unit)
    assert {name: {unit} for name, unit in UNITS.items()} == {
        name: units[name] - {""} for name in UNITS
    }
    trees = [ast.parse(path.read_text(encoding="utf-8")) for path in LIBRARY]
    calls = [one for tree in trees for one in ast.walk(tree) if isinstance(one, ast.Call)]
    checked = {
        first.value
        for call in calls
        if getattr(call.func, "id", "") in ("require", "require_all")
        for first in call.args[:1]
        if isinstance(first, ast.Constant)
    }
    always = {name for name in checked if len(units.get(name, ())) == 1 and units[name] != {""}}
    assert len(always) > 15 and always <= UNITS.keys()
