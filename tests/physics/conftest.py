import pytest

from tripwatt.vehicles import Vehicle, load_vehicle


@pytest.fixture(scope="session")
def i3() -> Vehicle:
    return load_vehicle("bmw_i3_60ah")


@pytest.fixture(scope="session")
def loss_free() -> Vehicle:
    """The i3 without any resistance, loss, limit or load."""
    return load_vehicle(
        "bmw_i3_60ah",
        preset="paper",
        overrides={
            "road_load.coastdown_a_n": 0.0,
            "road_load.coastdown_b_n_s_m": 0.0,
            "road_load.coastdown_c_n_s2_m2": 0.0,
            "drivetrain.gearbox_efficiency": 1.0,
            "drivetrain.phase_resistance_ohm": 0.0,
            "drivetrain.iron_loss_linear": 0.0,
            "drivetrain.iron_loss_quadratic": 0.0,
            "drivetrain.inverter_fixed_loss_w": 0.0,
            "drivetrain.inverter_voltage_drop_v": 0.0,
            "drivetrain.inverter_resistance_ohm": 0.0,
            "drivetrain.motor_max_torque_nm": 20_000.0,
            "drivetrain.motor_max_power_w": 2e6,
            "regeneration.fraction": 1.0,
            "regeneration.max_torque_nm": 20_000.0,
            "regeneration.max_power_w": 2e6,
            "regeneration.zero_speed_m_s": 0.0,
            "regeneration.full_speed_m_s": 1e-9,
            "auxiliaries.base_load_w": 0.0,
        },
    )
