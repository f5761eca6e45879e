"""Fit a model to a fleet of logs, with its provenance."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import asdict
from typing import Any, Final

import numpy as np

from tripwatt.arrays import IntArray
from tripwatt.auditing import Audit, audit
from tripwatt.forecasting.model import DEFAULT_CORRECTOR, ForecastModel, HeldOut
from tripwatt.hybrid import Corrector, Identified, identify, identify_each, stage_record
from tripwatt.trips import COLUMNS, Trip, TripSet
from tripwatt.trips.messages import message
from tripwatt.vehicles import Vehicle

PACKAGES: Final = ("tripwatt", "numpy", "scipy", "pandas", "scikit-learn", "lightgbm")


def fit_car(
    trips: Sequence[Trip],
    vehicle: Vehicle,
    corrector: str | Corrector = DEFAULT_CORRECTOR,
    seed: int = 0,
    *,
    identified: bool = True,
    covariates: Sequence[str] = (),
    progress: Callable[[int, int], None] | None = None,
) -> tuple[ForecastModel, Identified | None]:
    """Fit a model on sound trips of one car; returns it with the identified values of the car, None if `identified` is False.

    Each fold of the fit identifies the values anew, without the trips of the fold.
    """
    records = [stage_record(trip, vehicle) for trip in trips] if identified else []

    def cars_of(several: Sequence[IntArray]) -> list[Vehicle]:
        shown = identify_each([[records[i] for i in members] for members in several], vehicle)
        return [values.applied(vehicle) for values in shown]

    values = identify(records, vehicle) if identified else None
    car = vehicle if values is None else values.applied(vehicle)
    model = ForecastModel(car, corrector, seed, covariates=tuple(covariates))
    return model.fit(trips, cars_of=cars_of if identified else None, progress=progress), values


def fit_with_provenance(
    fleet: TripSet,
    vehicle: Vehicle,
    *,
    corrector: str = DEFAULT_CORRECTOR,
    identified: bool = True,
    covariates: Sequence[str] = (),
    progress: Callable[[int, int], None] | None = None,
) -> tuple[ForecastModel, dict[str, Any], dict[str, Any]]:
    """Audit the logs, fit a model on the sound trips, and collect the metadata of a stored model.

    Parameters
    ----------
    fleet : TripSet
    vehicle : Vehicle
    corrector : str
    identified : bool
        Whether values of the car are first identified from logged signals (`hybrid.identification`), if the log has them:
        motor torque, heater and air conditioner, standing power, voltage at rest.
    covariates : sequence of str
        Further columns of the logs that the corrector uses.
    progress : callable, optional
        Called with (finished fits, all fits).

    Returns
    -------
    model : ForecastModel
    provenance : dict
        Data set with citation and digest, trips, audit findings, identified values, versions.
    evaluation : dict
        Errors on training trips while each was held out of the fit, see `held_out_figures`.

    Raises
    ------
    InvalidInput
        If too few sound trips with measured energy are left.

    Examples
    --------
    >>> from tripwatt.study.synthetic import synthetic_fleet
    >>> from tripwatt.vehicles import load_vehicle
    >>> fitted = fit_with_provenance(synthetic_fleet(9), load_vehicle("bmw_i3_60ah"), corrector="linear")
    >>> fitted[1]["data"]["name"], fitted[2]["trips"]
    ('synthetic', 9)
    """
    sound = audit(fleet)
    model, values = fit_car(
        sound.trips, vehicle, corrector, identified=identified, covariates=covariates, progress=progress
    )
    provenance = {
        **provenance_of(fleet, sound, model, [str(values)] if values and values.values else []),
        "identified": None if values is None else dict(values.values),
    }
    return model, provenance, held_out_figures(model.held_out_)


def provenance_of(
    fleet: TripSet, checked: Audit, model: ForecastModel, notes: Sequence[str]
) -> dict[str, Any]:
    """Where a model comes from: data with citation and digest, trips, audit findings, seed, Python and packages.

    Parameters
    ----------
    fleet : TripSet
    checked : Audit
        Audit of the fleet.
    model : ForecastModel
        Model fitted on the sound trips, or adapted to them.
    notes : sequence of str
        Notes on the data, added to those of the fleet.
    """
    return {
        "data": {
            "name": fleet.name,
            "citation": fleet.citation,
            "notes": [*map(message, fleet.notes), *notes],
            "logs": len(fleet),
            "sha256": data_digest(checked.trips),
        },
        "trips_used": list(model.trip_ids_),
        "audit": [str(finding) for finding in checked.findings],
        "seed": model.seed,
        **versions(),
    }


def versions() -> dict[str, Any]:
    """Versions of Python and of the installed packages that the figures depend on."""
    import platform
    from importlib.metadata import PackageNotFoundError, version  # slow to import

    packages = {}
    for name in PACKAGES:
        with suppress(PackageNotFoundError):  # of an extra
            packages[name] = version(name)
    return {"python": platform.python_version(), "packages": packages}


def held_out_figures(trips: Sequence[HeldOut]) -> dict[str, Any]:
    """Errors of the forecast before departure on held-out trips.

    Returns
    -------
    dict
        `mape` [1], `rmse_wh` and `bias_wh` (predicted minus observed) [Wh] over the trips, how they were computed, and one
        row for each trip.

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
        "settings, and identified values of the car where there are any, without it as well",
        "given": "given the driven speed trace",
        "trips": len(trips),
        "mape": float(np.mean(np.abs(error) / np.abs(observed))),
        "rmse_wh": float(np.sqrt(np.mean(error**2))),
        "bias_wh": float(np.mean(error)),
        "by_trip": [asdict(trip) for trip in trips],
    }


def data_digest(trips: Iterable[Trip]) -> str:
    """SHA-256 over ids, column names, all values and the covariates of trips, independent of the order of the trips. O(samples).

    Examples
    --------
    >>> import pandas as pd
    >>> from dataclasses import replace
    >>> log = Trip.from_samples("t", pd.DataFrame({"time_s": [0.0, 1.0], "speed_m_s": [0.0, 1.0]}))
    >>> other = replace(log, samples=log.samples.assign(speed_m_s=2.0))
    >>> data_digest([log]) == data_digest([log]), data_digest([log]) == data_digest([other])
    (True, False)
    """
    digest = hashlib.sha256()
    for trip in sorted(trips, key=lambda t: t.trip_id):
        digest.update(trip.trip_id.encode() + b"\0")
        for name in (c for c in COLUMNS if c in trip):
            digest.update(name.encode() + b"\0")
            digest.update(np.ascontiguousarray(trip.array(name), dtype="<f8").tobytes())
        if trip.departure.covariates:
            digest.update(repr(sorted(trip.departure.covariates.items())).encode())
    return digest.hexdigest()
