/** The fields of a departure, written by `types.mjs` from the OpenAPI document of the service. Do not edit. */

export const FIELDS = {
  soc: {"unit":"","minimum":0,"maximum":1},
  ambient_temperature_degc: {"unit":"°C","minimum":-60,"maximum":57},
  cabin_setpoint_degc: {"unit":"°C","minimum":0,"maximum":50},
  cabin_temperature_degc: {"unit":"°C","minimum":-60,"maximum":100},
  battery_temperature_degc: {"unit":"°C","minimum":-60,"maximum":100},
  payload_mass_kg: {"unit":"kg","minimum":0,"maximum":60000},
  climate: {"choices":["auto","off","heat","cool"]},
  extras: {"choices":["winter_tyres","roof_box","trailer","headlights","heated_seats"],"several":true},
  terrain: {"choices":["unknown","flat","hilly","mountains"]},
  wind_speed_m_s: {"unit":"m/s","minimum":0,"maximum":60},
  wind_from_deg: {"unit":"°","minimum":0,"maximum":360},
  rain_mm_h: {"unit":"mm/h","minimum":0,"maximum":200},
  pressure_pa: {"unit":"Pa","minimum":30000,"maximum":110000},
  tyre_pressure: {"unit":"","minimum":0.5,"maximum":1.5},
} as const;
