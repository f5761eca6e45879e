/** Loggers as they call themselves, in every language. */

export const LOGGERS = {
  abrp: "ABRP",
  car_scanner: "Car Scanner",
  leaf_spy: "Leaf Spy",
  ovms: "OVMS",
  ovms_log: "OVMS",
  owntracks: "OwnTracks",
  teslalogger: "TeslaLogger",
  teslamate: "TeslaMate",
  torque: "Torque",
};
