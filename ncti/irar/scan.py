"""A pass as the sensor records it: raw intensity, range and infrared images."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ncti.checks import require_generator
from ncti.irar.clutter import clutter, sea_places
from ncti.irar.flight import PARAMETERS, Flight
from ncti.irar.receiver import mean_return, peaks
from ncti.irar.scene import Returns, ScanPlan, plan_scan, scan_scene
from ncti.irar.speckle import speckle, speckle_correlation
from ncti.labels import labelled_array

if TYPE_CHECKING:
    import trimesh
    import xarray as xr

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Scan:
    """Raw images of one pass.

    Attributes
    ----------
    plan : ScanPlan
        The flight and its lines.
    intensity : (line, sample) float32 ndarray
        Intensity of the strongest return, in noise powers; 0 where none exceeded the threshold.
    range : (line, sample) float64 ndarray
        Range of that return [m]; NaN where there is none.
    infrared : (detector, line, sample) float32 ndarray
        Apparent temperature above the sea [K]; detector k trails the first by k samples.

    See Also
    --------
    Pass.record : Draw a scan.
    correct : Correct a scan.

    Examples
    --------
    >>> import numpy as np
    >>> import trimesh
    >>> from ncti.irar import ship_heading
    >>> box = trimesh.creation.box((20, 6, 4)).apply_translation((0, 0, 2))
    >>> heading = ship_heading(aspect=180, sight=5)
    >>> flight = Flight(slant_range=4e3, ship_heading=heading, samples=40, line_rate=60)
    >>> scan = fly(box, flight).record(np.random.default_rng(0))
    >>> dict(scan.to_xarray().sizes)
    {'line': 86, 'sample': 40, 'detector': 12}
    """

    plan: ScanPlan
    intensity: NDArray[np.float32]
    range: Floats
    infrared: NDArray[np.float32]

    @property
    def flight(self) -> Flight:
        """The pass, with its pointing determined."""
        return self.plan.flight

    @property
    def time(self) -> Floats:
        """Time of each sample after the snapshot, (line, sample) [s]."""
        return self.plan.time(np.arange(self.flight.samples))

    def to_xarray(self) -> xr.Dataset:
        """Return the raw images as a data set with every parameter of the flight as an attribute.

        The unit of a parameter `name` is in `name_units`, "1" for a count or a ratio.
        """
        import xarray as xr

        flight = self.flight
        image = ("line", "sample")
        lines = self.plan.first + np.arange(self.plan.lines)
        detectors = np.arange(flight.detectors)
        parameters = {field.name: getattr(flight, field.name) for field in fields(flight)}
        parameters["aircraft_track"] = flight.track
        parameters["aspect"] = flight.aspect
        units = {name: unit for name, (unit, _) in PARAMETERS.items()} | {"aspect": "degree"}
        attributes = parameters | {f"{name}_units": units[name] for name in parameters}
        infrared, sample = ("detector", *image), np.arange(flight.samples)
        arrays: dict[str, tuple[Any, ...]] = {
            "intensity": (image, self.intensity, "1", "intensity over noise power"),
            "range": (image, self.range, "m", "range of the strongest return"),
            "infrared": (infrared, self.infrared, "K", "temperature above the sea"),
            "time": (image, self.time, "s", "time after the beam crossed the ship's origin"),
            "line": ("line", lines, "1", "line, 0 the first after time 0"),
            "sample": ("sample", sample, "1", "sample of a line, from the left"),
            "detector": ("detector", detectors, "1", "passive detector, 0 the leading one"),
        }
        labels = {name: labelled_array(*array) for name, array in arrays.items()}
        return xr.Dataset(labels, attrs=attributes).set_coords("time")


@dataclass(frozen=True, eq=False)
class Pass:
    """A pass before noise is added: any number of scans can be drawn from it.

    Attributes
    ----------
    plan : ScanPlan
        The flight and its lines.
    returns : Returns
        Returns of the ship, with `flight.detectors` - 1 columns before the first sample.
    attitude : (line, 2) float64 ndarray or None
        Errors of the line of sight, to the right and up [rad]; None without jitter.

    See Also
    --------
    fly : Simulate a pass.

    Examples
    --------
    >>> import trimesh
    >>> from ncti.irar import ship_heading
    >>> box = trimesh.creation.box((20, 6, 4)).apply_translation((0, 0, 2))
    >>> heading = ship_heading(aspect=180, sight=5)
    >>> flight = Flight(slant_range=4e3, ship_heading=heading, samples=40, line_rate=60)
    >>> fly(box, flight).noiseless().intensity.shape
    (86, 40)
    """

    plan: ScanPlan
    returns: Returns
    attitude: Floats | None = None

    @property
    def _sample_returns(self) -> Returns:
        """Returns of the samples, without leading columns."""
        return self.returns.drop_leading(self.plan.flight.detectors - 1)

    def _sea_temperature(self, rng: np.random.Generator) -> Floats:
        """Return the sea's temperature at each sample, (line, column) with leading columns [K]."""
        flight = self.plan.flight
        columns = np.arange(1 - flight.detectors, flight.samples)
        time = self.plan.time(columns)
        errors = np.zeros((self.plan.lines, 2)) if self.attitude is None else self.attitude
        along = flight.scan_angles(columns) + errors[:, :1]
        places = sea_places(flight, time, along, np.broadcast_to(errors[:, 1:], along.shape))
        return clutter(places, deviation=flight.clutter, length=flight.clutter_length, rng=rng)

    def _passive_samples(self, rng: np.random.Generator | None) -> NDArray[np.float32]:
        """Return the passive samples, (detector, line, sample) [K]; no noise if `rng` is None."""
        flight = self.plan.flight
        covered = self.returns.coverage()
        temperature = covered * flight.contrast
        last = flight.detectors - 1
        shape = (flight.detectors, self.plan.lines, flight.samples)
        images = np.zeros(shape, dtype=np.float32)
        if rng is not None:
            images += np.float32(flight.nedt) * rng.standard_normal(shape, dtype=np.float32)
            if flight.clutter > 0:  # drawn last, so that it does not change the other draws
                temperature += (1 - covered) * self._sea_temperature(rng)
        # Detector k sees column j - k at sample j, with the scene at the leading detector's time:
        # in the k samples between, half a millisecond, the ship drifts by millimetres.
        for k, image in enumerate(images):
            image += temperature[:, last - k : last - k + flight.samples].astype(np.float32)
        return images

    def noiseless(self) -> Scan:
        """Return the scan without speckle, noise, range error or dropouts."""
        intensity, range_ = mean_return(self._sample_returns, flight=self.plan.flight)
        return Scan(self.plan, intensity, range_, self._passive_samples(None))

    def record(self, rng: np.random.Generator) -> Scan:
        """Draw one scan, with speckle, noise, false ranges and dropouts.

        Parameters
        ----------
        rng : numpy.random.Generator
            Source of randomness.

        Returns
        -------
        Scan
            Raw images.

        Raises
        ------
        ValueError
            If `rng` is not a generator.
        """
        require_generator("rng", rng)
        flight = self.plan.flight
        returns = self._sample_returns
        amplitudes = speckle(
            (*returns.shape, returns.rays), correlation=speckle_correlation(flight), rng=rng
        )
        time = self.plan.time(np.arange(flight.samples))
        nominal = np.linalg.norm(flight.position(time), axis=-1)
        intensity, range_ = peaks(returns, amplitudes, nominal, flight=flight, rng=rng)
        return Scan(self.plan, intensity, range_, self._passive_samples(rng))


