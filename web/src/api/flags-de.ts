/** Words of flags, written by `tools/docs/write_page_flags.py` from `trips/flags.toml`. Do not edit. */

import type { NamesOfFields, WordsOfFlags } from "./flags";

export const WORDS: WordsOfFlags = {
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
  "of_last_message": {
    "text": "Aus der letzten Nachricht des Autos: {parts}.",
    "part": "{name} ({temperature})"
  },
  "no_description": {
    "text": "Dieses Auto ist nicht beschrieben: Angenommen wird {subject}. Beschreiben Sie es mit „Auto hinzufügen“."
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
};

export const NAMES: NamesOfFields = {
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
  "tyre_pressure": "der Reifendruck",
  "duration_s": "die Fahrzeit",
  "trip_speed_m_s": "die mittlere Geschwindigkeit"
};
