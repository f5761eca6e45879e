"""Summary of a fitted model: coefficients, effective degrees of freedom, tests and scores, as papers print them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from tripwatt_gamm.components import variance_components
from tripwatt_gamm.families import Gaussian
from tripwatt_gamm.formula import render_formula
from tripwatt_gamm.inference import coefficient_table, term_table

if TYPE_CHECKING:
    import pandas as pd

    from tripwatt_gamm.estimator import Estimator

_LEVELS: Final = ((0.001, "***"), (0.01, "**"), (0.05, "*"))  # the usual ones, as R prints them
_LEGEND: Final = "*** p < 0.001, ** p < 0.01, * p < 0.05"
_EDF: Final = "EDF: "
_FITTED: Final = (
    *("r2", "deviance_explained", "reml", "aic", "loglik", "scale", "n"),
    *("nu", "sigma", "nu_at_bound", "converged", "message"),
)
"""Fields of a summary that are attributes of the model, there with a trailing underscore."""


def stars(p_value: float) -> str:
    """Return the stars of a p-value: three below 0.001, two below 0.01, one below 0.05; none if there is no test (NaN).

    Examples
    --------
    >>> stars(0.02), stars(0.3), stars(float("nan"))
    ('*', '', '')
    """
    return next((mark for level, mark in _LEVELS if p_value < level), "")


@dataclass(frozen=True, slots=True)
class Summary:
    """Tables and scores of a fitted model, as plain text (`text`) or as lines of a paper's table (`rows`).

    Attributes
    ----------
    parametric : pandas.DataFrame
        ``estimate, std_error, statistic, p_value`` per coefficient; a level without data has 0, 0 and no test (NaN).
    smooth : pandas.DataFrame
        ``edf, ref_df, statistic, p_value`` per smooth term and random effect.
    formula, family, method : str
        Formula, distribution of the errors, and method of the fit.
    scale_known : bool
        Whether the scale is known: then tests are z and chi-square, otherwise t and F.
    r2, deviance_explained : float
        Adjusted R2 and explained share of the deviance, as fractions.
    reml, aic, loglik : float
        Scores of the fit.
    scale : float
        Variance of gaussian errors; 1 for a scaled t.
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
    >>> result.distribution() in result.text()
    True
    """

    parametric: pd.DataFrame
    smooth: pd.DataFrame
    formula: str
    family: str
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
        return cls(
            parametric=coefficient_table(model),
            smooth=term_table(model),
            variance=variance_components(model),
            formula=render_formula(model.formula_),
            family=family.name,
            method=str(model.method) if family.name == "scat" else "REML",
            scale_known=not (isinstance(family, Gaussian) and family.scale is None),
            notes=tuple(model.notes_),
            **{name: getattr(model, f"{name}_") for name in _FITTED},
        )

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

    def text(self) -> str:
        """Format the summary as plain text.

        Returns
        -------
        str
            Lines, each ending with a line break.
        """
        lines = [f"Family:  {self.distribution()}", f"Formula: {self.formula}"]
        if not self.converged:
            warning = "WARNING: the fit did not converge; its figures are not to be trusted."
            lines.append(f"{warning} {self.message}".rstrip())
        parametric, smooth = ("z", "Chi-sq") if self.scale_known else ("t", "F")
        tables = (
            ("Parametric coefficients", self.parametric, ("Estimate", "Std. error", parametric), "%.4f"),
            ("Smooth terms", self.smooth, ("EDF", "Ref.df", smooth), "%.3f"),
        )
        for title, table, heads, style in tables:
            if len(table):
                lines += ["", f"{title}:", *_align(table, heads, style)]
        if len(self.variance) > 1:
            shown = self.variance.drop(columns="variance")
            printed = shown.to_string(index=False, na_rep="", float_format="%.4f").split("\n")
            lines += ["", "Variance components:", *map(str.rstrip, printed)]
        lines += ["", f"Stars: {_LEGEND}", ""]
        lines += [f"{label + ':':<20}{value}" for label, value in self.scores().items()]
        lines += ["", *(f"Note: {note}" for note in self.notes)] if self.notes else []
        return "\n".join(lines) + "\n"

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


def _align(table: pd.DataFrame, heads: tuple[str, str, str], style: str) -> list[str]:
    """Return the lines of a table of tests; both tables have value, error or df, statistic and p-value as columns."""
    width = max(len(str(name)) for name in table.index)
    lines = [f"{'':<{width}} " + " ".join(f"{head:>12}" for head in heads) + f" {'p':>10}"]
    for name, first, second, statistic, p in table.itertuples(name=None):
        tested = np.isfinite(p)
        numbers = (style % first, style % second, f"{statistic:.3f}" if tested else "")
        cells = " ".join(f"{number:>12}" for number in numbers)
        lines.append(f"{name:<{width}} {cells} {_p_value(p) if tested else '':>10} {stars(p)}".rstrip())
    return lines


def _p_value(p: float) -> str:
    return "< 2e-16" if p < 2e-16 else f"{p:.4f}" if p >= 1e-4 else f"{p:.2e}"
