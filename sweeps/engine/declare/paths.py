"""Paths of stores and caches: folders, and URLs of buckets."""

from __future__ import annotations

import os
import re
import stat
from contextlib import suppress
from itertools import accumulate
from pathlib import Path

from sweeps.engine.declare.errors import ConfigurationError

PathOrUrl = Path | str
"""A folder, or a URL."""

SCHEMES = ("s3", "gs", "az")
WRITABLE_BY_OTHERS = stat.S_IWGRP | stat.S_IWOTH

# A Path keeps one slash of a URL; several schemes may be chained.
_URL = re.compile(r"[A-Za-z][A-Za-z0-9+.:-]*:/")
_BUCKET = re.compile(rf"(?:{'|'.join(SCHEMES)})://[^/@?#:]+(?:/[^/@?#:]+)+")


def path_or_url(key: str, given: PathOrUrl) -> PathOrUrl:
    """Return a setting's value as a Path, or as a bucket URL without trailing slashes.

    Raises ConfigurationError for any other URL; the message omits secrets in the URL.
    """
    if not _URL.match(str(given)):
        return Path(given)
    url = str(given).rstrip("/")
    if not _BUCKET.fullmatch(url):
        kinds = ", ".join(f"{scheme}://BUCKET/NAME" for scheme in SCHEMES)
        redacted = re.sub(r"//[^/]*@|[?#].*", lambda match: match[0][:1] + "...", url)
        raise ConfigurationError(
            f"{key} is {redacted!r}, but must be a folder or a URL such as {kinds}; "
            "put credentials into the environment"
        )
    return url


def join(path: PathOrUrl, name: str) -> PathOrUrl:
    """Return the path of a name in a folder or URL; absolute in a folder."""
    return f"{path}/{name}" if isinstance(path, str) else path.absolute() / name


def resolve_path(path: PathOrUrl) -> PathOrUrl:
    """Return the absolute path without symlinks; a URL stays."""
    return Path(os.path.realpath(path)) if isinstance(path, Path) else path


def split_parent(path: PathOrUrl) -> tuple[PathOrUrl, str]:
    """Return parent and name."""
    if isinstance(path, Path):
        return path.parent, path.name
    parent, _, name = path.rpartition("/")
    return parent, name


def ancestors(path: PathOrUrl) -> list[PathOrUrl]:
    """Return all parents, the nearest first."""
    if isinstance(path, Path):
        return list(path.parents)
    bucket, *names = path.removeprefix(scheme := path.partition("//")[0] + "//").split("/")
    inside = list(accumulate(names[:-1], "{}/{}".format, initial=scheme + bucket))
    return list(reversed(inside))


def path_beside(path: PathOrUrl) -> Path:
    """Return the local path beside which logs and reports are written.

    For a URL, it is the name in the working folder.
    """
    return path if isinstance(path, Path) else Path.cwd() / split_parent(path)[1]


def is_private(folder: Path) -> bool:
    """Return whether only this user may write to a folder, or it does not exist."""
    with suppress(FileNotFoundError):
        status = os.stat(folder)
        return status.st_uid == os.geteuid() and not status.st_mode & WRITABLE_BY_OTHERS
    return True
