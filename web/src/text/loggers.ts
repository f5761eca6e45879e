/** Loggers as they call themselves, in every language. */

export const LOGGERS = {
  abrp: "ABRP",
  car_scanner: "Car Scanner",
  geotab: "Geotab",
  leaf_spy: "Leaf Spy",
  ovms: "OVMS",
  ovms_log: "OVMS",
  owntracks: "OwnTracks",
  samsara: "Samsara",
  teltonika: "Teltonika",
  tesla_fleet: "Tesla Fleet Telemetry",
  teslalogger: "TeslaLogger",
  teslamate: "TeslaMate",
  torque: "Torque",
};
