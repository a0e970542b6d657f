"""Small experiments whose every choice is drawn from one seed, and the answers they give."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from commands import opened, swept
from numpy.typing import NDArray

KNOWN = ("duncan", "horne", "spruance", "texas")
UNKNOWN = ("connole", "roberts")


PROFILES = (
    "sensor=range",
    "render.engine=lines",
    "render.pixel=0.5",
    f"grid.ship=[{','.join((*KNOWN, *UNKNOWN))}]",
    f"classifier.unknown=[{','.join(UNKNOWN)}]",
    "grid.aspect={start: 0, stop: 90, step: 1.5}",
    "grid.random_aspects=8",
    "classifier.template_spacing=[1.5,3]",
    "grid.frame_count=16",
    "grid.replicate=3",
    "classifier.name=[acn,correlation,likelihood]",
    "classifier.gain_sigma=[0,1]",
)
"""Four ships learned every 1.5 and every 3 degrees and two that are not, at learned and at random
aspects, as the source's sensor sees them at 100 km."""

BOTH = (
    "sensor=both",
    "render.engine=lines",
    "render.pixel=0.5",
    "grid.frame_count=16",
    "grid.range=[25,50,100]",
    "infrared.range=[25,50,100]",
    "infrared.super_resolution=none",
    "infrared.subpixel_offsets=6",
    "grid.replicate=6",
    "classifier.name=fusion",
)
"""Profiles and silhouettes at some places of the ship on the detector."""

Answers = NDArray[np.float64]


def stream(seed: int, what: str) -> np.random.Generator:
    """Return the random numbers of one experiment of a seed."""
    return np.random.default_rng([seed, *what.encode()])


def sweep_of(seed: int, folder: Path, name: str, *overrides: str) -> Path:
    """Return the store of a sweep with results of its own."""
    done = swept(folder / f"{name}.zarr", folder / "cache", f"seed={seed}", *overrides)
    assert not done.failures
    return folder / f"{name}.zarr"


# What is named


def profile_sweep(seed: int, folder: Path) -> Path:
    """Return the store of `PROFILES`."""
    return sweep_of(seed, folder, "profiles", *PROFILES)


def sweep_of_both(seed: int, folder: Path) -> Path:
    """Return the store of `BOTH` at aspects 7.5 degrees apart, from one drawn at random on."""
    first = stream(seed, "both").uniform(0, 7.5)
    return sweep_of(
        seed, folder, "both", f"grid.aspect={{start: {first:.3f}, stop: 90, step: 7.5}}", *BOTH
    )


def answers(store: Path, classifier: str, **place: Any) -> xr.DataArray:
    """Return which answers of a classifier about ships that it has learned are right."""
    found = opened(store, f"classification/{classifier}").correct
    asked = found.sel({name: value for name, value in place.items() if name in found.dims})
    known = asked.sel(ship=list(KNOWN)).squeeze(drop=True)
    assert (known >= 0).all()
    return known


def is_multiple(aspect: xr.DataArray, spacing: float) -> xr.DataArray:
    """Return which aspects [deg] are learned with a spacing."""
    return np.abs(aspect / spacing - np.round(aspect / spacing)) < 1e-6


def of_views(right: xr.DataArray, aspects: xr.DataArray | bool = True) -> Answers:
    """(view,): share of right answers to each view at some aspects, over all draws."""
    share = right.mean([dim for dim in right.dims if dim not in ("ship", "aspect")])
    return (
        share.where(aspects).transpose("ship", "aspect").values[:, _flags(aspects, share)].ravel()
    )


def _flags(aspects: xr.DataArray | bool, share: xr.DataArray) -> NDArray[np.bool_]:
    return np.broadcast_to(np.asarray(aspects), share.sizes["aspect"])


def named_by(store: Path) -> dict[str, xr.DataArray]:
    """Return right answers of all classifiers of profiles, templates every 1.5 degrees."""
    spaced = {"template_spacing": 1.5}
    return {
        "acn": answers(store, "acn", **spaced),
        "correlation": answers(store, "correlation", **spaced),
        "gain unknown": answers(store, "likelihood", gain_sigma=1, **spaced),
        "gain known": answers(store, "likelihood", gain_sigma=0, **spaced),
    }


def shares_of_profiles(store: Path) -> dict[str, xr.DataArray]:
    """Return right answers at learned aspects, of the source's protocol and of denser templates."""
    network = answers(store, "acn", template_spacing=3.0)
    network = network.sel(aspect=is_multiple(network.aspect, 3))
    found = {
        "acn, bow": network.sel(aspect=network.aspect < 30),
        "acn, beam": network.sel(aspect=network.aspect >= 60),
    }
    named = named_by(store)
    for name in ("acn", "gain known", "gain unknown"):
        found[name] = named[name].sel(aspect=is_multiple(named[name].aspect, 1.5))
    for name in ("gain known", "gain unknown"):
        found[f"{name}, beam"] = found[name].sel(aspect=found[name].aspect >= 60)
    return found


def shares_of_both(store: Path) -> dict[str, xr.DataArray]:
    """Return right answers by silhouettes, and by both sensors."""
    wanted = [("infrared", 25), ("infrared", 100), ("both", 25), ("both", 50)]
    return {
        f"{channel}, {distance} km": answers(store, "fusion", channel=channel, range=distance)
        for channel, distance in wanted
    }


def rejection(store: Path) -> xr.Dataset:
    """Return what the correlation classifier rejects of six ships, two of them unknown."""
    table = opened(store, "tables/rejection_correlation").sel(aspects="learned")
    return table.sel(template_spacing=1.5).squeeze()
