// From a plan to the drive: node afternoon.mjs http://127.0.0.1:8000 Westend Ostheim   (Node 20 or newer, no packages)
// The service has a map and a folder of cars; with a token of its own, TRIPWATT_TOKEN is in the environment.
const [service, ...stops] = process.argv.slice(2);
const own = process.env.TRIPWATT_TOKEN ? { Authorization: `Bearer ${process.env.TRIPWATT_TOKEN}` } : {};
const JSON_TYPE = { "Content-Type": "application/json" };

async function call(method, path, body, headers = own) {
  const json = body !== undefined && !(body instanceof URLSearchParams);
  const answer = await fetch(service + path, {
    method,
    headers: { ...headers, ...(json ? JSON_TYPE : {}) },
    body: json ? JSON.stringify(body) : body,
  });
  const document = await answer.json();
  if (answer.ok) return document;
  const faults = (document.faults ?? []).map((one) => `${one.where}: ${one.what}, ${one.got} (${one.allowed ?? one.fix})`);
  throw new Error([`${method} ${path}: ${document.title}`, document.detail, ...faults].filter(Boolean).join("\n  "));
}

// five ways in which a car sends one message
const DOORS = {
  field: (token, tlm) => call("POST", "/v1/telemetry", { token, tlm }, {}),
  bearer: (token, tlm) => call("POST", "/v1/telemetry", tlm, { Authorization: `Bearer ${token}` }),
  query: (token, tlm) => call("POST", `/v1/telemetry?token=${token}`, { tlm }, {}),
  form: (token, tlm) => call("POST", "/v1/telemetry", new URLSearchParams({ token, tlm: JSON.stringify(tlm) }), {}),
  address: (token, tlm) => call("GET", `/v1/telemetry?${new URLSearchParams({ token, tlm: JSON.stringify(tlm) })}`, undefined, {}),
};

// the latest state of every car, from the stream of events
const latest = {}, events = new AbortController();
async function watch() {
  const stream = await fetch(`${service}/v1/events`, { headers: own, signal: events.signal });
  let rest = "";
  for await (const part of stream.body.pipeThrough(new TextDecoderStream())) {
    const blocks = (rest + part).split("\n\n");
    rest = blocks.pop();
    for (const line of blocks.flatMap((block) => block.split("\n")).filter((one) => one.startsWith("data: "))) {
      const state = JSON.parse(line.slice(6));
      latest[state.car] = state;
    }
  }
}

// a recorded drive as messages, one every 5 s; the last message is of now
const [{ trip, car }] = (await call("GET", "/v1/examples")).examples;
const { request, observed } = await call("GET", `/v1/examples/${trip}`);
const begins = Date.now() / 1000 - observed.time_s.at(-1);
const power = observed.voltage_v.map((volts, k) => (volts * observed.current_a[k]) / 1000);
const messages = observed.time_s.flatMap((time, k) =>
  time % 5 ? [] : [{ utc: begins + time, speed: 3.6 * request.samples.speed_m_s[k], power: power[k], ext_temp: 25.5 }],
);

// the plan: a journey, and what to do about it
const departure = { soc: 0.17, ambient_temperature_degc: 25.5 };
const journey = await call("POST", "/v1/journeys", { stops, car, departure });
const advice = await call("POST", "/v1/journeys/advice", { stops, car, departure });
const least = advice.least.map((one) => one.actions.map((action) => action.code));

// the drive: a car for each door, with the road of the journey as its plan
const watching = watch().catch((error) => { if (error.name !== "AbortError") throw error; });
const names = Object.entries(DOORS).map(async ([door, send]) => {
  const { name } = await call("POST", "/v1/cars", { name: `by ${door}`, car });
  const { token } = await call("POST", `/v1/cars/${name}/token`);
  await call("PUT", `/v1/live/${name}/plan`, { route: journey, destination: stops.at(-1), departure });
  for (const message of messages) await send(token, message);
  return name;
});
const cars = [];
for (const name of await Promise.all(names)) {
  const measured = (await call("GET", `/v1/live/${name}`)).forecast.measured_until_s;
  while (latest[name]?.forecast?.measured_until_s !== measured) await new Promise((seen) => setTimeout(seen, 100));
  const { trip, forecast, message, faults } = latest[name];
  const need = await call("GET", `/v1/need?car=${name}`);
  cars.push({ name, energy_wh: trip.energy_wh, p_arrive: forecast.p_arrive, message, faults, need: need.message });
}
events.abort();
await watching;
console.log(JSON.stringify({ leave: journey.leave, charge_to: advice.charge_to, least, cars }, null, 2));
