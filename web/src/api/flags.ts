/** Words of flags, written by `tools/docs/write_page_flags.py` from `trips/flags.toml`. Do not edit. */

import type { FieldName } from "../model/fields";

/** One text, or texts by subject, unit, step or plural of a flag. */
export type Words = string | Readonly<Record<string, string>>;

interface Rule {
  severity?: Words;
  steps?: Readonly<Record<string, number>>;
  with?: string;
}

type Language = "en" | "de";

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

export const WORDS: Readonly<Record<Language, Readonly<Record<string, Readonly<Record<string, Words>>>>>> = {
  "en": {
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
  },
  "de": {
    "outside_training": {
      "text": "{parts} {are} {how} außerhalb des Bereichs der gemessenen Fahrten.",
      "part": "{name}",
      "are": {
        "one": "liegt",
        "other": "liegen"
      },
      "how": {
        "slight": "knapp",
        "clear": "deutlich",
        "other": "weit"
      },
      "effect": "Das Intervall ist deshalb breiter."
    },
    "usual_value_assumed": {
      "text": "Nicht angegeben und daher angenommen: {parts}.",
      "part": "{name} ({temperature})",
      "effect": "Das Intervall ist deshalb breiter."
    },
    "soc_assumed": {
      "text": "Der Ladestand bei Abfahrt ist nicht angegeben; angenommen werden {percent}."
    },
    "no_trips_of_car": {
      "text": "Das Modell wurde ohne Fahrten dieses Fahrzeugs trainiert. Die Prognose verwendet veröffentlichte Fahrzeugdaten und Fahrten eines anderen Fahrzeugs: {subject}.",
      "effect": "Das Intervall ist deshalb breiter."
    },
    "changed_car": {
      "text": "Die Fahrten des Modells waren von einem Fahrzeug mit anderen Werten: {parts}.",
      "part": {
        "others": "{number} weitere",
        "other": "{subject} {new} statt {old}"
      },
      "effect": "Das Intervall ist deshalb breiter."
    },
    "outside_classes": {
      "text": "Kein Fahrzeug der Bibliothek ist so {weight} wie {number} kg.",
      "weight": {
        "lighter": "leicht",
        "other": "schwer"
      },
      "effect": "Der Rest des Fahrzeugs ist aus der nächsten Klasse hochgerechnet; das Intervall ist breiter."
    },
    "no_elevation": {
      "text": "Die Höhen der Route sind unbekannt."
    },
    "unknown_climb": {
      "text": "Die Höhen der Straße sind unbekannt. Der Bereich lässt den Anstieg einer Straße {country} zu. Je {hundred_metres} Anstieg werden {points} der Ladung gebraucht.",
      "country": {
        "flat": "in flachem Gelände",
        "hilly": "in hügeligem Gelände",
        "mountains": "im Gebirge",
        "other": "in unbekanntem Gelände"
      }
    },
    "wind_direction_unknown": {
      "text": "Die Richtung des Windes von {speed} zur Straße ist unbekannt.",
      "effect": "Das Intervall ist deshalb breiter."
    },
    "free_flow_times": {
      "text": "Die Fahrzeiten gelten für eine leere Straße; der übliche Zeitverlust ist nach den Fahrten des Modells ergänzt."
    },
    "travel_time_error_unknown": {
      "text": "Das Modell kennt den Fehler der Fahrzeiten nicht.",
      "effect": "Das Intervall ist zu schmal."
    },
    "no_stations": {
      "text": "Auf dieser Karte sind keine Ladestationen bekannt."
    },
    "no_stop_found": {
      "text": "Mit keinen Ladestopps am Weg kommt die Fahrt zu 95 % an."
    },
    "class_charging_curve": {
      "text": "Die Ladekurve des Fahrzeugs ist unbekannt; die eines Mittelklassewagens wird angenommen."
    },
    "plugs_assumed": {
      "text": "Die Stecker des Fahrzeugs sind unbekannt; die in der Region üblichen werden angenommen, und Stationen ohne einen davon bleiben weg."
    },
    "plugs_unknown": {
      "text": "Die Stecker einer Station am Weg sind unbekannt; sie passt vermutlich zum Fahrzeug."
    },
    "cold_charging_assumed": {
      "text": "Wie langsam das Fahrzeug mit kalter Batterie lädt, ist unbekannt; der Leistungsverlust eines Modells wird angenommen."
    },
    "map_ends": {
      "text": "Die Karte endet vor der Ladung; die Reichweite ist größer als gezeigt."
    },
    "route_error_unknown": {
      "text": "Das Modell hat keine Schätzung für den Fehler einer geplanten Route.",
      "effect": "Das Intervall ist zu schmal."
    },
    "links_too_long": {
      "text": "Die Straßenabschnitte sind im Mittel {distance} lang, länger als die, von denen der Fehler geplanter Straßen bekannt ist.",
      "effect": "Das Intervall kann zu schmal sein."
    },
    "motor_torque_limit": {
      "text": "Das Fahrzeug kann dem Geschwindigkeitsverlauf nicht folgen: {parts}.",
      "part": "{span} an der Drehmomentgrenze des Motors",
      "effect": "Die Prognose rechnet dort mit der höchsten erreichbaren Geschwindigkeit."
    },
    "motor_power_limit": {
      "part": "{span} an der Leistungsgrenze des Motors"
    },
    "motor_speed_limit": {
      "part": "{span} an der Drehzahlgrenze des Motors"
    },
    "battery_voltage_floor": {
      "part": "{span} an der unteren Spannungsgrenze der Batterie"
    },
    "battery_empty": {
      "text": "Die Fahrt braucht {kwh} mehr, als die Batterie enthält. Die Batterie ist vor dem Ziel leer."
    },
    "battery_full": {
      "text": "Die Batterie ist zu voll für {kwh} aus der Rekuperation. Die Reibungsbremsen nehmen sie auf."
    },
    "battery_over_voltage": {
      "text": "Die Batteriespannung ist für {span} zu hoch für die Rekuperation."
    },
    "battery_not_settled": {
      "text": "Die Simulation der Batterie ist nicht konvergiert.",
      "effect": "Die Prognose kann ungenau sein."
    },
    "file_value_kept": {
      "text": "Aus der Datei übernommen: {name}, {temperature}."
    },
    "elevation_interpolated": {
      "text": "Einigen Punkten fehlt die Höhe; sie wird interpoliert."
    },
    "elevation_relative": {
      "text": "Die Höhe ist relativ: Für den tiefsten Punkt der Strecke werden 0 m angenommen."
    },
    "times_interpolated": {
      "text": "Einigen Punkten fehlt die Zeit; sie wird interpoliert."
    },
    "gap_bridged": {
      "text": "In der Aufzeichnung fehlen Stücke; die Geschwindigkeit ist dort interpoliert."
    },
    "times_ignored": {
      "text": "Dem ersten oder letzten Punkt fehlt die Zeit; alle Zeiten werden ignoriert."
    },
    "speed_assumed": {
      "text": "Teilen des Tracks fehlt die Geschwindigkeit; angenommen werden {speed}."
    },
    "first_of_several": {
      "text": {
        "routes": "Die Datei enthält {number} Routen; verwendet wird die erste.",
        "other": "Die Datei enthält {number} Tracks und Routen; verwendet wird der erste Eintrag."
      }
    },
    "geometries_skipped": {
      "text": {
        "one": "{number} Geometrie ist keine Linie und wird ausgelassen.",
        "other": "{number} Geometrien sind keine Linien und werden ausgelassen."
      }
    }
  }
};

export const NAMES: Readonly<Record<Language, Readonly<Record<FieldName, string> & Record<string, string>>>> = {
  "en": {
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
    "duration_s": "the duration",
    "trip_speed_m_s": "the mean speed"
  },
  "de": {
    "soc": "der Ladestand bei Abfahrt",
    "ambient_temperature_degc": "die Außentemperatur",
    "cabin_setpoint_degc": "die Solltemperatur im Innenraum",
    "cabin_temperature_degc": "die Innenraumtemperatur bei Abfahrt",
    "battery_temperature_degc": "die Batterietemperatur bei Abfahrt",
    "payload_mass_kg": "die Zuladung",
    "climate": "die Klimatisierung",
    "extras": "die Ausrüstung",
    "terrain": "das Gelände",
    "wind_speed_m_s": "der Wind",
    "wind_from_deg": "die Windrichtung",
    "rain_mm_h": "der Regen",
    "pressure_pa": "der Luftdruck",
    "duration_s": "die Fahrzeit",
    "trip_speed_m_s": "die mittlere Geschwindigkeit"
  }
};
