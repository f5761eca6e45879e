"""The model of all journeys."""

import pytest

import tripwatt as tw


@pytest.fixture(scope="session")
def model() -> tw.ForecastModel:
    return tw.load_model()
