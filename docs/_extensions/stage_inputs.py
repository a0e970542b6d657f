"""Table of the inputs of a stage, made from declarations; as a script, it is written."""

import csv
import inspect
import io
import re
from collections.abc import Iterator
from pathlib import Path

from sweeps.engine.declare.kinds import Count, Draws, Number, Switch
from sweeps.engine.declare.settings import Setting, Unit
from sweeps.engine.declare.stage import Stage
from sweeps.experiment import stages_of
from sweeps.stages import infrared, ladar, views

TABLE = Path(__file__).resolve().parents[1] / "tables" / "stage_inputs.csv"
SI = {"km": "m", "ns": "s", "urad": "rad", "um": "m", "dB km-1": "dB m-1"}
TYPES = {Count: "int", Draws: "int", Number: "float", Switch: "bool"}
MAX_OUTPUTS = 4  # arrays that are listed
OBJECTS = {  # what holds several arrays: these, their shapes, and their units
    "MeshSource": ("`sweeps.stages.meshes.MeshSource`: `name`, `digest`, `transform`", ""),
    "trimesh.Trimesh": ("`trimesh.Trimesh`: `vertices` (n, 3), `faces` (m, 3)", "m, ship frame"),
    "RangeImage | LineImage | Mask": (
        "`ncti.render.RangeImage`: `down_range`, `hit`, `cos_incidence` (row, col); of lines "
        "`LineImage`, of outlines only `Mask`",
        "m",
    ),
    "RangeExtent": ("`ncti.ladar.RangeExtent`: `fraction` (ifov, bin), `down_range` (bin,)", "m"),
    "DetectorView": ("`ncti.infrared.DetectorView`", "m"),
    "IfovOffset": ("a pair of numbers", "IFOV"),
}


def rows() -> Iterator[tuple[str, str, str, str]]:
    """Yield name, type with shape, unit and meaning of each input but settings of rendering."""
    for group in (views.Grid, views.Scene):
        for setting in group.declared:
            yield setting_row(group.__name__, setting)
    yield "`rng`", "`numpy.random.Generator`", "", "the stage's own draws; see `stream=`"
    yield "`valid`", "bool (gathered axes)", "", "whether an input was made; with `gather=`"
    names_by_row: dict[tuple[str, str, str], list[str]] = {}
    for module in (views, ladar, infrared):
        for stage in stages_of([module]):
            name, *row = stage_row(stage)
            names_by_row.setdefault((row[0], row[1], row[2]), []).append(name)
    for row, names in names_by_row.items():
        yield ", ".join(names), *row


def setting_row(group: str, setting: Setting) -> tuple[str, str, str, str]:
    """Return the row of a setting, as a stage gets it that uses its group."""
    kind = next((TYPES[kind] for kind in TYPES if isinstance(setting.kind, kind)), "str")
    unit = SI[setting.unit] if isinstance(setting.unit, Unit) else setting.unit
    name = setting.key.rpartition(".")[2]
    return f"`{name}`", kind, _unit(unit), f"{setting.label}; `uses=({group},)`"


def stage_row(stage: Stage) -> tuple[str, str, str, str]:
    """Return the row of a stage's result."""
    returned = inspect.get_annotations(stage.function).get("return", "")
    summary = (inspect.getdoc(stage.function) or "").partition("\n")[0]
    match = re.match(r"Return (?:the |a )?(\w+(?: \w+)?) \[([^]]*)\](.*)", summary)
    meaning = match[1] + match[3] if match else re.sub(r"^Return (the |a )?", "", summary)
    meaning = meaning.rstrip(".")
    if returned in OBJECTS:
        return f"`{stage.name}`", *OBJECTS[returned], meaning
    if not stage.outputs:
        words = returned.replace(" | ", " or ") or "pairs of a keyword and its value"
        return f"`{stage.name}`", words, match[2].replace("deg", "degree") if match else "", meaning
    if len(stage.outputs) > MAX_OUTPUTS:
        return f"`{stage.name}`", "packed arrays, of which other stages make an object", "", meaning
    several = len(stage.outputs) > 1
    arrays = [
        f"{f'`{output.name}` ' * several}{output.dtype} ({', '.join(output.dims)})"
        for output in stage.outputs
    ]
    units = dict.fromkeys(filter(None, (_unit(output.unit) for output in stage.outputs)))
    kind = ("mapping: " if several else "") + ", ".join(arrays)
    return f"`{stage.name}`", kind, ", ".join(units), meaning


def _unit(unit: str) -> str:
    return "" if unit == "1" else unit


def table() -> str:
    """Return the table as CSV."""
    text = io.StringIO()
    heads = ("argument", "type and shape", "unit", "meaning")
    csv.writer(text, lineterminator="\n").writerows((heads, *rows()))
    return text.getvalue()


if __name__ == "__main__":
    TABLE.write_text(table(), encoding="utf-8")
