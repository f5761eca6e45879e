/** Kinds of road, written by `tools/docs/write_page_flags.py` from `journey/kinds.py`. Do not edit. */

export const ROADS = {
  "speeds_m_s": {
    "town": 5.423433298125668,
    "country": 14.36218020189591,
    "motorway": 31.21043580354354
  },
  "shares": {
    "town": {
      "town": 1.0,
      "country": 0.0,
      "motorway": 0.0
    },
    "country": {
      "town": 0.25,
      "country": 0.75,
      "motorway": 0.0
    },
    "motorway": {
      "town": 0.1,
      "country": 0.15,
      "motorway": 0.75
    },
    "mixed": {
      "town": 0.2875717560851479,
      "country": 0.5195863745614852,
      "motorway": 0.19284186935336697
    }
  },
  "town_m": 15000.0
};
