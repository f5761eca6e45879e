/** A planned road to try the page with, made up: through a town, over land, over a motorway with a hill, and into a town. */
export const SAMPLE_LINKS = `[
  {"length_m": 1800, "speed_m_s": 8.5, "start_elevation_m": 510, "end_elevation_m": 515},
  {"length_m": 2400, "speed_m_s": 12, "start_elevation_m": 515, "end_elevation_m": 528},
  {"length_m": 6200, "speed_m_s": 22, "stop_s": 0, "start_elevation_m": 528, "end_elevation_m": 560},
  {"length_m": 14000, "speed_m_s": 33.3, "stop_s": 0, "start_elevation_m": 560, "end_elevation_m": 655},
  {"length_m": 9000, "speed_m_s": 33.3, "stop_s": 0, "start_elevation_m": 655, "end_elevation_m": 780},
  {"length_m": 12500, "speed_m_s": 33.3, "stop_s": 0, "start_elevation_m": 780, "end_elevation_m": 610},
  {"length_m": 11000, "speed_m_s": 30.5, "stop_s": 0, "start_elevation_m": 610, "end_elevation_m": 540},
  {"length_m": 5200, "speed_m_s": 19.5, "stop_s": 0, "start_elevation_m": 540, "end_elevation_m": 498},
  {"length_m": 2600, "speed_m_s": 9.5, "stop_s": 30, "start_elevation_m": 498, "end_elevation_m": 490}
]`;
