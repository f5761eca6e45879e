"""Residuals against their distribution: the numbers, and that the figures have labels."""

import re

import numpy as np
import pytest
from matplotlib.figure import Figure


def test_quantiles_of_a_right_model_lie_within_their_band(waves_fit):
    ax = waves_fit.diagnosis().plot().axes[0]
    edges = ax.collections[0].get_paths()[0].vertices
    points = np.asarray(ax.collections[1].get_offsets())
    inside = [np.ptp(np.sign(edges[edges[:, 0] == x, 1] - y)) == 2 for x, y in points]
    assert np.mean(inside) > 0.8


def test_histogram_counts_every_residual_once(waves_fit):
    ax = waves_fit.diagnosis().plot().axes[2]
    count, expected = [bar.get_height() for bar in ax.patches], ax.lines[0].get_ydata()
    beyond = int(re.search(r"\((\d+) beyond", ax.get_xlabel())[1])
    assert sum(count) + beyond == waves_fit.n_
    assert sum(expected) == pytest.approx(sum(count), rel=0.05)


def test_diagnosis_draws_four_labelled_panels(waves_fit):
    figure = waves_fit.diagnosis().plot()
    assert isinstance(figure, Figure)
    axes = figure.axes
    assert len({ax.get_title() for ax in axes}) == 4
    assert all(ax.get_xlabel() and ax.get_ylabel() for ax in axes)
    figure.canvas.draw()
