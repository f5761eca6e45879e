"""The GAMM in the report: its table beside the paper's, and the words for its figures."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Final

import numpy as np

from tripwatt.gam.covariates import REACH
from tripwatt.gam.effects import CurveEffect, FactorEffect, RandomEffects, SurfaceEffect
from tripwatt.report.sentences import listed, percent
from tripwatt.report.tables import DASH, Table, number
from tripwatt.report.view import natural_key, plain
from tripwatt.units import M_S_PER_KM_H, SECONDS_PER_MINUTE

if TYPE_CHECKING:
    from tripwatt.evaluation.insight import GammInsight
    from tripwatt.gam.effects import Effect

PAPER_TABLE2_SOURCE: Final = "arXiv:2405.10984, Table 2"

PAPER_TABLE2: Final[Mapping[str, str]] = MappingProxyType(
    {
        "(Intercept)": "1537.44 (938.99)",
        "weather: cloudy": "796.09 (649.09)",
        "weather: dark": "1430.53 (723.35)*",
        "weather: dark, little rainy": "0.00 (0.00)",
        "weather: rainy": "0.00 (0.00)",
        "weather: slightly cloudy": "386.27 (582.56)",
        "weather: sunny": "457.96 (573.88)",
        "weather: sunrise": "754.49 (751.99)",
        "weather: sunset": "2322.86 (998.28)*",
        "s(time)": "6.25 (7.06)***",
        "s(ambient temperature)": "1.00 (1.00)",
        "s(speed)": "7.67 (8.54)***",
        "s(elevation difference)": "2.59 (3.35)***",
        "s(time):winter": "7.01 (7.92)***",
        "s(ambient temperature):winter": "1.00 (1.00)",
        "s(ambient temperature, elevation difference)": "4.86 (27.00)",
        "s(trip)": "44.40 (57.00)***",
    }
)
"""What the paper prints for its GAMM (`PAPER_TABLE2_SOURCE`), by our names of the terms."""

_COVARIATES: Final[Mapping[str, tuple[str, str, float]]] = MappingProxyType(
    {
        "time_s": ("time", "min", 1.0 / SECONDS_PER_MINUTE),
        "speed_m_s": ("speed", "km/h", 1.0 / M_S_PER_KM_H),
        "ambient_temperature_degc": ("ambient temperature", "°C", 1.0),
        "elevation_difference_m": ("elevation difference", "m", 1.0),
    }
)
"""Column -> words, unit that is shown, factor from SI."""


def in_words(term: str) -> str:
    """A term with the columns' names in words.

    Examples
    --------
    >>> in_words("s(ambient_temperature_degc,elevation_difference_m)")
    's(ambient temperature, elevation difference)'
    """
    spaced = re.sub(r",(?=\S)", ", ", term)
    return re.sub(r"[a-z_]+", lambda found: _COVARIATES.get(found[0], (found[0],))[0], spaced)


def axis_of(name: str) -> tuple[str, float]:
    """Label of a covariate's axis, and the factor from its SI value to what is shown."""
    words, unit, factor = _COVARIATES.get(name, (plain(name, 30), "", 1.0))
    return (f"{words} [{unit}]" if unit else words), factor


