"""The GAMM in the report: its table beside the paper's, and the words for its figures."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Final

import numpy as np

from tripwatt.arrays import BoolArray
from tripwatt.gam.covariates import REACH
from tripwatt.gam.effects import CurveEffect, FactorEffect, RandomEffects, SurfaceEffect
from tripwatt.report.models import COVARIATES
from tripwatt.report.sentences import listed, percent
from tripwatt.report.tables import DASH, Table, number
from tripwatt.report.view import natural_key, plain

if TYPE_CHECKING:
    from tripwatt.gam.effects import Effect
    from tripwatt.paper.insight import GammInsight

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

BAND_PER_RANGE: Final = 1.0
"""A smooth whose 95 % band is wider than so many ranges of the observed response is not determined by the data: every value
that was observed, added or subtracted, would lie within the band."""


def in_words(term: str) -> str:
    """A term with the columns' names in words.

    Examples
    --------
    >>> in_words("s(ambient_temperature_degc,elevation_difference_m)")
    's(ambient temperature, elevation difference)'
    """
    spaced = re.sub(r",(?=\S)", ", ", term)
    return re.sub(r"[a-z_]+", lambda found: COVARIATES.get(found[0], (found[0],))[0], spaced)


def axis_of(name: str) -> tuple[str, float]:
    """Label of a covariate's axis, and the factor from its SI value to what is shown."""
    words, unit, factor = COVARIATES.get(name, (plain(name, 30), "", 1.0))
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


def band_width_wh(curve: CurveEffect) -> float:
    """Median width of the 95 % band of a smooth over the range of its data [Wh]."""
    inside = _on_data(curve)
    half = curve.multiplier * (curve.std_error[inside] if inside.any() else curve.std_error)
    return float(2.0 * np.median(half))


def is_determined(curve: CurveEffect, observed_wh: float) -> bool:
    """Whether the band of a smooth is narrower than `BAND_PER_RANGE` ranges of the observed response.

    Parameters
    ----------
    curve : CurveEffect
        In Wh.
    observed_wh : float
        Largest less smallest observed value of the response [Wh].
    """
    return band_width_wh(curve) <= BAND_PER_RANGE * observed_wh


def not_determined(curve: CurveEffect, observed_wh: float) -> str:
    """Why a smooth is not drawn."""
    return (
        f"not determined by these trips: its 95 % band is {band_width_wh(curve):,.0f} Wh wide, the observed values range over "
        f"{observed_wh:,.0f} Wh"
    )


def on_curves(curves: Sequence[CurveEffect], observed_wh: float) -> str:
    """The smooths with the largest effect over their data, and those that the data do not determine.

    Parameters
    ----------
    curves : sequence of CurveEffect
    observed_wh : float
        Largest less smallest observed value of the response [Wh].
    """
    known = [c for c in curves if is_determined(c, observed_wh)]
    spans = {in_words(c.label): _span_on_data(c) for c in known}
    first = sorted(spans, key=lambda name: -spans[name])[:2]
    text = "Each smooth is centred; its band covers 95 % pointwise; ticks are the data."
    if first:
        parts = [f"{name} ({spans[name]:,.0f} Wh)" for name in first]
        text += f" Over the range of the data, the largest effects are {listed(parts)}."
    for curve in curves:
        if curve not in known:
            text += f" {in_words(curve.label)} is not drawn: {not_determined(curve, observed_wh)}."
    return text


def _on_data(curve: CurveEffect) -> BoolArray:
    """Grid points between the first and the last row that a smooth speaks of."""
    low, high = (curve.rug.min(), curve.rug.max()) if curve.rug.size else (-np.inf, np.inf)
    return np.asarray((curve.x >= low) & (curve.x <= high))


def _span_on_data(curve: CurveEffect) -> float:
    """How far a smooth goes between the first and the last row that it speaks of."""
    shown = curve.effect[_on_data(curve)]
    return float(np.ptp(shown)) if shown.size else 0.0


def on_surface(surface: SurfaceEffect, observed_wh: float) -> str:
    """How far the surface reaches where there are data, and whether the data determine it."""
    low, high = float(np.nanmin(surface.effect)), float(np.nanmax(surface.effect))
    text = (
        f"{in_words(surface.label)} ranges from {low:,.0f} to {high:,.0f} Wh (EDF {surface.edf:.1f}); areas far from all data "
        "are blank; points are the data."
    )
    shown = np.isfinite(surface.effect)
    width = float(2.0 * 1.96 * np.median(surface.std_error[shown])) if shown.any() else 0.0
    if width > BAND_PER_RANGE * observed_wh:
        text += (
            f" These trips do not determine it: its 95 % band is {width:,.0f} Wh wide, the observed values range over "
            f"{observed_wh:,.0f} Wh."
        )
    return text.replace("-", "−")


def on_random(effect: RandomEffects) -> str:
    """How much trips differ beyond all covariates."""
    beyond = float(np.mean(np.abs(effect.effect) > 1.96 * effect.sd))
    return (
        f"The standard deviation of the trips' effects, beyond all covariates, is {effect.sd:,.0f} Wh. The smallest effect is that "
        f"of {plain(effect.level[0])}, the largest that of {plain(effect.level[-1])}; {percent(beyond, 0)} of the effects lie beyond "
        "1.96 standard deviations (5 % for a normal distribution). The effect of a new trip is 0."
    )


def on_dependence(gamm: GammInsight) -> str:
    """The autocorrelation warning in plain words, and why rows are thinned."""
    first = gamm.autocorrelation.correlation[0] if gamm.autocorrelation.lag.size else float("nan")
    text = gamm.autocorrelation.warning or (
        f"The correlation of neighbouring residuals of a trip is {first:.2f}; the rows can be treated as independent."
    )
    return (
        f"{text} The fit takes one row every {gamm.row_step_s:g} s; with a row every {gamm.full_step_s:g} s, as in the data, the "
        f"correlation would be {gamm.full_correlation:.3f}."
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
