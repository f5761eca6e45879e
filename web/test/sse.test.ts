/** Server-sent events out of the parts of a stream. */

import assert from "node:assert/strict";
import { describe, test } from "node:test";
import { EventParser } from "../src/model/sse";

describe("server-sent events", () => {
  test("an event may come in parts, and several in one", () => {
    const parser = new EventParser();
    assert.deepEqual(parser.take('event: live\ndata: {"a"'), []);
    assert.deepEqual(parser.take(":1}\n"), []);
    assert.deepEqual(parser.take('\nevent: live\ndata: {"a":2}\n\ndata: 3\n\nda'), [
      '{"a":1}',
      '{"a":2}',
      "3",
    ]);
    assert.deepEqual(parser.take("ta: 4\n\n"), ["4"]);
  });

  test("comments have no data, lines of data are joined, ends of lines may be those of other systems", () => {
    const parser = new EventParser();
    assert.deepEqual(parser.take(": no news\n\n"), []);
    assert.deepEqual(parser.take("data: one\r\ndata:two\r\n\r\n"), ["one\ntwo"]);
  });

  test("an event without an end has a bound", () => {
    const parser = new EventParser();
    const part = "x".repeat(400_000);
    assert.deepEqual(parser.take(`data: ${part}`), []);
    assert.deepEqual(parser.take(part), []);
    assert.throws(() => parser.take(part), RangeError);
  });
});