def summary_table(gamm: GammInsight, *, paper: bool, label: str = "") -> Table:
    """Every coefficient with its standard error and every smooth with its EDF, as the paper prints them.

    Parameters
    ----------
    gamm : GammInsight
    paper : bool
        Whether the paper's own table may stand beside it.
    label : str
        End of the caption, e.g. that the trips are made up.
    """
    coefficients = _coefficient_names(gamm.effects)
    tests = gamm.summary.frame()["p_value"].tolist()
    rows: list[tuple[str, str, str]] = []
    for (term, value, mark), p_value in zip(gamm.summary.rows(), tests, strict=True):
        name = term.removeprefix("EDF: ")
        shown = coefficients.get(name) or in_words(name)
        text = f"{value}{mark}".replace("-", "−").replace(" ", "\u00a0")
        rows.append((shown, text, _p_text(p_value)))
    for factor in (e for e in gamm.effects.values() if isinstance(e, FactorEffect) and e.reference):
        first = next((i for i, row in enumerate(rows) if row[0].startswith(f"{factor.label}: ")), len(rows))
        rows.insert(first, (f"{factor.label}: {plain(factor.reference)}", "reference", DASH))
    columns = ["Term", "Ours", "p"]
    cells: list[tuple[str, ...]] = list(rows)
    if paper:
        columns.append(f"The paper ({PAPER_TABLE2_SOURCE})")
        printed = {name: text.replace(" ", "\u00a0") for name, text in PAPER_TABLE2.items()}
        absent = [name for name in PAPER_TABLE2 if name not in {row[0] for row in rows}]
        cells = [(*row, printed.get(row[0], DASH)) for row in rows]
        cells += [(name, DASH, DASH, printed[name]) for name in absent]
    caption = (
        f"Terms of the GAMM{label}: estimate (standard error) in Wh, EDF (reference df) of a smooth s(); "
        "*** p < 0.001, ** p < 0.01, * p < 0.05"
    )
    return Table(caption, tuple(columns), tuple(cells))


def _coefficient_names(effects: Mapping[str, Effect]) -> dict[str, str]:
    """Coefficient of the engine -> factor and level as they are shown."""
    return {
        f"{effect.label}{level}": f"{effect.label}: {plain(level)}"
        for effect in effects.values()
        if isinstance(effect, FactorEffect) and effect.reference
        for level in effect.level
    }


def _p_text(p_value: float) -> str:
    if not np.isfinite(p_value):
        return "no\u00a0data"
    return "<\u00a00.0001" if p_value < 1e-4 else f"{p_value:.4f}"


def scores_table(gamm: GammInsight, *, label: str = "") -> Table:
    """Scores of the fit, and the reductions that the data forced."""
    page = gamm.summary
    scores = [(name, value.replace("-", "−")) for name, value in page.scores().items()]
    rows = [("Errors", page.distribution()), ("Formula", in_words(page.formula)), *scores]
    rows += [("Note", plain(in_words(note), 400)) for note in page.notes]
    rows += [("Term left out", f"{in_words(term)}: its covariates never vary here") for term in gamm.left_out]
    return Table(f"The fit of the GAMM{label}", ("What", "Value"), tuple(rows), frozenset({0, 1}))


def outside_table(gamm: GammInsight, *, label: str = "") -> Table:
    """Trips that leave what all other trips have shown, with the share of their rows."""
    records = sorted(gamm.outside.to_dict("records"), key=lambda r: natural_key(r["trip"]))
    rows = [
        (
            plain(record["trip"]),
            in_words(str(record["covariate"])),
            number(float(record["share"]), 100, 1),
        )
        for record in records
    ]
    columns = ("Trip", "What no other trip has shown", "Share of its rows [%]")
    caption = f"Where the extrapolation rule applies to a held-out trip{label}"
    return Table(caption, columns, tuple(rows), frozenset({0, 1}))


def random_table(effect: RandomEffects, *, label: str = "") -> Table:
    """The random effect of every trip, the smallest first."""
    rows = [
        (plain(level), number(float(value), 1.0, 0), number(float(error), 1.0, 0))
        for level, value, error in zip(effect.level, effect.effect, effect.std_error, strict=True)
    ]
    caption = f"Random effect of every trip{label}"
    return Table(caption, ("Trip", "Random effect [Wh]", "Std. error [Wh]"), tuple(rows))


def on_summary(gamm: GammInsight, *, paper: bool) -> str:
    """What was fitted, how well, and what the table can be compared with."""
    page = gamm.summary
    text = (
        f"{page.distribution()} Wh; on {page.n} rows, one every {gamm.row_step_s:g} s of a trip and its last, it explains "
        f"{percent(page.deviance_explained)} of the deviance. A level without data is 0.00 (0.00)."
    )
    if not page.converged:
        text = f"The fit did not converge, its figures are not to be trusted. {page.message} {text}"
    if paper:
        text += (
            " The paper's values stand beside ours where the terms match; they need not agree: its GAMM "
            "explains what another simulation leaves, on more trips, and its reference weather is not named."
        )
    return text


