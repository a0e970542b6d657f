"""Croissant cards of splits, and the files that they describe."""

from __future__ import annotations

import json
from collections.abc import Iterator
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ncti.data.splits import TEST, TRAIN, UNKNOWN, Split, parts_of

if TYPE_CHECKING:
    import xarray as xr

CARD = "croissant.json"
VERSION = "http://mlcommons.org/croissant/1.1"
PUBLISHED = "2026-11-28"  # of this version's rows, as in CITATION.cff
LICENSE = "https://spdx.org/licenses/BSD-3-Clause"
ENCODING = "application/jsonlines"
CITATION = (
    "@misc{ncti_sweep, title = {ncti-sweep: ship identification by laser radar and passive "
    "infrared}, author = {{The ncti-sweep authors}}}"
)
TYPES = {"U": "sc:Text", "i": "sc:Integer", "f": "sc:Float"}
PARTS = {
    TRAIN: "rows to learn from",
    TEST: "rows to be tested with",
    UNKNOWN: "rows of a ship absent from training, to be rejected",
}
LEFT_OUT = ("expected",)  # variables that are not measured
CONTEXT = {
    "@language": "en",
    "@vocab": "https://schema.org/",
    "sc": "https://schema.org/",
    "cr": "http://mlcommons.org/croissant/",
    "rai": "http://mlcommons.org/croissant/RAI/",
    "dct": "http://purl.org/dc/terms/",
    "conformsTo": "dct:conformsTo",
    "data": {"@id": "cr:data", "@type": "@json"},
    "dataType": {"@id": "cr:dataType", "@type": "@vocab"},
    "description": {"@container": "@language"},
    "name": {"@container": "@language"},
    "examples": {"@id": "cr:examples", "@type": "@json"},
    **{
        name: f"cr:{name}"
        for name in (
            *("arrayShape", "citeAs", "column", "containedIn", "equivalentProperty", "extract"),
            *("field", "fileObject", "fileProperty", "fileSet", "format", "includes", "isArray"),
            *("isLiveDataset", "jsonPath", "key", "md5", "parentField", "path", "recordSet"),
            *("references", "regex", "repeated", "replace", "samplingRate", "separator", "source"),
            *("subField", "transform"),
        )
    },
}


def card(split: Split) -> dict[str, Any]:
    """Return the description of a split in the Croissant format, as JSON-LD.

    Parameters
    ----------
    split : Split
        Split.

    Returns
    -------
    dict
        Croissant 1.1 [1]_: the question, the files of `save` with their checksums, and the fields
        of a row with their types and meanings.

    See Also
    --------
    save : Writes the card and the files that it describes.
    split : Makes a split.

    References
    ----------
    .. [1] MLCommons, Croissant Format Specification 1.1, https://docs.mlcommons.org/croissant.

    Examples
    --------
    >>> import ncti
    >>> about = ncti.data.card(ncti.data.split("few-frames", seed=0, train=16, test=4))
    >>> about["name"], [file["@id"] for file in about["distribution"]]
    ('few-frames', ['train.jsonl', 'test.jsonl'])
    """
    parts = parts_of(split)
    summary = f"{split.question} Simulated range profiles of a laser radar, seed {split.seed}: " + (
        "; ".join(f"{rows.sizes['row']} {PARTS[part]}" for part, rows in parts.items())
    )
    return {
        "@context": CONTEXT,
        "@type": "sc:Dataset",
        "conformsTo": VERSION,
        "name": split.name,
        "description": summary + ".",
        "version": version("ncti-sweep"),
        "datePublished": PUBLISHED,
        "license": LICENSE,
        "creator": {"@type": "sc:Organization", "name": "The ncti-sweep authors"},
        "citeAs": CITATION,
        "keywords": ["laser radar", "range profile", "ship identification", "simulation"],
        "distribution": [_describe_file(part, rows) for part, rows in parts.items()],
        "recordSet": [_describe_records(part, rows) for part, rows in parts.items()],
    }


def save(split: Split, folder: Path) -> None:
    """Write a split into a folder: its card, and a file of JSON lines for each part.

    Parameters
    ----------
    split : Split
        Split.
    folder : Path
        Folder, created if missing; files of the same names are replaced.

    See Also
    --------
    card : Content of the card.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import ncti
    >>> halves = ncti.data.split("aspect-random", seed=0, train=16, test=4)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     ncti.data.save(halves, Path(folder))
    ...     sorted(path.name for path in Path(folder).iterdir())
    ['croissant.json', 'test.jsonl', 'train.jsonl']
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    for part, rows in parts_of(split).items():
        with (folder / f"{part}.jsonl").open("wb") as file:
            file.writelines(_encode_rows(rows))
    (folder / CARD).write_text(json.dumps(card(split), indent=1) + "\n", encoding="utf-8")


def _column_names(rows: xr.Dataset) -> list[str]:
    """Return the names of the variables of a row that the card describes."""
    variables = (str(name) for name in rows.variables if "row" in rows[name].dims)
    return [name for name in variables if name not in LEFT_OUT]


def _encode_rows(rows: xr.Dataset) -> Iterator[bytes]:
    """Yield the lines of a part's file, numbers with enough digits to be distinct."""
    columns = _column_names(rows)
    for k in range(rows.sizes["row"]):
        values = {name: rows[name].values[k] for name in columns}
        texts = (f"{json.dumps(name)}: {_json_value(value)}" for name, value in values.items())
        yield f"{{{', '.join(texts)}}}\n".encode()


def _json_value(value: Any) -> str:
    """Return a value of a row as JSON."""
    if np.ndim(value):
        return "[" + ",".join(map(_json_value, value)) + "]"
    return f"{value:.9g}" if value.dtype == np.float32 else json.dumps(value.item())


def _describe_file(part: str, rows: xr.Dataset) -> dict[str, Any]:
    """Return the description of a part's file."""
    digest = sha256()
    for line in _encode_rows(rows):
        digest.update(line)
    name = f"{part}.jsonl"
    entry = {"@type": "cr:FileObject", "@id": name, "name": name, "description": PARTS[part]}
    return entry | {"contentUrl": name, "encodingFormat": ENCODING, "sha256": digest.hexdigest()}


def _describe_records(part: str, rows: xr.Dataset) -> dict[str, Any]:
    """Return the description of a part's rows."""
    fields = []
    for name in _column_names(rows):
        variable = rows[name]
        units = variable.attrs.get("units", "1")
        label = variable.attrs["long_name"] + (f" [{units}]" if units != "1" else "")
        shape = variable.shape[1:]
        array = {"isArray": True, "arrayShape": ",".join(map(str, shape))} if shape else {}
        source = {"fileObject": {"@id": f"{part}.jsonl"}, "extract": {"column": name}}
        entry = {"@type": "cr:Field", "@id": f"{part}/{name}", "name": name, "description": label}
        kind = {"dataType": TYPES[variable.dtype.kind], "source": source}
        fields.append(entry | kind | array)
    return {"@type": "cr:RecordSet", "@id": part, "name": part, "field": fields}
