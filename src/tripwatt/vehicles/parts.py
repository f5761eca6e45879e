"""The parts of a car as frozen dataclasses. Each field defines unit and bounds of a value; the docstring has its meaning."""

from __future__ import annotations

from dataclasses import MISSING, dataclass, field, fields
from typing import Any, Final, TypeVar

import numpy as np

from tripwatt.arrays import FloatArray, PerTrip
from tripwatt.units import GRAVITY_M_S2

Number = TypeVar("Number", float, FloatArray)


def quantity(unit: str, minimum: float, maximum: float, *, default: Any = MISSING, **more: Any) -> Any:
    """Make a dataclass field for a quantity with unit and bounds.

    `scaled=True` marks a quantity that depends on the scale of the state of charge, so the TOML must name the scale.
    """
    return field(metadata={"unit": unit, "minimum": minimum, "maximum": maximum, **more}, default=default)


def given(value: float | None) -> float:
    """Return a value that the method of the road load requires, so it cannot be None."""
    assert value is not None
    return value


def choice(allowed: tuple[str, ...], **default: Any) -> Any:
    """Make a dataclass field that holds one of the allowed words."""
    return field(metadata={"choice": allowed, "unit": ""}, **default)


@dataclass(frozen=True, slots=True)
class Body:
    """Masses of the car.

    Attributes
    ----------
    curb_mass_kg : float
        Mass of the car ready to drive, nobody inside [kg].
    driver_mass_kg : float
        Driver and what is always aboard [kg].
    rotating_mass_factor : float
        Inertia with the rotating parts, over inertia without them [1].

    Examples
    --------
    >>> from tripwatt.vehicles import load_vehicle
    >>> body = load_vehicle("bmw_i3_60ah").body
    >>> body.test_mass_kg == body.curb_mass_kg + body.driver_mass_kg
    True
    """

    curb_mass_kg: float = quantity("kg", 100.0, 60_000.0)
    driver_mass_kg: float = quantity("kg", 0.0, 500.0)
    rotating_mass_factor: float = quantity("1", 1.0, 1.5)

    @property
    def test_mass_kg(self) -> float:
        """Mass of the car on the road without payload [kg]."""
        return self.curb_mass_kg + self.driver_mass_kg


@dataclass(frozen=True, slots=True)
class RoadLoad:
    """Resistance of the car on a flat road: a coast-down polynomial, or coefficients of drag and rolling.

    The coast-down force A + B v + C v² was measured at one mass and one air density. A and B are taken as rolling
    and driveline drag, in proportion to the weight; C as air drag, in proportion to the air density.

    Attributes
    ----------
    method : {"coastdown", "coefficients"}
        Which of the two descriptions is used.
    coastdown_a_n : float or None
        Constant term A [N].
    coastdown_b_n_s_m : float or None
        Linear term B [N s/m].
    coastdown_c_n_s2_m2 : float or None
        Quadratic term C [N s2/m2].
    coastdown_mass_kg : float or None
        Mass during the coast-down [kg].
    coastdown_air_density_kg_m3 : float or None
        Air density of the coast-down [kg/m3].
    drag_coefficient : float or None
        Air drag coefficient c_d [1].
    frontal_area_m2 : float or None
        Frontal area [m2].
    rolling_resistance_coefficient : float or None
        Rolling resistance over weight [1].

    Examples
    --------
    >>> from tripwatt.vehicles import load_vehicle
    >>> load = load_vehicle("bmw_i3_60ah").road_load
    >>> load.method, round(load.drag_area_m2, 1)
    ('coastdown', 0.7)
    """

    method: str = choice(("coastdown", "coefficients"), default="")
    coastdown_a_n: float | None = quantity("N", 0.0, 5_000.0, default=None)
    coastdown_b_n_s_m: float | None = quantity("N s/m", -20.0, 100.0, default=None)
    coastdown_c_n_s2_m2: float | None = quantity("N s2/m2", 0.0, 20.0, default=None)
    coastdown_mass_kg: float | None = quantity("kg", 100.0, 60_000.0, default=None)
    coastdown_air_density_kg_m3: float | None = quantity("kg/m3", 0.5, 1.6, default=None)
    drag_coefficient: float | None = quantity("1", 0.0, 2.0, default=None)
    frontal_area_m2: float | None = quantity("m2", 0.1, 20.0, default=None)
    rolling_resistance_coefficient: float | None = quantity("1", 0.0, 0.1, default=None)

    @property
    def drag_area_m2(self) -> float:
        """Drag coefficient times frontal area [m²]."""
        if self.method == "coastdown":
            return 2.0 * given(self.coastdown_c_n_s2_m2) / given(self.coastdown_air_density_kg_m3)
        return given(self.drag_coefficient) * given(self.frontal_area_m2)

    @property
    def rolling_coefficients(self) -> tuple[float, float]:
        """Rolling resistance over weight: constant part [1] and part per speed [s/m]."""
        if self.method == "coastdown":
            weight = given(self.coastdown_mass_kg) * GRAVITY_M_S2
            return given(self.coastdown_a_n) / weight, given(self.coastdown_b_n_s_m) / weight
        return given(self.rolling_resistance_coefficient), 0.0


