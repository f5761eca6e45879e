/** Words of flags, written by `tools/docs/write_page_flags.py` from `trips/flags.toml`. Do not edit. */

import type { FieldName } from "../model/fields";

/** One text, or texts by subject, unit, step or plural of a flag. */
export type Words = string | Readonly<Record<string, string>>;
export type WordsOfFlags = Readonly<Record<string, Readonly<Record<string, Words>>>>;
export type NamesOfFields = Readonly<Record<FieldName, string> & Record<string, string>>;

interface Rule {
  severity?: Words;
  steps?: Readonly<Record<string, number>>;
  with?: string;
}

export const FLAGS: Readonly<Record<string, Rule>> = {
  "outside_training": {
    "severity": {
      "slight": "note",
      "other": "caution"
    },
    "steps": {
      "slight": 0,
      "clear": 1,
      "far": 3
    }
  },
  "usual_value_assumed": {},
  "of_last_message": {},
  "no_description": {
    "severity": "caution"
  },
  "soc_assumed": {},
  "no_trips_of_car": {
    "severity": "caution"
  },
  "changed_car": {
    "severity": "caution"
  },
  "outside_classes": {
    "severity": "caution"
  },
  "no_elevation": {},
  "unknown_climb": {
    "severity": {
      "flat": "note",
      "other": "caution"
    }
  },
  "wind_direction_unknown": {},
  "free_flow_times": {},
  "travel_time_error_unknown": {},
  "no_stations": {},
  "no_stop_found": {},
  "class_charging_curve": {},
  "plugs_assumed": {},
  "plugs_unknown": {},
  "cold_charging_assumed": {},
  "map_ends": {},
  "route_error_unknown": {
    "severity": "caution"
  },
  "links_too_long": {},
  "motor_torque_limit": {
    "severity": "caution"
  },
  "motor_power_limit": {
    "with": "motor_torque_limit"
  },
  "motor_speed_limit": {
    "with": "motor_torque_limit"
  },
  "battery_voltage_floor": {
    "with": "motor_torque_limit"
  },
  "battery_empty": {
    "severity": "warning"
  },
  "battery_full": {},
  "battery_over_voltage": {},
  "battery_not_settled": {
    "severity": "caution"
  },
  "file_value_kept": {},
  "elevation_interpolated": {},
  "elevation_relative": {},
  "times_interpolated": {},
  "gap_bridged": {},
  "times_ignored": {},
  "speed_assumed": {},
  "first_of_several": {},
  "geometries_skipped": {}
};

