"""The command `ncti-sweep`: Hydra's command line, and what it exits with."""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path

import hydra
from hydra._internal.core_plugins.basic_sweeper import BasicSweeper
from hydra._internal.utils import get_args_parser
from hydra.core.hydra_config import HydraConfig
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import ValueType
from hydra.errors import HydraException, OverrideParseException
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException
from rich.console import Console

from sweeps.errors import ConfigurationError, SweepIncomplete
from sweeps.prepare import Prepared, prepare
from sweeps.report.flight_pictures import MISSING, write_pictures
from sweeps.run import run_sweep
from sweeps.schema import IRAR, axis_keys, keys_of, register, unknown_key, unread
from sweeps.stages import load_ship

ALL_DONE, SOME_FAILED, WRONG = 0, 1, 2


def conf_folder() -> Path:
    """Folder of the configuration: inside the installed package, or at the repository root."""
    package = Path(__file__).resolve().parent
    inside = package / "conf"
    return inside if inside.is_dir() else package.parent / "conf"


def main() -> None:
    """Run the command line; exits with 0 done, 1 some cells failed, 2 wrong configuration."""
    register()
    # Hydra then raises what went wrong, instead of printing it and ending the process.
    os.environ["HYDRA_FULL_ERROR"] = "1"
    sys.argv[1:] = replace_axes(sys.argv[1:])
    try:
        check_jobs(sys.argv[1:])
        hydra.main(version_base="1.3", config_path=str(conf_folder()), config_name="config")(_job)()
    except (ConfigurationError, HydraException, OmegaConfBaseException) as error:
        print(f"ncti-sweep: {explain(error)}", file=sys.stderr)
        sys.exit(WRONG)
    except (FileNotFoundError, NotADirectoryError, PermissionError) as error:
        print(f"ncti-sweep: cannot write there: {error}", file=sys.stderr)
        sys.exit(WRONG)
    except SweepIncomplete as error:
        print(f"ncti-sweep: {error}", file=sys.stderr)
        sys.exit(SOME_FAILED)
    except KeyboardInterrupt:
        print("ncti-sweep: interrupted; the same command goes on from here", file=sys.stderr)
        sys.exit(130)
    sys.exit(ALL_DONE)


def replace_axes(arguments: list[str]) -> list[str]:
    """Let an axis of the command line replace the configured one, whatever its form.

    OmegaConf merges a mapping into a mapping and refuses to put a list in its place, or a mapping
    in a list's, so an axis is emptied before it is set: `grid.aspect=[0,45]` becomes
    `++grid.aspect=null grid.aspect=[0,45]` (with `++`, since a multirun keeps one override of
    each spelling).
    """
    axes = axis_keys()
    replaced = []
    for argument in arguments:
        plain = argument.lstrip("+")  # an axis is always there, so nothing is added
        key = plain.partition("=")[0]
        replaced += [f"++{key}=null", plain] if key in axes else [argument]
    return replaced


def check_jobs(arguments: list[str]) -> None:
    """Prepare every job that a command line asks for, so that a wrong one stops them all.

    Parameters
    ----------
    arguments : list of str
        The command line without the program's name.

    Raises
    ------
    ConfigurationError, HydraException, OmegaConfBaseException
        For the first job whose configuration is wrong. Nothing is written.

    Notes
    -----
    A command line that runs no job, or takes its configuration from elsewhere, is left to
    Hydra; each job is checked again when it starts.
    """
    options = get_args_parser().parse_args(arguments)
    asks = (options.help, options.hydra_help, options.cfg, options.info)
    elsewhere = (options.config_path, options.config_name, options.config_dir)
    if any(asks) or any(elsewhere) or options.shell_completion:
        return
    jobs = [options.overrides]
    if options.multirun:
        parsed = OverridesParser.create().parse_overrides(options.overrides)
        kinds = {override.value_type for override in parsed}
        if (
            any(override.key_or_group == "hydra/sweeper" for override in parsed)
            or ValueType.GLOB_CHOICE_SWEEP in kinds  # expanded by Hydra, which knows the groups
        ):
            return
        jobs = [job for batch in BasicSweeper.split_arguments(parsed, None) for job in batch]
    stores: set[str] = set()
    with hydra.initialize_config_dir(str(conf_folder()), version_base="1.3"):
        for overrides in jobs:
            kept = [item for item in overrides if not item.lstrip("+~").startswith("hydra")]
            for item in kept:
                _one_choice(item)
            try:
                composed = hydra.compose("config", overrides=kept)
            except (TypeError, ValueError) as error:  # Hydra's answer to a malformed override
                raise ConfigurationError(f"{' '.join(overrides)}: {error}") from error
            store = OmegaConf.to_container(composed, resolve=False)["store"]  # type: ignore[call-overload, index]
            if store is not None and "${hydra:" in store:
                composed.store = None  # known only once Hydra runs the job
            elif store is not None:
                store = os.path.abspath(store)
                if store in stores:
                    raise ConfigurationError(
                        f"store is {store!r} for several jobs, but each must have its own: leave "
                        "it out, or put ${hydra:job.num} into it"
                    )
                stores.add(store)
            prepare(composed)


