"""Climate control apart from driving: each is corrected by what the log says of it.

A log with the power of heater and air conditioner splits the residual in two. How much a cabin takes depends on
temperatures and time, how much driving takes on the road and the speed; learned apart, neither pays for the other's
noise, and a trip under way tells of each by itself. Where too few trips log their climate, one corrector learns both.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final, Self

import numpy as np

from tripwatt.hybrid.blocks import LINE_CAUSES, BlockTable
from tripwatt.hybrid.power import (
    TREE_FEATURES,
    EnsembleCorrector,
    KrigingCorrector,
    PowerCorrector,
    boosting_corrector,
)
from tripwatt.kriging import Part
from tripwatt.trips import TEMPERATURES, FloatArray

LEAST_LOGGED: Final = 8
"""Fewest trips with logged climate control from which it is learned by itself."""
LEAST_LOGGED_SHARE: Final = 0.5
"""Their least share of all trips."""

_AMBIENT, _CABIN, _SETPOINT, _BATTERY = TEMPERATURES
CLIMATE_PARTS: Final = (
    Part(("hvac_w",), "line", 0.3),
    *(
        Part(columns, "smooth", 200.0, length)
        for columns, length in (
            ((_AMBIENT,), 1.0),
            ((_CABIN,), 1.0),
            ((_SETPOINT,), 1.0),
            (("time_s",), 1.0),
            ((_AMBIENT, _CABIN, "time_s"), 1.0),
            ((_AMBIENT, _SETPOINT), 1.0),
            ((_AMBIENT, _CABIN, _SETPOINT), 1.5),
        )
    ),
)
"""What the climate channel is made of: the simulated power may be off by a third, and smooth functions of the state."""

DRIVE_PARTS: Final = (
    *(Part((f"{cause}_w",), "line", 0.1) for cause in LINE_CAUSES if cause != "hvac"),
    *(
        Part(columns, "smooth", 100.0, length)
        for columns, length in (
            ((_AMBIENT,), 1.0),
            ((_BATTERY,), 1.0),
            (("time_s",), 1.0),
            (("speed_m_s",), 1.0),
            (("speed_change_m_s2",), 1.0),
            ((_AMBIENT, _BATTERY), 1.0),
            ((_AMBIENT, "time_s"), 1.0),
            ((_AMBIENT, _BATTERY, "trip_speed_m_s"), 1.5),
        )
    ),
)
"""What the driving channel is made of: as the whole, without what only a cabin knows."""

DRIVE_TREE_FEATURES: Final = tuple(n for n in TREE_FEATURES if n not in ("hvac_w", _CABIN, _SETPOINT))


class ChannelCorrector:
    """One corrector for climate control, one for driving, and one for both where climate is not logged.

    Parameters
    ----------
    climate, drive, whole : PowerCorrector
        `whole` learns the undivided residual when too few trips log their climate control.
    apart : bool or None
        Whether the channels are told apart; None decides by the trips of `fit`.

    Attributes
    ----------
    apart_ : bool
    """

    def __init__(
        self,
        climate: PowerCorrector,
        drive: PowerCorrector,
        whole: PowerCorrector,
        apart: bool | None = None,
    ) -> None:
        self.climate = climate
        self.drive = drive
        self.whole = whole
        self.apart = apart
        self.apart_ = bool(apart)

    def fit(self, table: BlockTable) -> Self:
        """Learn climate from the trips that log it, then driving from what it leaves of all trips."""
        logged = climate_logged(table)
        enough = int(logged.sum()) >= LEAST_LOGGED and float(logged.mean()) >= LEAST_LOGGED_SHARE
        self.apart_ = enough if self.apart is None else self.apart
        if not self.apart_:
            self.whole.fit(table)
            return self
        own = replace(
            table, simulated_w=table.features["hvac_w"].to_numpy(), observed_w=table.observed_hvac_w
        )
        self.climate.fit(own.take(np.flatnonzero(logged)))
        residual = table.climate_residual_w
        residual = np.where(logged[table.groups], residual, self.climate.predict(table))
        self.drive.fit(replace(table, observed_w=table.observed_power_w - residual))
        return self

    def again(self) -> ChannelCorrector:
        """The same correctors with their choices made."""
        if self.apart_:
            return ChannelCorrector(self.climate.again(), self.drive.again(), self.whole, True)
        return ChannelCorrector(self.climate, self.drive, self.whole.again(), False)

    def predict(self, table: BlockTable) -> FloatArray:
        """Residual power [W]."""
        if not self.apart_:
            return self.whole.predict(table)
        return self.climate.predict(table) + self.drive.predict(table)

    def uncertainty_factor(self, table: BlockTable) -> FloatArray:
        """Covariances of independent channels add up."""
        if not self.apart_:
            return self.whole.uncertainty_factor(table)
        parts = [channel.uncertainty_factor(table) for channel in (self.climate, self.drive)]
        return np.hstack(parts)

    def predict_with_doubt(self, table: BlockTable) -> tuple[FloatArray, FloatArray]:
        """Both at once."""
        if not self.apart_:
            return self.whole.predict_with_doubt(table)
        climate, drive = (channel.predict_with_doubt(table) for channel in (self.climate, self.drive))
        return climate[0] + drive[0], np.hstack([climate[1], drive[1]])

    def predict_climate(self, table: BlockTable) -> FloatArray | None:
        """The climate channel's part [W]; None when the channels are not told apart."""
        return self.climate.predict(table) if self.apart_ else None


def climate_logged(table: BlockTable) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Whether a trip logs the power of its climate control in every block, shape (trips,)."""
    known = np.isfinite(table.climate_residual_w).astype(np.int64)
    return np.asarray(np.minimum.reduceat(known, table.offsets[:-1]) == 1)


def channel_corrector(seed: int) -> ChannelCorrector:
    """The default: additive Gaussian process for climate; its mean with boosting for driving and for the whole."""
    return ChannelCorrector(
        KrigingCorrector(CLIMATE_PARTS, share_column="hvac_w"),
        EnsembleCorrector([KrigingCorrector(DRIVE_PARTS), boosting_corrector(seed, DRIVE_TREE_FEATURES)]),
        EnsembleCorrector([KrigingCorrector(), boosting_corrector(seed)]),
    )
