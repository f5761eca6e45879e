"""Train a model on a fleet of logs, with its provenance."""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Callable, Iterable, Sequence
from importlib.metadata import version
from typing import Any, Final

import numpy as np

from tripwatt.auditing import audit
from tripwatt.forecasting.donor import MASKABLE, DonorModel, unknown_inputs, without_inputs
from tripwatt.forecasting.model import DEFAULT_CORRECTOR, ForecastModel, HeldOut
from tripwatt.hybrid import TRANSFERABLE, identify_trips, segment_trips
from tripwatt.hybrid.calibrate import calibrate
from tripwatt.trips import COLUMNS, Fleet, Trip
from tripwatt.trips.messages import message
from tripwatt.vehicles import Vehicle

PACKAGES: Final = ("tripwatt", "numpy", "scipy", "pandas", "scikit-learn", "lightgbm")


def train_model(
    fleet: Fleet,
    vehicle: Vehicle,
    *,
    corrector: str = DEFAULT_CORRECTOR,
    seed: int = 0,
    identified: bool = True,
    calibrated: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[ForecastModel, dict[str, Any], dict[str, Any]]:
    """Audit logs, fit on the sound trips, and collect the metadata of a stored model.

    Parameters
    ----------
    fleet : Fleet
    vehicle : Vehicle
    corrector : str
    seed : int
    identified : bool
        Whether values of the car are identified from the signals of its stages first (`hybrid.identification`), where the
        log has them: motor torque, heater and air conditioner, standing power, voltage at rest.
    calibrated : bool
        Whether a few uncertain values of the car are calibrated on the trips first (`hybrid.calibrate`).
    progress : callable, optional
        Called with (finished fits, all fits).

    Returns
    -------
    model : ForecastModel
    provenance : dict
        Data set with citation and digest, trips, audit findings, identified values, calibrated values (relative change and its standard
        deviation), versions.
    evaluation : dict
        Errors on training trips while each was held out of the fit.

    Raises
    ------
    InvalidInput
        When too few sound trips with measured energy are left.

    Examples
    --------
    >>> from tripwatt.synthetic import synthetic_fleet
    >>> from tripwatt.vehicles import load_vehicle
    >>> found = train_model(synthetic_fleet(9), load_vehicle("bmw_i3_60ah"), corrector="linear")
    >>> found[1]["data"]["name"], found[2]["trips"]
    ('synthetic', 9)
    """
    found = audit(fleet)
    stages = identify_trips(found.trips, vehicle) if identified else None
    car = vehicle if stages is None else stages.applied(vehicle)
    found_values = calibrate(found.trips, car) if calibrated else None
    car = car if found_values is None else found_values.applied(car)
    model = ForecastModel(car, corrector, seed).fit(found.trips, progress=progress)
    model.donor_ = train_donor(found.trips, model)
    provenance = {
        "data": {
            "name": fleet.name,
            "citation": fleet.citation,
            "notes": [
                *map(message, fleet.notes),
                *([] if stages is None or not stages.values else [str(stages)]),
                *([] if found_values is None else [str(found_values)]),
            ],
            "logs": len(fleet),
            "sha256": data_digest(found.trips),
        },
        "trips_used": list(model.trip_ids_),
        "audit": [str(finding) for finding in found.findings],
        "identified": None if stages is None else dict(stages.values),
        "calibration": None
        if found_values is None
        else {name: [change, found_values.sd[name]] for name, change in found_values.changes.items()},
        "seed": seed,
        **versions(),
    }
    return model, provenance, held_out_figures(model.held_out_)


def train_donor(trips: Sequence[Trip], model: ForecastModel) -> DonorModel | None:
    """The donor model of a fitted model; None where the trips have no input to mask or its corrector cannot donate.

    Parameters
    ----------
    trips : sequence of Trip
        The training trips of the model.
    model : ForecastModel
    """
    masked = tuple(name for name in MASKABLE if name not in unknown_inputs(trips))
    if not masked or model.corrector not in TRANSFERABLE:
        return None
    return donor_model(trips, model.vehicle, masked, seed=model.seed)


def donor_model(
    trips: Sequence[Trip], vehicle: Vehicle, masked_inputs: Sequence[str] = MASKABLE, *, seed: int = 0
) -> DonorModel:
    """Simulate and learn trips with some inputs masked, with one Gaussian process for the whole residual."""
    masked = [without_inputs(trip, masked_inputs) for trip in trips]
    model = ForecastModel(vehicle, "gp", seed).fit_segments(segment_trips(masked, vehicle))
    return model.as_donor(masked_inputs)


def versions() -> dict[str, Any]:
    """Python and the packages that figures depend on."""
    return {
        "python": platform.python_version(),
        "packages": {name: version(name) for name in PACKAGES},
    }


def held_out_figures(trips: Sequence[HeldOut]) -> dict[str, Any]:
    """Errors of the forecast before departure on held-out trips.

    Returns
    -------
    dict
        `mape` [1], `rmse_wh` and `bias_wh` (predicted minus observed) [Wh] over the trips, what they are, and every
        trip's row.

    Examples
    --------
    >>> figures = held_out_figures([HeldOut("a", 1000.0, 900.0, 1.0), HeldOut("b", 2000.0, 2200.0, -1.0)])
    >>> figures["mape"], figures["bias_wh"]
    (0.1, 50.0)
    """
    observed = np.array([trip.observed_wh for trip in trips])
    error = np.array([trip.predicted_wh for trip in trips]) - observed
    return {
        "protocol": "training trips, each while its fold (at most 10) was held out of the fit; "
        "settings, and identified and calibrated values of the car where there are any, come from all of them",
        "given": "given the driven speed trace",
        "trips": len(trips),
        "mape": float(np.mean(np.abs(error) / np.abs(observed))),
        "rmse_wh": float(np.sqrt(np.mean(error**2))),
        "bias_wh": float(np.mean(error)),
        "by_trip": [
            {"trip": t.trip, "observed_wh": t.observed_wh, "predicted_wh": t.predicted_wh, "score": t.score}
            for t in trips
        ],
    }


def data_digest(trips: Iterable[Trip]) -> str:
    """SHA-256 over ids, column names and all values of trips, whatever their order. O(samples).

    Examples
    --------
    >>> import pandas as pd
    >>> from dataclasses import replace
    >>> log = Trip.from_samples("t", pd.DataFrame({"time_s": [0.0, 1.0], "speed_m_s": [0.0, 1.0]}))
    >>> other = replace(log, samples=log.samples.assign(speed_m_s=2.0))
    >>> data_digest([log]) == data_digest([log]), data_digest([log]) == data_digest([other])
    (True, False)
    """
    whole = hashlib.sha256()
    for trip in sorted(trips, key=lambda t: t.trip_id):
        whole.update(trip.trip_id.encode() + b"\0")
        for name in (c for c in COLUMNS if c in trip):
            whole.update(name.encode() + b"\0")
            whole.update(np.ascontiguousarray(trip.array(name), dtype="<f8").tobytes())
    return whole.hexdigest()
