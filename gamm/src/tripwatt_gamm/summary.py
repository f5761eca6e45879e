"""A fitted model on one page: coefficients, effective degrees of freedom, tests and scores, as papers print them."""

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

_LEVELS: Final = ((0.001, "***"), (0.01, "**"), (0.05, "*"))
_LEGEND: Final = "*** p < 0.001, ** p < 0.01, * p < 0.05"
_EDF: Final = "EDF: "


def stars(p_value: float) -> str:
    """Stars of a p-value: three below 0.001, two below 0.01, one below 0.05; none where there is no test.

    Examples
    --------
    >>> stars(0.02), stars(0.3), stars(float("nan"))
    ('*', '', '')
    """
    return next((mark for level, mark in _LEVELS if p_value < level), "")


@dataclass(frozen=True, slots=True)
class Summary:
    r"""Tables and scores of a fitted model; `text`, `html` and `latex` print them.

    Attributes
    ----------
    parametric : pandas.DataFrame
        ``estimate, std_error, statistic, p_value`` per coefficient; 0, 0 and no test for a level without data.
    smooth : pandas.DataFrame
        ``edf, ref_df, statistic, p_value`` per smooth term and random effect.
    formula, family, method : str
        What was fitted and how.
    scale_known : bool
        Tests are z and chi-square if so, t and F otherwise.
    r2, deviance_explained : float
        Adjusted R2 and share of the deviance, fractions.
    reml, aic, loglik : float
        Scores of the fit.
    scale : float
        Variance (gaussian) or 1 (scaled t).
    n : int
        Rows.
    nu, sigma : float
        Shape and scale of a scaled t; NaN otherwise.
    nu_at_bound : bool
        Whether nu stopped at the least value it was allowed.
    converged : bool
        Whether the fit did.
    variance : pandas.DataFrame
        Standard deviations of random effects and errors, as of `GAMM.variance_components`.
    message : str
        What ended the fit.
    notes : tuple of str
        Reductions that the data forced: columns removed, levels without data.

    Examples
    --------
    >>> import numpy as np, pandas as pd
    >>> from tripwatt_gamm.model import GAMM
    >>> x = np.linspace(0, 1, 60)
    >>> frame = pd.DataFrame({"x": x, "y": np.sin(6 * x) + 0.2 * np.cos(90 * x)})
    >>> result = Summary.from_model(GAMM("y ~ s(x, k=8)").fit(frame))
    >>> list(result.frame()["kind"]), [label for label, _, _ in result.rows()]
    (['parametric', 'smooth'], ['(Intercept)', 'EDF: s(x)'])
    >>> list(result.scores())
    ['R2 (adjusted)', 'Deviance explained', 'REML', 'Log-likelihood', 'AIC', 'n']
    >>> result.distribution() in result.text()
    True
    >>> result.html()[:6], result.latex().splitlines()[0]
    ('<table', '\\begin{tabular}{l c}')
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
            formula=render_formula(model.formula_),
            family=family.name,
            method=str(model.method) if family.name == "scat" else "REML",
            scale_known=not (isinstance(family, Gaussian) and family.scale is None),
            r2=float(model.r2_),
            deviance_explained=float(model.deviance_explained_),
            reml=float(model.reml_),
            aic=float(model.aic_),
            loglik=float(model.loglik_),
            scale=float(model.scale_),
            n=int(model.n_),
            nu=float(model.nu_) if model.nu_ is not None else float("nan"),
            sigma=float(model.sigma_) if model.sigma_ is not None else float("nan"),
            nu_at_bound=bool(model.nu_at_bound_),
            converged=bool(model.converged_),
            message=str(model.message_),
            notes=tuple(model.notes_),
            variance=variance_components(model),
        )

    def frame(self) -> pd.DataFrame:
        """Both tables in one, term by term.

        Returns
        -------
        pandas.DataFrame
            Columns ``kind`` ("parametric" or "smooth"), ``term``, ``estimate``, ``std_error``, ``edf``,
            ``ref_df``, ``test`` ("t", "z", "F" or "chi2"), ``statistic``, ``p_value``, ``stars``.
        """
        import pandas as pd

        tests = ("z", "chi2") if self.scale_known else ("t", "F")
        parts = [
            table.reset_index().assign(kind=kind, test=test)
            for table, kind, test in zip(
                (self.parametric, self.smooth), ("parametric", "smooth"), tests, strict=True
            )
        ]
        columns = ["kind", "term", "estimate", "std_error", "edf", "ref_df", "test", "statistic", "p_value"]
        filled = [part.reindex(columns=columns) for part in parts if len(part)]
        whole = pd.DataFrame(columns=columns)
        if filled:
            rows = [row for part in filled for row in part.itertuples(index=False, name=None)]
            whole = pd.DataFrame(rows, columns=columns)
        return whole.assign(stars=[stars(p) for p in whole["p_value"]])

    def distribution(self) -> str:
        """Describe the family in words, with what was estimated of it.

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
            Label to text; with random effects and REML also -2 log of the restricted likelihood, which lme4 prints as
            the REML criterion.
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
        """Print the summary as plain text.

        Returns
        -------
        str
            Lines, the last with a line break.
        """
        lines = [f"Family:  {self.distribution()}", f"Formula: {self.formula}"]
        if not self.converged:
            lines.append(
                f"WARNING: the fit did not converge; its figures are not to be trusted. {self.message}".rstrip()
            )
        parametric, smooth = ("z", "Chi-sq") if self.scale_known else ("t", "F")
        tables = (
            ("Parametric coefficients", self.parametric, ("Estimate", "Std. error", parametric), "%.4f"),
            ("Smooth terms", self.smooth, ("EDF", "Ref.df", smooth), "%.3f"),
        )
        for title, table, heads, style in tables:
            if len(table):
                lines += ["", f"{title}:", *_align(table, heads, style)]
        if len(self.variance) > 1:
            shown = self.variance.drop(columns="variance").to_string(
                index=False, na_rep="", float_format="%.4f"
            )
            lines += ["", "Variance components:", *map(str.rstrip, shown.split("\n"))]
        lines += ["", f"Stars: {_LEGEND}", ""]
        lines += [f"{label + ':':<20}{value}" for label, value in self.scores().items()]
        lines += ["", *(f"Note: {note}" for note in self.notes)] if self.notes else []
        return "\n".join(lines) + "\n"

    def rows(self) -> list[tuple[str, str, str]]:
        """Label, "value (standard error or reference df)" and stars of every line, as the table of a paper has them.

        Returns
        -------
        list of tuple
            Estimate with standard error for coefficients, EDF with reference df for smooth terms.
        """
        pairs = [(self.parametric, "", "estimate", "std_error"), (self.smooth, _EDF, "edf", "ref_df")]
        return [
            (f"{prefix}{term}", f"{row[value]:.2f} ({row[in_brackets]:.2f})", stars(float(row["p_value"])))
            for table, prefix, value, in_brackets in pairs
            for term, row in table.iterrows()
        ]

    def html(self, title: str = "Model") -> str:
        """The summary as an HTML table without style, for a page that has its own.

        Parameters
        ----------
        title : str
            Head of the column of values.

        Returns
        -------
        str
            One element ``table``.
        """
        from html import escape

        tests = self.frame()
        body = []
        for (label, value, mark), row in zip(self.rows(), tests.to_dict("records"), strict=True):
            cells = [f"{value}<sup>{mark}</sup>" if mark else value]
            cells += [_statistic(str(row["test"]), row["statistic"]), _p_value(float(row["p_value"]))]
            data = "".join(f"<td>{cell if '<sup>' in cell else escape(cell)}</td>" for cell in cells)
            body.append(f'<tr><th scope="row">{escape(label)}</th>{data}</tr>')
        heads = ("", title, "Test", "p")
        head = "".join(f'<th scope="col">{escape(cell)}</th>' for cell in heads)
        scores = {"Family": self.distribution(), **self.scores()}
        if not self.converged:
            scores["Warning"] = f"the fit did not converge. {self.message}".rstrip()
        scores |= {f"Note {i}": note for i, note in enumerate(self.notes, 1)}
        foot = "".join(
            f'<tr><th scope="row">{escape(label)}</th><td colspan="3">{escape(value)}</td></tr>\n'
            for label, value in scores.items()
        )
        note = f'<tr><td colspan="4"><small>{escape(_LEGEND)}</small></td></tr>'
        return (
            f'<table class="gam-summary">\n<caption>{escape(self.formula)}</caption>\n<thead><tr>{head}</tr></thead>\n'
            f"<tbody>\n{chr(10).join(body)}\n</tbody>\n<tfoot>\n{foot}{note}\n</tfoot>\n</table>\n"
        )

    def latex(self, title: str = "Model") -> str:
        """The summary as a LaTeX tabular: one column, estimate (standard error) and EDF (reference df).

        Parameters
        ----------
        title : str
            Head of the column of values.

        Returns
        -------
        str
            An environment ``tabular``.
        """
        rows = self.rows()
        labels = [_latex(label) for label, _, _ in rows]
        width = max(map(len, labels), default=0)
        lines = [r"\begin{tabular}{l c}", r"\hline", rf" & {_latex(title)} \\", r"\hline"]
        for label, (_, value, mark) in zip(labels, rows, strict=True):
            number = value.replace(" (", r" \; (")
            lines.append(rf"{label:<{width}} & ${number}{'^{' + mark + '}' if mark else ''}$ \\")
        lines.append(r"\hline")
        scores = {"Family": self.distribution(), **self.scores()}
        lines += [rf"{_latex(label)} & {_latex(value)} \\" for label, value in scores.items()]
        legend = ", ".join(rf"$^{{{mark}}}p<{level}$" for level, mark in _LEVELS)
        lines += [r"\hline", rf"\multicolumn{{2}}{{l}}{{\scriptsize {legend}}} \\", r"\end{tabular}"]
        return "\n".join(lines) + "\n"


