/** A road with speeds as links. */

import assert from "node:assert/strict";
import { describe, test } from "node:test";
import { profileFromSamples } from "../src/model/profile";
import { linksOfProfile } from "../src/model/road-links";

describe("links of a road", () => {
  const time_s = Array.from({ length: 121 }, (_, k) => k);
  const speed_m_s = time_s.map((t) => (t > 50 && t <= 70 ? 0 : 10));
  const elevation_m = time_s.map((t) => 100 + t);

  test("lengths and times add up to the road, stops are told, and the height is that of the ends", () => {
    const profile = profileFromSamples({ time_s, speed_m_s, elevation_m });
    const { links, elevation } = linksOfProfile(profile);
    const sum = (name: "length_m" | "travel_time_s" | "stop_s") =>
      links.reduce((total, link) => total + (link[name] ?? 0), 0);
    assert.equal(sum("length_m"), profile.distanceM.at(-1));
    assert.equal(sum("travel_time_s"), 120);
    assert.equal(sum("stop_s"), 20);
    assert.equal(links[0]?.length_m, 250);
    assert.equal(elevation?.position_m.length, links.length + 1);
    assert.deepEqual([elevation?.elevation_m[0], elevation?.elevation_m.at(-1)], [100, 220]);
  });

  test("a level road has no elevation, and no road no links", () => {
    assert.equal(linksOfProfile(profileFromSamples({ time_s, speed_m_s })).elevation, null);
    assert.deepEqual(linksOfProfile(profileFromSamples({})).links, []);
  });
});