def on_diagnosis(gamm: GammInsight) -> str:
    """Whether the residuals follow the fitted distribution."""
    residual, line = gamm.diagnosis.qq.residual, gamm.diagnosis.qq.theoretical
    off = float(np.max(np.abs(residual - line)[_middle(len(line))]))
    half = float(np.quantile(np.abs(residual), 0.5))
    far = float(np.max(np.abs(residual)))
    return (
        f"Half of the residuals are within {half:,.0f} Wh, the largest is {far:,.0f} Wh. Between the 5 % and the 95 % quantile "
        f"the ordered residuals stay within {off:,.0f} Wh of the line, the quantiles of the fitted {gamm.diagnosis.qq.distribution.name}."
    )


def _middle(n: int) -> slice:
    return slice(n // 20, max(n - n // 20, n // 20 + 1))


def on_curves(curves: Sequence[CurveEffect]) -> str:
    """Which smooth moves the correction most over its range."""
    spans = {in_words(c.label): _span_on_data(c) for c in curves}
    first = sorted(spans, key=lambda name: -spans[name])[:2]
    parts = [f"{name} over {spans[name]:,.0f} Wh" for name in first]
    return f"Each smooth is centred, its band covers 95 % pointwise, ticks are the data. Where it has data, the farthest goes {listed(parts)}."


def _span_on_data(curve: CurveEffect) -> float:
    """How far a smooth goes between the first and the last row that it has a say in."""
    low, high = (curve.rug.min(), curve.rug.max()) if curve.rug.size else (-np.inf, np.inf)
    shown = curve.effect[(curve.x >= low) & (curve.x <= high)]
    return float(np.ptp(shown)) if shown.size else 0.0


def on_surface(surface: SurfaceEffect) -> str:
    """How far the surface reaches where there are data."""
    low, high = float(np.nanmin(surface.effect)), float(np.nanmax(surface.effect))
    return (
        f"{in_words(surface.label)} goes from {low:,.0f} to {high:,.0f} Wh (EDF {surface.edf:.1f}), what is far from all data "
        "is left blank; points are the data."
    ).replace("-", "−")


def on_random(effect: RandomEffects) -> str:
    """How much trips differ for reasons that no covariate tells."""
    beyond = float(np.mean(np.abs(effect.effect) > 1.96 * effect.sd))
    return (
        f"Trips differ by a standard deviation of {effect.sd:,.0f} Wh beyond all covariates, {plain(effect.level[0])} the most "
        f"downwards and {plain(effect.level[-1])} upwards; {percent(beyond, 0)} lie beyond 1.96 of it (5 % if they are normal). "
        "A trip that is forecast has the effect 0."
    )


def on_dependence(gamm: GammInsight) -> str:
    """The autocorrelation warning in plain words, and why rows are thinned."""
    first = gamm.autocorrelation.correlation[0] if gamm.autocorrelation.lag.size else float("nan")
    text = gamm.autocorrelation.warning or (
        f"Neighbouring residuals of a trip correlate with {first:.2f}: the rows may pass for independent."
    )
    return (
        f"{text} That is with one row every {gamm.row_step_s:g} s; at {gamm.full_step_s:g} s residuals correlate with "
        f"{gamm.full_correlation:.3f}, which is why the fit does not take every row."
    )


def on_extrapolation(gamm: GammInsight, trips: int | None) -> str:
    """The rule outside of the training data, and for how many held-out trips it matters."""
    found = gamm.outside["trip"].nunique()
    of = f" of {trips}" if trips else ""
    return (
        "Outside of the training data no effect grows: a row is moved to where training rows lie before any term sees it, each "
        "covariate to the nearer end of its range (in winter, that of the winter trips), those of a surface to within "
        f"{percent(REACH, 0)} of their ranges from the nearest training point. A weather that no training trip had counts as the mean "
        f"over the training rows; a new trip's random effect is 0. Held out, {found}{of} trips leave, in some row, the range that the "
        "others have shown, or have a weather of their own."
    )
