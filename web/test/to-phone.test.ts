/** Addresses for another device. */

import assert from "node:assert/strict";
import { describe, test } from "node:test";
import { isOnlyHere, senderAddress, serviceAddress, viewAddress, viewFrom } from "../src/model/to-phone";

const SERVICES = [
  "http://car.example:8000/",
  "https://host.example/tripwatt/",
  "https://host.example/tripwatt",
];

describe("addresses for another device", () => {
  test("what a phone reads is what was meant, under any path and with any token", () => {
    for (const typed of SERVICES) {
      for (const token of ["", "a b&c=#+é"]) {
        const address = viewAddress(serviceAddress(typed) as URL, "my-leaf", token);
        assert.deepEqual(viewFrom(new URL(address).hash), { car: "my-leaf", token });
        assert.ok(address.startsWith(typed.replace(/\/?$/, "/#")), address);
      }
    }
  });

  test("a sender gets the path of messages and the token of its car", () => {
    for (const typed of SERVICES) {
      const address = new URL(senderAddress(serviceAddress(typed) as URL, "a+b c"));
      assert.ok(address.pathname.endsWith("/v1/telemetry"));
      assert.equal(address.pathname.startsWith("/tripwatt/"), typed.includes("tripwatt"));
      assert.equal(address.searchParams.get("token"), "a+b c");
    }
  });

  test("an address of this device alone is no address for a phone", () => {
    for (const typed of ["localhost:8000", "http://127.0.0.1:8000/", "http://[::1]/", "a.localhost"]) {
      assert.ok(isOnlyHere(serviceAddress(typed) as URL), typed);
    }
    for (const typed of ["192.0.2.7:8000", "https://localhost.example"]) {
      assert.ok(!isOnlyHere(serviceAddress(typed) as URL), typed);
    }
    assert.equal(serviceAddress(""), null);
    assert.equal(viewFrom("#trip=abc"), null);
  });
});