ROLLING_ENTRIES: Final = ("coastdown_a_n", "coastdown_b_n_s_m", "rolling_resistance_coefficient")
"""Entries of a road load to which rolling and driveline drag are proportional."""

ROAD_LOADS: Final = {
    "coastdown": tuple(f.name for f in fields(RoadLoad) if f.name.startswith("coastdown_")),
    "coefficients": ("drag_coefficient", "frontal_area_m2", "rolling_resistance_coefficient"),
}
"""Method of a road load -> the entries that it needs."""

WARM_COEFFICIENT_PER_K: Final = 0.0086
"""Largest relative fall of rolling drag for each kelvin of air above the reference [1/K], SAE J1263. A steeper rise in the cold has
causes that do not act above the reference: gear oil, winter tyres, wet roads."""


@dataclass(frozen=True, slots=True)
class Tyres:
    """How rolling and driveline drag depend on the weather and on how long the car has been driven.

    The road load was measured warm and at one air temperature; see `tripwatt.physics.road_load.rolling_factor`.

    Attributes
    ----------
    reference_temperature_degc : float
        Air temperature to which the road load belongs [°C].
    temperature_coefficient_per_k : float
        Relative rise of warm rolling drag for each kelvin below the reference [1/K]. Above it the drag falls as steeply, but by no more
        than `WARM_COEFFICIENT_PER_K`.
    cold_excess : float
        Relative rise of rolling drag right after a long stop [1].
    warm_up_time_s : float
        Time constant of warming up and cooling down [s].
    warm_up_speed_m_s : float
        Constant speed at which the car warms up fully [m/s].

    Examples
    --------
    >>> from tripwatt.vehicles import load_vehicle
    >>> load_vehicle("bmw_i3_60ah").tyres.reference_temperature_degc
    20.0
    """

    reference_temperature_degc: float = quantity("degC", -20.0, 60.0)
    temperature_coefficient_per_k: float = quantity("1/K", 0.0, 0.05)
    cold_excess: float = quantity("1", 0.0, 2.0)
    warm_up_time_s: float = quantity("s", 1.0, 1e5)
    warm_up_speed_m_s: float = quantity("m/s", 1.0, 60.0)

    def weather_factor(self, temperature_degc: PerTrip) -> FloatArray:
        """Return warm rolling drag at an air temperature over that at the reference temperature [1].

        Parameters
        ----------
        temperature_degc : float or ndarray
            Temperature of the outside air [°C].

        Returns
        -------
        ndarray
            1 at the reference temperature; continuous, and never rising with temperature.

        Examples
        --------
        >>> from tripwatt.vehicles import load_vehicle
        >>> tyres = load_vehicle("bmw_i3_60ah").tyres
        >>> tyres.weather_factor(np.array([0.0, 20.0, 40.0])).round(3)
        array([1.172, 1.   , 0.828])
        """
        colder = self.reference_temperature_degc - temperature_degc
        slope = self.temperature_coefficient_per_k
        warm_slope = np.minimum(slope, WARM_COEFFICIENT_PER_K)
        return np.asarray(1.0 + slope * np.maximum(colder, 0.0) + warm_slope * np.minimum(colder, 0.0))


