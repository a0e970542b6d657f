"""Documents with a checksum: one line of JSON, so that any change of it is noticed."""

from __future__ import annotations

import json
import zlib
from typing import Any


def seal(document: Any) -> bytes:
    """Line of bytes for a document of JSON values, which begins with its checksum."""
    text = json.dumps(document, separators=(",", ":")).encode()
    return b"%08x %s\n" % (zlib.crc32(text), text)


def unseal(line: bytes) -> Any:
    """Document of a line made by `seal`.

    Raises
    ------
    ValueError
        If the line is not as it was made.
    """
    text = line[9:-1]
    if line != b"%08x %s\n" % (zlib.crc32(text), text):
        raise ValueError("its checksum differs")
    return json.loads(text)
