"""The made-up run that the tests of the report share."""

from types import SimpleNamespace

import pytest
from made_up_run import make_run


@pytest.fixture(scope="session")
def run() -> SimpleNamespace:
    return make_run()