export const WORDS: WordsOfFlags = {
  "outside_training": {
    "text": "{parts} {are} {how} outside the range of the trips that were measured.",
    "part": "{name}",
    "are": {
      "one": "is",
      "other": "are"
    },
    "how": {
      "slight": "slightly",
      "clear": "well",
      "other": "far"
    },
    "effect": "The interval is wider as a result."
  },
  "usual_value_assumed": {
    "text": "Not given, and assumed: {parts}.",
    "part": "{name} ({temperature})",
    "effect": "The interval is wider as a result."
  },
  "of_last_message": {
    "text": "Taken from the car's last message: {parts}.",
    "part": "{name} ({temperature})"
  },
  "no_description": {
    "text": "This car has no description: {subject} is assumed. Describe it with “Add a car”."
  },
  "soc_assumed": {
    "text": "The battery charge at departure is not given; {percent} is assumed."
  },
  "no_trips_of_car": {
    "text": "The model was trained without trips of this car. The forecast uses published vehicle data and what was learned from trips of a {subject}.",
    "effect": "The interval is wider as a result."
  },
  "changed_car": {
    "text": "The trips of the model were of a car with other values: {parts}.",
    "part": {
      "others": "{number} more",
      "other": "{subject} {new} in place of {old}"
    },
    "effect": "The interval is wider as a result."
  },
  "outside_classes": {
    "text": "No car of the library is as {weight} as {number} kg.",
    "weight": {
      "lighter": "light",
      "other": "heavy"
    },
    "effect": "The rest of the car is extrapolated from the nearest class; the interval is wider."
  },
  "no_elevation": {
    "text": "The heights of the route are unknown."
  },
  "unknown_climb": {
    "text": "The heights of the road are unknown. The range allows for the climb of a road {country}. Each {hundred_metres} of climb takes {points} of charge.",
    "country": {
      "flat": "in flat country",
      "hilly": "in hilly country",
      "mountains": "in the mountains",
      "other": "of which nothing is known"
    }
  },
  "wind_direction_unknown": {
    "text": "The direction of the wind of {speed} along the road is unknown.",
    "effect": "The interval is wider as a result."
  },
  "free_flow_times": {
    "text": "The travel times are those of an empty road; the usual loss of time is added from the trips of the model."
  },
  "travel_time_error_unknown": {
    "text": "The model has no estimate of the error of travel times.",
    "effect": "The interval is too narrow."
  },
  "no_stations": {
    "text": "No charging stations are known on this map."
  },
  "no_stop_found": {
    "text": "No charging stops on the way make the journey arrive with 95 %."
  },
  "class_charging_curve": {
    "text": "The charging curve of the car is not known; that of a middle-class car is assumed."
  },
  "plugs_assumed": {
    "text": "The plugs of the car are not known; those usual for such cars in the region are assumed, and stations without one are left out."
  },
  "plugs_unknown": {
    "text": "The plugs of a station on the way are not known; it is taken to fit the car."
  },
  "cold_charging_assumed": {
    "text": "How slowly the car charges with a cold battery is not known; the loss of power of one model of car is assumed."
  },
  "map_ends": {
    "text": "The map ends before the charge; the area of reach is larger than shown."
  },
  "route_error_unknown": {
    "text": "The model has no estimate of the error of a planned route.",
    "effect": "The interval is too narrow."
  },
  "links_too_long": {
    "text": "The sections of the road are {distance} long on average, longer than those from which the error of planned roads is known.",
    "effect": "The interval may be too narrow."
  },
  "motor_torque_limit": {
    "text": "The car cannot follow the speed trace: {parts}.",
    "part": "motor torque limit for {span}",
    "effect": "The forecast assumes the highest speed that the car reaches."
  },
  "motor_power_limit": {
    "part": "motor power limit for {span}"
  },
  "motor_speed_limit": {
    "part": "motor speed limit for {span}"
  },
  "battery_voltage_floor": {
    "part": "lowest battery voltage for {span}"
  },
  "battery_empty": {
    "text": "The trip takes {kwh} more than the battery holds. The battery is empty before the end."
  },
  "battery_full": {
    "text": "The battery is too full for {kwh} of recovered energy. The friction brakes take it."
  },
  "battery_over_voltage": {
    "text": "The battery voltage is too high for regenerative braking for {span}."
  },
  "battery_not_settled": {
    "text": "The battery simulation did not converge.",
    "effect": "The forecast may be inaccurate."
  },
  "file_value_kept": {
    "text": "The value in the file is used for {name}: {temperature}."
  },
  "elevation_interpolated": {
    "text": "Some points have no elevation; their elevation is interpolated."
  },
  "elevation_relative": {
    "text": "The elevation is relative: the lowest place of the road is taken as 0 m."
  },
  "times_interpolated": {
    "text": "Some points have no time; their time is interpolated."
  },
  "gap_bridged": {
    "text": "Parts of the recording are missing; the speed is interpolated there."
  },
  "times_ignored": {
    "text": "The first or the last point has no time; all times are ignored."
  },
  "speed_assumed": {
    "text": "Parts of the track have no speed; {speed} is assumed."
  },
  "first_of_several": {
    "text": {
      "routes": "The file has {number} routes; the first is used.",
      "other": "The file has {number} tracks and routes; the first is used."
    }
  },
  "geometries_skipped": {
    "text": {
      "one": "{number} geometry is not a line and is left out.",
      "other": "{number} geometries are not lines and are left out."
    }
  }
};

export const NAMES: NamesOfFields = {
  "soc": "the battery charge at departure",
  "ambient_temperature_degc": "the outside temperature",
  "cabin_setpoint_degc": "the cabin set-point",
  "cabin_temperature_degc": "the cabin temperature at departure",
  "battery_temperature_degc": "the battery temperature at departure",
  "payload_mass_kg": "the load",
  "climate": "the climate control",
  "extras": "the extras",
  "terrain": "the terrain",
  "wind_speed_m_s": "the wind",
  "wind_from_deg": "the direction of the wind",
  "rain_mm_h": "the rain",
  "pressure_pa": "the air pressure",
  "tyre_pressure": "the tyre pressure",
  "duration_s": "the duration",
  "trip_speed_m_s": "the mean speed"
};