MACHINES: Final = ("permanent_magnet", "induction", "externally_excited")
"""Types of traction machine: their flux comes from magnets, or from a controlled current in stator or rotor."""


@dataclass(frozen=True, slots=True)
class Drivetrain:
    """Wheel, gearbox, motor and inverter.

    The loss map of motor and inverter is a sum of physical terms, see `tripwatt.vehicles.losses.motor_loss`.

    Attributes
    ----------
    wheel_radius_m : float
        Effective rolling radius [m].
    gear_ratio : float
        Motor speed over wheel speed [1].
    gearbox_efficiency : float
        Of gearbox and differential, under load [1].
    motor_max_torque_nm : float
        Peak torque at the motor shaft [Nm].
    motor_max_power_w : float
        Peak power at the motor shaft [W].
    motor_max_speed_rad_s : float
        Highest motor speed [rad/s].
    torque_constant_nm_a : float
        Torque per ampere of phase current amplitude [Nm/A].
    phase_resistance_ohm : float
        Stator resistance of one phase, warm; with that of the rotor of an induction machine [ohm].
    field_weakening_speed_rad_s : float
        Motor speed above which the back-EMF needs field weakening [rad/s].
    characteristic_current_a : float
        Magnet flux over d-axis inductance, amplitude [A].
    iron_loss_linear : float
        Iron loss, part linear in speed [W s/(rad Nm^x)].
    iron_loss_quadratic : float
        Iron loss, part quadratic in speed [W s2/(rad2 Nm^x)].
    iron_loss_torque_exponent : float
        Exponent x of the torque in the iron loss [1].
    inverter_fixed_loss_w : float
        Inverter loss whenever it switches [W].
    inverter_voltage_drop_v : float
        Inverter loss per ampere of phase current amplitude [V].
    inverter_resistance_ohm : float
        Inverter loss per squared phase current [ohm].
    motor_loss_factor : float
        Loss of motor and inverter over that of the map [1].
    flux_loss_w_s2_rad2 : float
        Iron loss under load beyond the map, over the square of speed [W s2/rad2].
    machine : {"permanent_magnet", "induction", "externally_excited"}
        Type of the machine. Where there are two motors, that of the one that drives at light load.
    field_loss_w : float
        Loss of the current that makes the full flux [W]; 0 for magnets.

    Examples
    --------
    >>> from tripwatt.vehicles import load_vehicle
    >>> 0.0 < load_vehicle("bmw_i3_60ah").drivetrain.gearbox_efficiency < 1.0
    True
    """

    wheel_radius_m: float = quantity("m", 0.1, 1.0)
    gear_ratio: float = quantity("1", 0.1, 50.0)
    gearbox_efficiency: float = quantity("1", 0.5, 1.0)
    motor_max_torque_nm: float = quantity("Nm", 1.0, 20_000.0)
    motor_max_power_w: float = quantity("W", 1e3, 2e6)
    motor_max_speed_rad_s: float = quantity("rad/s", 50.0, 4_000.0)
    torque_constant_nm_a: float = quantity("Nm/A", 1e-3, 100.0)
    phase_resistance_ohm: float = quantity("ohm", 0.0, 1.0)
    field_weakening_speed_rad_s: float = quantity("rad/s", 1.0, 1e9)
    characteristic_current_a: float = quantity("A", 0.0, 1e5)
    iron_loss_linear: float = quantity("W s/(rad Nm^x)", -10.0, 10.0)
    iron_loss_quadratic: float = quantity("W s2/(rad2 Nm^x)", 0.0, 1.0)
    iron_loss_torque_exponent: float = quantity("1", 0.0, 3.0)
    inverter_fixed_loss_w: float = quantity("W", 0.0, 5_000.0)
    inverter_voltage_drop_v: float = quantity("V", 0.0, 50.0)
    inverter_resistance_ohm: float = quantity("ohm", 0.0, 1.0)
    motor_loss_factor: float = quantity("1", 0.0, 20.0, default=1.0)
    flux_loss_w_s2_rad2: float = quantity("W s2/rad2", 0.0, 1.0, default=0.0)
    machine: str = choice(MACHINES, default="permanent_magnet")
    field_loss_w: float = quantity("W", 0.0, 50_000.0, default=0.0)


