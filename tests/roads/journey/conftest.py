"""The model of all journeys."""

import pytest

import tripwatt as tw


@pytest.fixture(scope="session")
def model():
    return tw.load_model()
