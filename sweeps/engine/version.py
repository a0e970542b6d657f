"""Version of a command, without importing anything that takes long."""

from importlib.metadata import PackageNotFoundError, version

OPTION = "--version"


def version_of(command: str, distribution: str) -> str:
    """Return the name of a command and the version of its distribution."""
    try:
        return f"{command} {version(distribution)}"
    except PackageNotFoundError:
        return f"{command} unknown"