@dataclass(frozen=True, slots=True)
class Regeneration:
    """Limits of regeneration: how much braking goes through the motor. The rest goes to the friction brakes.

    Attributes
    ----------
    fraction : float
        Share of the braking power at the wheel that the motor takes [1].
    max_torque_nm : float
        Largest braking torque at the motor shaft [Nm].
    max_power_w : float
        Largest braking power at the wheel [W].
    zero_speed_m_s : float
        At and below this speed the motor does not brake [m/s].
    full_speed_m_s : float
        From this speed on the motor takes its whole share [m/s].
    full_soc : float
        Battery takes everything up to this state of charge [1].
    zero_soc : float
        Battery takes nothing from this state of charge on [1].
    zero_temperature_degc : float
        Battery this cold takes nothing [°C].
    full_temperature_degc : float
        Battery this warm takes everything [°C].

    Examples
    --------
    >>> from tripwatt.vehicles import load_vehicle
    >>> braking = load_vehicle("bmw_i3_60ah").regeneration
    >>> braking.zero_speed_m_s < braking.full_speed_m_s
    True
    """

    fraction: float = quantity("1", 0.0, 1.0)
    max_torque_nm: float = quantity("Nm", 0.0, 20_000.0)
    max_power_w: float = quantity("W", 0.0, 2e6)
    zero_speed_m_s: float = quantity("m/s", 0.0, 20.0)
    full_speed_m_s: float = quantity("m/s", 0.0, 30.0)
    full_soc: float = quantity("1", 0.0, 1.0)
    zero_soc: float = quantity("1", 0.0, 1.0)
    zero_temperature_degc: float = quantity("degC", -60.0, 30.0)
    full_temperature_degc: float = quantity("degC", -60.0, 40.0)


