"""The real EMHASS plans charging and preheating with the numbers of the service, as the page on charge planning configures it."""

from __future__ import annotations

import datetime as dt
import json
import math
import os
import re
import subprocess
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from tests.server.http.test_charge_planning import PAGE, answered, configurations, filled
from tests.server.http.test_live import Served, jobs, served
from tests.support import ROOT

from tripwatt.fleet.charging import EFFICIENCY, Depot, emhass

__all__ = ["jobs", "served"]

EMHASS = Path(os.environ.get("TRIPWATT_EMHASS", ROOT / ".venv-emhass"))
pytestmark = pytest.mark.skipif(
    not (EMHASS / "bin" / "emhass").exists(), reason=f"no EMHASS at {EMHASS}: .ci/run installs it"
)

STEP_H = 0.5
PLUG_W = 2300.0
"""A household socket: charging takes several steps."""
PRICES = [0.30] * 6 + [0.10] * 8 + [0.30] * 10
"""Price of each step; the cheap ones are before the departure."""
SECRETS = """
hass_url: empty
long_lived_token: empty
time_zone: Europe/Berlin
Latitude: 47.0
Longitude: 9.0
Altitude: 500
"""


def planned(folder: Path, request: dict[str, Any]) -> pd.DataFrame:
    """The plan of EMHASS for a request and forecasts of a house without sun."""
    steps = request["prediction_horizon"]
    house = {
        "pv_power_forecast": [0] * steps,
        "load_power_forecast": [300] * steps,
        "load_cost_forecast": PRICES[:steps],
        "prod_price_forecast": [0.05] * steps,
    }
    (package,) = EMHASS.glob("lib/python3*/site-packages/emhass")
    (folder / "data").mkdir()
    (folder / "secrets.yaml").write_text(SECRETS)
    (folder / "config.json").write_text("{}")
    command = [EMHASS / "bin" / "emhass", "--action", "naive-mpc-optim", "--costfun", "cost"]
    places = ["--config", "config.json", "--secrets", "secrets.yaml", "--data", "data", "--root", package]
    alone = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    subprocess.run(
        [*command, *places, "--runtimeparams", json.dumps(request | house)],
        cwd=folder,
        env=alone,
        check=True,
        capture_output=True,
        timeout=300,
    )
    return pd.read_csv(folder / "data" / "opt_res_latest.csv")


def test_emhass_charges_what_is_needed_before_the_departure_in_the_cheapest_steps(
    served: Served, tmp_path: Path
) -> None:
    answered(served)
    query = {"car": "leaf", "probability": 0.9, "reserve": 0.1, "plug_w": PLUG_W}
    need = served("/v1/need", params={**query, "departs_at": "2026-01-05T07:30:00Z"}).json()
    calls = dict(re.findall(r'`(\w+): "(\{\{.*?\}\})"`', PAGE.read_text("utf-8")))
    sensors = {"sensor.charge_to_leave_with": ("47", need)}
    given = {name: float(filled(value, sensors=sensors)) for name, value in calls.items()}
    template = configurations()[-1]["rest_command"]["emhass_day"]["payload"]
    request = json.loads(filled(template, **given).replace("7400", f"{PLUG_W:.0f}"))
    plan = planned(tmp_path, request)
    assert set(plan["optim_status"]) == {"Optimal"}  # nothing had to be relaxed
    departs = request["end_timesteps_of_each_deferrable_load"][0]
    car_w, preheat_w = plan["P_deferrable0"], plan["P_deferrable1"]
    steps = math.ceil(need["charging_s"] / 3600.0 / STEP_H)
    assert car_w.sum() * STEP_H == pytest.approx(steps * STEP_H * PLUG_W)
    assert car_w.sum() * STEP_H >= need["wall_wh"] > (steps - 1) * STEP_H * PLUG_W
    charged = plan.index[car_w > 1.0]
    assert charged.max() < departs
    assert {PRICES[step] for step in charged} == {min(PRICES)}
    assert list(plan.index[preheat_w > 1.0]) == [departs - 1]
    assert preheat_w.sum() * STEP_H == pytest.approx(need["preheat"]["wall_wh"], abs=0.5)


def test_emhass_charges_the_vehicles_of_a_fleet_between_their_trips(tmp_path: Path) -> None:
    """Two parts of one vehicle, which take 0.495 and 1.2 hours, in whole steps."""
    begins, hour = dt.datetime(2026, 1, 12, 0, 0, tzinfo=dt.UTC), dt.timedelta(hours=1)
    rows = [("V1", 5.0, 6.2, 3297.0), ("V1", 11.0, 12.0, 8000.0)]
    needs = pd.DataFrame(rows, columns=["vehicle_id", "departs_at", "arrives_at", "charge_wh"])
    needs[["alternating_w", "direct_w"]] = 11_000.0, 50_000.0
    needs[["departs_at", "arrives_at"]] = begins + needs[["departs_at", "arrives_at"]].map(lambda h: h * hour)
    request = emhass(Depot(begins, 7400.0).windows(needs), begins)
    steps = request["prediction_horizon"]
    assert (steps, request["operating_hours_of_each_deferrable_load"]) == (22, [0.5, 1.5])
    plan = planned(tmp_path, request)
    assert set(plan["optim_status"]) == {"Optimal"}
    for k, (first, last) in enumerate([(0, 10), (13, 22)]):
        power_w = plan[f"P_deferrable{k}"]
        charged = plan.index[power_w > 1.0]
        assert first <= charged.min() <= charged.max() < last
        assert EFFICIENCY * power_w.sum() * STEP_H >= needs.loc[k, "charge_wh"]
