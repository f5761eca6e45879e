"""Summary of a fitted model: coefficients, effective degrees of freedom, tests and scores, as papers print them."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pandas as pd

from tripwatt_gamm.inference import coefficient_table, term_table, variance_components

if TYPE_CHECKING:
    from tripwatt_gamm.estimator import Estimator

_LEVELS: Final = ((0.001, "***"), (0.01, "**"), (0.05, "*"))  # the usual ones, as R prints them
_LEGEND: Final = "Signif. codes:  0 '***' 0.001 '**' 0.01 '*' 0.05 ' ' 1"
_EDF: Final = "EDF: "


def stars(p_value: float) -> str:
    """Return the stars of a p-value: three below 0.001, two below 0.01, one below 0.05; none if there is no test (NaN).

    Examples
    --------
    >>> stars(0.02), stars(0.3), stars(float("nan"))
    ('*', '', '')
    """
    return next((mark for level, mark in _LEVELS if p_value < level), "")


@dataclass(frozen=True, slots=True, repr=False)
class Summary:
    """Tables and scores of a fitted model, printed in the layout of R, or as lines of a paper's table (`rows`).

    Attributes
    ----------
    parametric : pandas.DataFrame
        ``estimate, std_error, statistic, p_value`` per coefficient; a level without data has 0, 0 and no test (NaN).
    smooth : pandas.DataFrame
        ``edf, ref_df, statistic, p_value`` per smooth term and random effect.
    formula, family, link, method : str
        Formula, distribution of the response, link function, and method of the fit.
    scale_known : bool
        Whether the scale is known: then tests are z and chi-square, otherwise t and F.
    r2, deviance_explained : float
        Adjusted R2 and explained share of the deviance, as fractions.
    reml, aic, loglik : float
        Scores of the fit.
    scale : float
        Dispersion: the variance of gaussian errors; 1 for a scaled t, counts and shares.
    n : int
        Rows.
    nu, sigma : float
        Shape and scale of a scaled t; NaN otherwise.
    nu_at_bound : bool
        Whether the estimate of nu is at its lower bound.
    converged : bool
        Whether the fit converged.
    variance : pandas.DataFrame
        Standard deviations of random effects and errors, from `GAMM.variance_components`.
    message : str
        Why the fit ended.
    notes : tuple of str
        Reductions that the data forced: columns removed, levels without data.

    Examples
    --------
    >>> import numpy as np, pandas as pd
    >>> from tripwatt_gamm.model import GAMM
    >>> x = np.linspace(0, 1, 60)
    >>> frame = pd.DataFrame({"x": x, "y": np.sin(6 * x) + 0.2 * np.cos(90 * x)})
    >>> result = Summary.from_model(GAMM("y ~ s(x, k=8)").fit(frame))
    >>> [label for label, _, _ in result.rows()]
    ['(Intercept)', 'EDF: s(x)']
    >>> list(result.scores())
    ['R2 (adjusted)', 'Deviance explained', 'REML', 'Log-likelihood', 'AIC', 'n']
    >>> print(result)  # doctest: +ELLIPSIS
    <BLANKLINE>
    Family: gaussian
    Link function: identity
    ...
    >>> result.distribution().split(",")[0]
    'gaussian'
    """

    parametric: pd.DataFrame
    smooth: pd.DataFrame
    formula: str
    family: str
    link: str
    method: str
    scale_known: bool
    r2: float
    deviance_explained: float
    reml: float
    aic: float
    loglik: float
    scale: float
    n: int
    nu: float
    sigma: float
    nu_at_bound: bool
    converged: bool
    variance: pd.DataFrame
    message: str = ""
    notes: tuple[str, ...] = ()

    @classmethod
    def from_model(cls, model: Estimator) -> Summary:
        """Summarise a fitted model.

        Parameters
        ----------
        model : GAMM
            A fitted model.
        """
        family = model.family_
        own: dict[str, Any] = {
            "parametric": coefficient_table(model),
            "smooth": term_table(model),
            "variance": variance_components(model),
            "formula": " ".join(str(model.formula).split()),
            "family": family.name,
            "link": family.link.name,
            "method": str(model.method) if family.name == "scat" else "REML",
            "scale_known": not family.estimates_scale,
            "notes": tuple(model.notes_),
        }
        return cls(**{f.name: getattr(model, f"{f.name}_") for f in fields(cls) if f.name not in own}, **own)

    def distribution(self) -> str:
        """Describe the error distribution in words, with its parameters.

        Returns
        -------
        str
            One line.
        """
        if self.family != "scat":
            return f"{self.family}, scale {self.scale:.5g}"
        bound = " (at bound)" if self.nu_at_bound else ""
        return f"Student's t, nu {self.nu:.4g}{bound}, sigma {self.sigma:.5g}"

    def scores(self) -> dict[str, str]:
        """Format the scores of the fit, ready to print.

        Returns
        -------
        dict
            Formatted scores by label. With random effects and REML also -2 log of the restricted likelihood, which
            lme4 prints as the REML criterion.
        """
        mixed = self.method == "REML" and len(self.variance) > 1
        return {
            "R2 (adjusted)": f"{self.r2:.3f}",
            "Deviance explained": f"{100 * self.deviance_explained:.1f} %",
            self.method: f"{self.reml:.4f}",
            **({"-2 log REML": f"{2 * self.reml:.4f}"} if mixed else {}),
            "Log-likelihood": f"{self.loglik:.3f}",
            "AIC": f"{self.aic:.3f}",
            "n": f"{self.n:d}",
        }

    def __str__(self) -> str:
        """Format the summary in the layout and words of R."""
        names = {"scat": f"Scaled t({self.nu:.4g},{self.sigma:.4g})", "gamma": "Gamma"}
        lines = ["", f"Family: {names.get(self.family, self.family)}", f"Link function: {self.link}"]
        lines += ["", "Formula:", self.formula]
        if not self.converged:
            warning = "WARNING: the fit did not converge; its figures are not to be trusted."
            lines += ["", f"{warning} {self.message}".rstrip()]
        letter, smooth = ("z", "Chi.sq") if self.scale_known else ("t", "F")
        heads = ["Estimate", "Std. Error", f"{letter} value", f"Pr(>|{letter}|)"]
        lines += _section("Parametric coefficients:", self.parametric, heads, "{:.4f}")
        title = "Approximate significance of smooth terms:"
        lines += _section(title, self.smooth, ["edf", "Ref.df", smooth, "p-value"], "{:.3f}")
        if len(self.variance) > 1:
            shown = self.variance.drop(columns="variance").dropna(axis="columns", how="all")
            printed = shown.to_string(index=False, na_rep="", float_format="%.4f").split("\n")
            lines += ["", "Variance components:", *map(str.rstrip, printed)]
        explained = f"Deviance explained = {100 * self.deviance_explained:.3g}%"
        score = f"{'-' if self.method == 'REML' else ''}{self.method} = {self.reml:.5g}"
        lines += ["", f"R-sq.(adj) = {self.r2:6.3g}   {explained}"]
        lines += [f"{score}  Scale est. = {self.scale:<10.5g} n = {self.n}"]
        return "\n".join([*lines, *(f"Note: {note}" for note in self.notes)])

    __repr__ = __str__

    def rows(self) -> list[tuple[str, str, str]]:
        """Format the lines of a table as in papers: label, "value (standard error or reference df)" and stars.

        Returns
        -------
        list of tuple
            Estimate with standard error for coefficients, EDF with reference df for smooth terms.
        """
        return [
            (f"{prefix}{term}", f"{value:.2f} ({in_brackets:.2f})", stars(p_value))
            for prefix, table in (("", self.parametric), (_EDF, self.smooth))
            for term, value, in_brackets, _, p_value in table.itertuples(name=None)
        ]


def _section(title: str, table: pd.DataFrame, heads: list[str], style: str) -> list[str]:
    """Return the lines of a table of tests, whose columns are value, error or df, statistic and p-value."""
    if not len(table):
        return []
    styles = (style.format, style.format, "{:.3f}".format, _p_value)
    cells = {
        head: ["" if np.isnan(value) else write(value) for value in table[column]]
        for head, column, write in zip(heads, table, styles, strict=True)
    }
    shown = table.rename_axis(None)[[]].assign(**cells, **{"": [f"{stars(p):3}" for p in table["p_value"]]})
    return ["", title, *map(str.rstrip, shown.to_string().split("\n")), "---", _LEGEND]


def _p_value(p: float) -> str:
    return "<2e-16" if p < 2e-16 else f"{p:.3g}"