@dataclass(frozen=True, slots=True)
class Battery:
    """High-voltage battery: cells in series (parallel cells count as one larger cell).

    Attributes
    ----------
    capacity_ah : float
        Charge between soc 0 and soc 1 [Ah].
    cells_in_series : float
        Number of cells in series [1].
    ocv_soc : tuple of float
        State of charge of the open-circuit voltages [1].
    ocv_v : tuple of float
        Open-circuit voltage of one cell over ocv_soc [V].
    resistance_soc : tuple of float
        State of charge of the resistances [1].
    resistance_ohm : tuple of float
        Resistance of one cell at the reference temperature [ohm].
    resistance_temperature_degc : float
        Reference temperature of resistance_ohm [°C].
    resistance_activation_energy_j_mol : float
        Arrhenius activation energy of the resistance [J/mol].
    min_cell_voltage_v : float
        Terminal voltage of one cell is held above this [V].
    max_cell_voltage_v : float
        Terminal voltage of one cell belongs below this [V].
    heat_capacity_j_k : float
        Of the whole pack [J/K].
    heat_loss_w_k : float
        From the pack to the outside air [W/K].
    displayed_zero_soc : float
        State of charge at which the display shows 0 [1].
    displayed_full_soc : float
        State of charge at which the display shows 1 [1].

    Examples
    --------
    >>> from tripwatt.vehicles import load_vehicle
    >>> battery = load_vehicle("bmw_i3_60ah").battery
    >>> soc = battery.soc_from_displayed(0.5)
    >>> round(battery.displayed_from_soc(soc), 3)
    0.5
    """

    capacity_ah: float = quantity("Ah", 1.0, 2_000.0, scaled=True)
    cells_in_series: float = quantity("1", 1.0, 1_000.0)
    ocv_soc: tuple[float, ...] = quantity("1", 0.0, 1.0)
    ocv_v: tuple[float, ...] = quantity("V", 1.0, 5.0)
    resistance_soc: tuple[float, ...] = quantity("1", 0.0, 1.0)
    resistance_ohm: tuple[float, ...] = quantity("ohm", 0.0, 0.5)
    resistance_temperature_degc: float = quantity("degC", -20.0, 60.0)
    resistance_activation_energy_j_mol: float = quantity("J/mol", 0.0, 100_000.0)
    min_cell_voltage_v: float = quantity("V", 0.5, 4.0)
    max_cell_voltage_v: float = quantity("V", 1.0, 6.0)
    heat_capacity_j_k: float = quantity("J/K", 1e3, 1e8)
    heat_loss_w_k: float = quantity("W/K", 0.0, 1e3)
    displayed_zero_soc: float = quantity("1", 0.0, 0.5)
    displayed_full_soc: float = quantity("1", 0.5, 1.0)

    def soc_from_displayed(self, displayed_soc: Number) -> Number:
        """Convert the displayed state of charge to that of the battery management.

        Parameters
        ----------
        displayed_soc : float or ndarray
            Displayed state of charge, 0 to 1.

        Returns
        -------
        float or ndarray
            State of charge of the battery management, shape of `displayed_soc`.
        """
        return self.displayed_zero_soc + displayed_soc * (self.displayed_full_soc - self.displayed_zero_soc)

    def displayed_from_soc(self, soc: Number) -> Number:
        """Convert the state of charge of the battery management to the displayed one.

        Parameters
        ----------
        soc : float or ndarray
            State of charge of the battery management, 0 to 1.

        Returns
        -------
        float or ndarray
            Displayed state of charge, shape of `soc`; not clipped.
        """
        return (soc - self.displayed_zero_soc) / (self.displayed_full_soc - self.displayed_zero_soc)


@dataclass(frozen=True, slots=True)
class Auxiliaries:
    """Loads on the battery that neither drive nor heat.

    Attributes
    ----------
    base_load_w : float
        Computers, pumps, display, at standstill and on a dynamometer [W].
    moving_load_w : float
        What comes on top while the car moves on a road: lights, steering, brakes, fans [W].

    Examples
    --------
    >>> Auxiliaries(base_load_w=300.0).base_load_w
    300.0
    """

    base_load_w: float = quantity("W", 0.0, 20_000.0)
    moving_load_w: float = quantity("W", 0.0, 20_000.0, default=0.0)


@dataclass(frozen=True, slots=True)
class Charging:
    """Power that the car takes from a charging station.

    Attributes
    ----------
    displayed_soc : tuple of float
        Displayed state of charge of the powers [1].
    power_w : tuple of float
        Largest power with direct current over displayed_soc [W].
    alternating_power_w : float
        Largest power of the on-board charger [W].
    """

    displayed_soc: tuple[float, ...] = quantity("1", 0.0, 1.0)
    power_w: tuple[float, ...] = quantity("W", 1.0, 2e6)
    alternating_power_w: float = quantity("W", 500.0, 200_000.0)