def fly(
    mesh: trimesh.Trimesh,
    flight: Flight,
    *,
    rng: np.random.Generator | None = None,
    reflectivity: Floats | None = None,
    lambertian: bool = False,
) -> Pass:
    """Simulate one pass of the aircraft by a ship.

    Parameters
    ----------
    mesh : trimesh.Trimesh
        The ship, in its frame.
    flight : Flight
        The pass.
    rng : numpy.random.Generator, optional
        Source of the attitude's jitter; required if the flight has any.
    reflectivity : (facet,) float64 ndarray, optional
        Reflectivity of each facet, relative to the flat target of the carrier-to-noise ratio; 1
        when not given.
    lambertian : bool
        Let the power fall with the cosine of incidence; otherwise it follows the projected area.

    Returns
    -------
    Pass
        Returns of the ship; `record` and `noiseless` make scans of it.

    Raises
    ------
    ValueError
        If the flight cannot see the whole ship, has jitter and no generator, or a reflectivity is
        negative or missing.

    See Also
    --------
    correct : Correct the scans of the pass.
    true_snapshot : The view that corrections should recover.

    Examples
    --------
    A box 40 m long, 10 m wide and 14 m high, seen from astern at 4 km:

    >>> import numpy as np
    >>> import trimesh
    >>> from ncti.irar import ship_heading
    >>> box = trimesh.creation.box((40, 10, 14)).apply_translation((0, 0, 7))
    >>> heading = ship_heading(aspect=180, sight=5)
    >>> flight = Flight(slant_range=4e3, ship_heading=heading, samples=60)
    >>> scan = fly(box, flight).record(np.random.default_rng(0))
    >>> scan.intensity.shape, scan.infrared.shape
    ((345, 60), (12, 345, 60))
    """
    plan = plan_scan(mesh, flight)
    attitude = None
    if flight.jitter > 0:
        require_generator("rng", rng)
        assert rng is not None
        attitude = draw_attitude_errors(plan, rng)
    returns = scan_scene(
        mesh,
        plan,
        leading=flight.detectors - 1,
        attitude=attitude,
        reflectivity=reflectivity,
        lambertian=lambertian,
    )
    return Pass(plan, returns, attitude)


def draw_attitude_errors(plan: ScanPlan, rng: np.random.Generator) -> Floats:
    """Draw attitude errors (line, 2) [rad] of the line of sight, a first-order Markov sequence.

    They lie to the right and up, in the scanner.
    """
    flight = plan.flight
    correlation = math.exp(-1 / (flight.line_rate * flight.jitter_time))
    errors = rng.standard_normal((plan.lines, 2)) * flight.jitter
    for line in range(1, plan.lines):
        errors[line] = correlation * errors[line - 1] + math.sqrt(1 - correlation**2) * errors[line]
    return errors