def _align(table: pd.DataFrame, heads: tuple[str, str, str], style: str) -> list[str]:
    names = [str(name) for name in table.index]
    wide = max(map(len, [*names, ""]))
    lines = [f"{'':<{wide}} " + " ".join(f"{head:>12}" for head in heads) + f" {'p':>10}"]
    for name, row in zip(names, table.itertuples(index=False, name=None), strict=True):
        first, second, statistic, p = (float(v) for v in row)
        numbers = " ".join(f"{style % v:>12}" for v in (first, second))
        shown = f"{statistic:>12.3f}" if np.isfinite(statistic) else f"{'':>12}"
        lines.append(f"{name:<{wide}} {numbers} {shown} {_p_value(p):>10} {stars(p)}".rstrip())
    return lines


def _statistic(test: str, value: float) -> str:
    return f"{test} = {value:.3f}" if np.isfinite(value) else "no data"


def _p_value(p: float) -> str:
    if not np.isfinite(p):
        return ""
    return "< 2e-16" if p < 2e-16 else f"{p:.4f}" if p >= 1e-4 else f"{p:.2e}"


def _latex(text: str) -> str:
    escapes = {c: "\\" + c for c in "&%$#_{}"} | {"\\": r"\textbackslash{}", "~": r"\~{}", "^": r"\^{}"}
    return "".join(escapes.get(c, c) for c in text)