@dataclass(frozen=True, slots=True)
class Climate:
    """Cabin, heater, air conditioner and their control, see `tripwatt.physics.cabin`.

    Attributes
    ----------
    air_heat_capacity_j_k : float
        Cabin air and what follows it at once [J/K].
    interior_heat_capacity_j_k : float
        Seats, trim and glass [J/K].
    interior_exchange_w_k : float
        Between cabin air and interior [W/K].
    shell_w_k : float
        Through the shell to the outside air at standstill [W/K].
    shell_per_speed_w_s_k_m : float
        More of it for each m/s [W s/(K m)].
    fresh_air_low_w_k : float
        Heat flow of the outside air, blower low [W/K].
    fresh_air_high_w_k : float
        Heat flow of the outside air, blower high [W/K].
    solar_aperture_m2 : float
        Solar heat in the cabin over horizontal irradiance [m2].
    solar_share_to_air : float
        Part of the solar heat that warms the air at once [1].
    occupant_heat_w : float
        Heat of the people inside [W].
    heater_max_heat_w : float
        Largest heat of heater and heat pump together, 0 for none [W].
    heater_efficiency : float
        Heat in the cabin over electric power, resistive heater [1].
    heat_pump_max_heat_w : float
        Largest heat of the heat pump at 7 degC outside, 0 for none [W].
    heat_pump_cop_at_0_degc : float
        Heat over electric power at 0 degC outside [1].
    heat_pump_cop_per_k : float
        Rise of it for each kelvin of warmer air [1/K].
    cooler_max_heat_w : float
        Largest sensible heat the air conditioner removes [W].
    cooler_cop : float
        Sensible heat removed over electric power [1].
    blower_low_power_w : float
        Blower, fans and pumps of the climate control, low [W].
    blower_high_power_w : float
        The same at full demand [W].
    control_time_s : float
        Time constant of the approach to the set-point [s].
    setpoint_degc : float
        Set-point when the driver's is unknown [°C].
    defrost_power_w : float
        Heated windows and seats after a cold start [W].
    defrost_time_s : float
        How long they are on [s].
    defrost_below_degc : float
        Outside air below which they are used [°C].
    sensor_minimum_degc : float
        A cabin sensor shows nothing below this [°C].
    compressor_idle_w : float
        Least power of the compressor while it cools [W].

    Examples
    --------
    >>> from tripwatt.vehicles import load_vehicle
    >>> load_vehicle("bmw_i3_60ah").climate.setpoint_degc
    22.0
    """

    air_heat_capacity_j_k: float = quantity("J/K", 500.0, 1e6)
    interior_heat_capacity_j_k: float = quantity("J/K", 1e3, 1e7)
    interior_exchange_w_k: float = quantity("W/K", 0.0, 2_000.0)
    shell_w_k: float = quantity("W/K", 0.0, 1_000.0)
    shell_per_speed_w_s_k_m: float = quantity("W s/(K m)", 0.0, 20.0)
    fresh_air_low_w_k: float = quantity("W/K", 0.0, 1_000.0)
    fresh_air_high_w_k: float = quantity("W/K", 0.0, 2_000.0)
    solar_aperture_m2: float = quantity("m2", 0.0, 20.0)
    solar_share_to_air: float = quantity("1", 0.0, 1.0)
    occupant_heat_w: float = quantity("W", 0.0, 10_000.0)
    heater_max_heat_w: float = quantity("W", 0.0, 60_000.0)
    heater_efficiency: float = quantity("1", 0.3, 1.0)
    heat_pump_max_heat_w: float = quantity("W", 0.0, 60_000.0)
    heat_pump_cop_at_0_degc: float = quantity("1", 1.0, 6.0)
    heat_pump_cop_per_k: float = quantity("1/K", 0.0, 0.5)
    cooler_max_heat_w: float = quantity("W", 100.0, 60_000.0)
    cooler_cop: float = quantity("1", 0.5, 6.0)
    blower_low_power_w: float = quantity("W", 0.0, 5_000.0)
    blower_high_power_w: float = quantity("W", 0.0, 10_000.0)
    control_time_s: float = quantity("s", 1.0, 3_600.0)
    setpoint_degc: float = quantity("degC", 10.0, 32.0)
    defrost_power_w: float = quantity("W", 0.0, 5_000.0)
    defrost_time_s: float = quantity("s", 0.0, 7_200.0)
    defrost_below_degc: float = quantity("degC", -40.0, 20.0)
    sensor_minimum_degc: float = quantity("degC", -60.0, 30.0)
    compressor_idle_w: float = quantity("W", 0.0, 2_000.0, default=0.0)
