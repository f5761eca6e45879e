"""Figures in a notebook, in a window and in axes of the caller."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from types import ModuleType

import matplotlib as mpl
import pytest
from matplotlib import pyplot
from matplotlib.backend_bases import FigureManagerBase
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

import tripwatt as tw
from tripwatt.figures import ShownFigure
from tripwatt.study.synthetic import synthetic_fleet

LINKS = [{"length_m": 3000.0, "speed_m_s": 12.0, "grade": 0.01}]


def of_plan() -> tw.Plan:
    return tw.read_route(LINKS, trip_id="commute")


NOUNS: dict[str, Callable[[], object]] = {
    "forecast": lambda: tw.forecast(of_plan(), tw.Departure(soc=0.8)),
    "plan": of_plan,
    "simulation": lambda: tw.simulate(of_plan(), "vw_id3"),
    "trip": lambda: synthetic_fleet(1).trips[0],
}
PANELS = {"forecast": 3, "plan": 2, "simulation": 1, "trip": 3}


@pytest.mark.parametrize("name", NOUNS)
def test_a_figure_is_its_own_picture_and_leaves_no_trace_in_pyplot(name: str) -> None:
    figure = NOUNS[name]().plot()
    assert figure._repr_png_().startswith(b"\x89PNG")
    assert len(figure.axes) == PANELS[name]
    assert pyplot.get_fignums() == []


@pytest.mark.parametrize("name", NOUNS)
def test_a_plot_takes_the_place_of_axes_and_leaves_the_others(name: str) -> None:
    figure = Figure(figsize=(12.0, 5.0), layout="constrained")
    left, right = figure.subplots(1, 2)
    assert NOUNS[name]().plot(ax=right) is figure
    figure.draw_without_rendering()
    assert left in figure.axes
    drawn = [axes for axes in figure.axes if axes is not left]
    assert len(drawn) == PANELS[name]
    assert all(axes.get_window_extent().x0 > left.get_window_extent().x1 for axes in drawn)
    assert not left.has_data()


def test_a_plot_is_drawn_within_a_part_of_a_figure() -> None:
    figure = Figure()
    top, _ = figure.subfigures(2)
    assert of_plan().plot(ax=top.subplots()) is figure
    assert len(figure.axes) == PANELS["plan"]


def test_axes_that_have_no_place_in_a_grid_are_refused() -> None:
    with pytest.raises(tw.InvalidInput, match="axes without a grid: ax: got "):
        of_plan().plot(ax=Figure().add_axes((0.1, 0.1, 0.8, 0.8)))


@pytest.mark.parametrize("quantity", ["speed [km/h]", "elevation [m]", "time [min]"])
def test_axes_name_quantity_and_unit(quantity: str) -> None:
    axes = of_plan().plot().axes
    assert quantity in {label for axis in axes for label in (axis.get_xlabel(), axis.get_ylabel())}


def test_a_simulation_is_drawn_up_to_its_energies_by_cause() -> None:
    run = tw.simulate(of_plan(), "vw_id3")
    (axis,) = run.plot().axes
    ends = {line.get_label(): line.get_ydata()[-1] for line in axis.get_lines()}
    assert ends["total"] == pytest.approx(run.simulated_energy_wh / 1000.0)
    assert ends["air drag"] == pytest.approx(run.by_cause_wh["air"] / 1000.0)
    assert axis.get_ylabel() == "energy at the battery terminals [kWh]"
    assert "not delivered" not in ends


class Window(FigureManagerBase):
    """A window that is closed as soon as the program waits for it."""

    shown: list[Figure] = []  # noqa: RUF012 - of all windows

    @classmethod
    def start_main_loop(cls) -> None:
        for number in pyplot.get_fignums():
            cls.shown.append(pyplot.figure(number))
            pyplot.close(number)

    def show(self) -> None:
        assert pyplot.get_fignums() == [self.num]


class WindowCanvas(FigureCanvasAgg):
    manager_class = Window


@pytest.fixture
def windows() -> Iterator[list[Figure]]:
    """Figures that were open in a window, with a backend that has some."""
    backend = ModuleType("window_backend")
    backend.FigureCanvas, backend.FigureManager = WindowCanvas, Window
    before = mpl.get_backend()
    sys.modules["window_backend"] = backend
    pyplot.switch_backend("module://window_backend")
    Window.shown.clear()
    yield Window.shown
    pyplot.switch_backend(before)
    del sys.modules["window_backend"]


def test_show_opens_a_window_again_and_again(windows: list[Figure]) -> None:
    figure = of_plan().plot()
    figure.show()
    figure.show()
    assert windows == [figure, figure]
    assert pyplot.get_fignums() == []


def test_show_without_a_display_leaves_nothing_open(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    before = mpl.get_backend()
    pyplot.switch_backend("agg")
    ShownFigure().show()
    assert pyplot.get_fignums() == []
    pyplot.switch_backend(before)