def _one_choice(override: str) -> None:
    """Refuse a list where a group's one file is chosen: Hydra would lay them over one another."""
    several = re.fullmatch(r"(\w+)=(\[.*\])", override)
    if several and (conf_folder() / several[1]).is_dir():
        group, value = several.groups()
        hint = "; classifier.name takes a list" if group == "classifier" else ""
        raise ConfigurationError(f"{group} is {value}, but must be one choice{hint}")


def _job(composed: DictConfig) -> None:
    """One job of Hydra's: one sweep with its own store."""
    prepared = prepare(composed)
    given = HydraConfig.get().overrides.task
    for sentence in (*prepared.config.silent, *unread(given, prepared.config.sensor)):
        print(f"ncti-sweep: {sentence}", file=sys.stderr)
    folder = Path(HydraConfig.get().runtime.output_dir)
    path = Path(prepared.config.store or folder / "sweep.zarr")
    run_sweep(prepared, path)
    if prepared.config.irar.pictures and IRAR in prepared.config.sensors:
        _draw(prepared, path)


def _draw(prepared: Prepared, path: Path) -> None:
    """Pictures of a finished sweep of flights, which is as good without them."""
    ships = {ship.label: ship for ship in prepared.ships}
    try:
        write_pictures(
            path,
            Console(),
            ship=lambda label: load_ship(ships[label].source, ships[label].digest, prepared.cache),
        )
    except ImportError:
        print(f"ncti-sweep: pictures are not drawn: {MISSING}", file=sys.stderr)
    except (OSError, ValueError) as error:
        print(f"ncti-sweep: pictures are not drawn: {error}", file=sys.stderr)


def explain(error: Exception) -> str:
    """One sentence for what Hydra and OmegaConf say in several lines."""
    if isinstance(error, ConfigurationError):
        return str(error)
    if isinstance(error, OverrideParseException):
        why = str(error).partition("\n")[0]
        return f"{error.override} cannot be read ({why}), but must be KEY=VALUE as Hydra has it"
    chain: list[str] = []
    cause: BaseException | None = error
    while cause is not None:
        chain.append(str(cause))
        cause = cause.__cause__
    text = "\n".join(chain)
    key = re.search(r"full_key: (\S+)", text)
    if key and re.search(r"Key '.*' (is )?not in", text):
        return unknown_key(key[1])
    switch = re.search(r"Value '(.*)' is not a valid bool", text)
    if key and switch:
        return f"{key[1]} is {switch[1]!r}, but must be true or false"
    group = re.search(r"not a subclass of \w+\. value: (.*)|Cannot merge DictConfig with", text)
    if key and group:
        given = group[1] or "a list"
        return f"{key[1]} is {given}, but must hold {', '.join(keys_of(key[1]))}"
    value = re.search(
        r"Value '(?P<value>.*)' of type .* could not be converted to (?P<type>\w+)"
        r"|Cannot convert .* to (?P<text>string): '(?P<given>.*)'",
        text,
    )
    if key and value:
        given = value["given"] if value["value"] is None else value["value"]
        kind = value["type"] or value["text"]
        return f"{key[1]} is {given!r}, but must be of type {kind.lower()}"
    if key and "is not Optional" in text:
        return f"{key[1]} is null, but must be given"
    choice = re.search(
        r"Could not find '(.+)/(.+)'.*?Available options in .*?:(.*?)\n\S", text, re.S
    )
    if choice:
        options = ", ".join(choice[3].split())
        return f"{choice[1]} is {choice[2]!r}, but must be one of {options}"
    return " ".join(text.split())


if __name__ == "__main__":
    main()
