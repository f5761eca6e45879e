"""Requests to servers: time-outs, retries, bounds, and keys that nobody reads."""

import gzip
import json
import logging
import socket
import threading
import time

import httpx
import pytest
from tests.support.roads import client

from tripwatt.errors import Fault, InvalidInput, RemoteError
from tripwatt.routes import web
from tripwatt.routes.web import WebClient, as_remote, require_object, require_url


@pytest.mark.parametrize(
    "url",
    [
        "ftp://a",
        "a.b",
        "http://",
        "http://me:secret@host",
        "http://h?q=1",
        "http://h#a",
        "http://h:x",
        "http://h:65536",
        "",
    ],
)
def test_what_is_no_url_of_a_server_is_refused_without_its_password(url):
    with pytest.raises(InvalidInput, match="not the URL of a server: --router") as caught:
        require_url(url, "--router")
    assert "secret" not in str(caught.value)


def test_path_query_body_and_headers_are_sent():
    seen = []

    def answer(request):
        seen.append(request)
        return httpx.Response(200, json={"a": [1]})

    server = client(answer)
    assert server.post_json("/route", {"q": 1}) == {"a": [1]}
    assert server.get_json("/route", {"z": "2"}) == {"a": [1]}
    assert str(seen[1].url) == "http://router.test/base/route?z=2"
    assert json.loads(seen[0].content) == {"q": 1}
    assert (seen[0].method, seen[1].method, seen[1].content) == ("POST", "GET", b"")
    assert seen[0].headers["accept"] == "application/json"


def test_failures_that_pass_are_tried_three_times_with_longer_pauses():
    statuses, pauses = [503, 429, 200], []
    server = WebClient(
        "http://h",
        pause=pauses.append,
        transport=httpx.MockTransport(lambda request: httpx.Response(statuses.pop(0), json={})),
    )
    assert server.get_json("/x") == {}
    assert pauses == [0.2, 0.4]
    statuses += [502, 504, 503, 200]
    with pytest.raises(RemoteError, match=r"the server does not respond: h: got status 503; check the URL"):
        server.get_json("/x")
    assert statuses == [200]


def test_a_failure_that_stays_is_not_tried_again():
    calls = []

    def answer(request):
        calls.append(1)
        return httpx.Response(500, text="oops")

    with pytest.raises(RemoteError, match=r"the server failed: router.test: got status 500"):
        client(answer).get_json("/x")
    assert len(calls) == 1


def test_a_document_of_an_error_is_an_answer():
    found = client(lambda r: httpx.Response(500, json={"error": "no"})).request("GET", "/x")
    assert (found.status, json.loads(found.body)) == (500, {"error": "no"})
    assert client(lambda r: httpx.Response(400, json={"error": "no"})).get_json("/x") == {"error": "no"}


@pytest.mark.parametrize("status", [401, 403])
def test_a_refused_key_is_named_by_its_variable_and_never_shown(status, monkeypatch, caplog):
    monkeypatch.setenv("SOME_KEY", "s3cret")
    caplog.set_level(logging.DEBUG)
    server = client(
        lambda r: httpx.Response(status, text="s3cret"), key_variable="SOME_KEY", key_place="query:key"
    )
    with pytest.raises(RemoteError, match="set SOME_KEY to a valid key") as caught:
        server.get_json("/x")
    assert "s3cret" not in str(caught.value) + caplog.text + repr(server)


@pytest.mark.parametrize(("place", "there"), [("query:key", "query"), ("header:Authorization", "header")])
def test_the_key_is_sent_where_the_server_expects_it(place, there, monkeypatch):
    monkeypatch.setenv("SOME_KEY", " s3cret ")
    seen = []

    def answer(request):
        seen.append(request)
        return httpx.Response(200, json={})

    client(answer, key_variable="SOME_KEY", key_place=place).get_json("/x", {"a": "1"})
    assert (seen[0].url.params.get("key") == "s3cret") == (there == "query")
    assert (seen[0].headers.get("authorization") == "s3cret") == (there == "header")
    assert seen[0].url.params["a"] == "1"


def test_without_a_key_none_is_sent(monkeypatch):
    monkeypatch.delenv("SOME_KEY", raising=False)
    seen = []
    client(lambda r: seen.append(r) or httpx.Response(200, json={}), key_variable="SOME_KEY").get_json("/x")
    assert "authorization" not in seen[0].headers


@pytest.mark.parametrize("text", ["<html>", '{"a": NaN}', "", '{"a":'])
def test_what_is_no_json_is_refused(text):
    with pytest.raises(RemoteError, match=r"gives no JSON: router.test: got status 200"):
        client(lambda r: httpx.Response(200, text=text)).get_json("/x")


def test_a_fault_in_an_answer_is_the_servers():
    assert require_object({"a": 1}, "route")["a"].value == 1
    with pytest.raises(RemoteError, match=r"^not an object: route: got \[1\]; allowed: a JSON object$"):
        require_object([1], "route")
    for error in (RemoteError([Fault("a", "b")]), InvalidInput.of("a", "b")):
        with pytest.raises(RemoteError, match=r"^a: b$") as found, as_remote():
            raise error
        assert (found.value is error) == isinstance(error, RemoteError)


def test_answers_are_bounded_also_when_they_are_compressed(monkeypatch):
    monkeypatch.setattr(web, "MAX_ANSWER_BYTES", 1000)
    small = gzip.compress(b" " * 998 + b"{}")
    large = gzip.compress(b" " * 999 + b"{}")
    packed = {"content-encoding": "gzip"}
    assert client(lambda r: httpx.Response(200, content=small, headers=packed)).get_json("/x") == {}
    with pytest.raises(RemoteError, match="answer too large"):
        client(lambda r: httpx.Response(200, content=large, headers=packed)).get_json("/x")
    with pytest.raises(RemoteError, match="decoding failed"):
        client(lambda r: httpx.Response(200, content=b"no gzip", headers=packed)).get_json("/x")


def test_a_server_that_is_not_there_is_one_clear_error():
    with socket.socket() as unused:
        unused.bind(("127.0.0.1", 0))
        port = unused.getsockname()[1]
        with pytest.raises(RemoteError, match=f"does not respond: 127.0.0.1:{port}: got connect failed"):
            WebClient(f"http://127.0.0.1:{port}", pause=lambda s: None).get_json("/x")


@pytest.mark.parametrize("first", [b"", b"HTTP/1.1 200 OK\r\ncontent-length: 100\r\n\r\n{"])
def test_a_server_that_hangs_is_left_after_the_time_out(first):
    """Without an answer, and with one that comes a byte at a time and never ends."""
    stop = threading.Event()

    def hang(server):
        held = []
        while not stop.is_set():
            try:
                connection, _ = server.accept()
            except OSError:
                return
            held.append(connection)
            connection.sendall(first) if first else None
            for _ in range(60):
                if stop.wait(0.05):
                    return
                try:
                    connection.sendall(b" " if first else b"")
                except OSError:
                    break

    with socket.create_server(("127.0.0.1", 0)) as server:
        thread = threading.Thread(target=hang, args=(server,), daemon=True)
        thread.start()
        started = time.monotonic()
        slow = WebClient(f"http://127.0.0.1:{server.getsockname()[1]}", timeout_s=0.4, pause=lambda s: None)
        with pytest.raises(RemoteError, match=r"does not respond: 127.0.0.1:\d+: got no answer within 0.4 s"):
            slow.get_json("/x")
        assert time.monotonic() - started < 3.0
        stop.set()
    thread.join(5.0)


@pytest.fixture
def clock(monkeypatch):
    """A clock that stands at 100 s until a pause moves it."""
    now = [100.0]
    monkeypatch.setattr("time.monotonic", lambda: now[0])
    return now


def failing(clock, timeout_s, status=503):
    """A server that always fails in a way that may pass, with the times of its questions."""
    seen = []

    def answer(request):
        seen.append((round(clock[0] - 100.0, 6), request.extensions["timeout"]))
        return httpx.Response(status, text="oops")

    def pause(seconds):
        clock[0] += seconds

    transport = httpx.MockTransport(answer)
    return WebClient("http://h", timeout_s=timeout_s, pause=pause, transport=transport), seen


@pytest.mark.parametrize(
    ("timeout_s", "times"),
    [(15.0, [0.0, 0.2, 0.6]), (0.61, [0.0, 0.2, 0.6]), (0.59, [0.0, 0.2]), (0.21, [0.0, 0.2]), (0.19, [0.0])],
)
def test_a_pause_ends_before_the_time_is_over(clock, timeout_s, times):
    server, seen = failing(clock, timeout_s)
    with pytest.raises(RemoteError, match="does not respond"):
        server.get_json("/x")
    assert [at for at, _ in seen] == times
    assert clock[0] == pytest.approx(100.0 + times[-1])  # no pause behind the last one


def test_time_outs_of_an_attempt(clock):
    """Three seconds to connect and fifteen in all, less where less is left, 50 ms at least."""
    assert (WebClient("http://h").timeout_s, WebClient("http://h").pause) == (15.0, time.sleep)
    server, seen = failing(clock, 15.0, status=500)
    with pytest.raises(RemoteError):
        server.get_json("/x")
    assert seen[0][1] == {"connect": 3.0, "read": 15.0, "write": 15.0, "pool": 15.0}
    for timeout_s, left_s in ((2.0, 2.0), (0.5, 0.5), (0.01, 0.05), (0.0, 0.05)):
        server, seen = failing(clock, timeout_s, status=500)
        with pytest.raises(RemoteError):
            server.get_json("/x")
        assert seen[0][1]["connect"] == pytest.approx(left_s)
        assert seen[0][1]["read"] == pytest.approx(left_s)


@pytest.mark.parametrize(("late_s", "sound"), [(1.0, True), (1.1, False)])
def test_an_answer_ends_with_its_time(clock, late_s, sound):
    def answer(request):
        def parts():
            yield b"{"
            clock[0] += late_s
            yield b"}"

        return httpx.Response(200, content=parts())

    server = client(answer, timeout_s=1.0)
    if sound:
        assert server.get_json("/x") == {}
    else:
        with pytest.raises(RemoteError, match="got no answer within 1 s"):
            server.get_json("/x")


def test_an_address_is_cut_in_messages():
    with pytest.raises(InvalidInput, match="not the URL of a server") as caught:
        require_url("ftp://me:pw@" + "h" * 99, "x")
    assert caught.value.faults[0].got == "h" * 60


@pytest.mark.parametrize(
    "url", ["http://h:0", "http://h:1", "https://h:65535", "http://[::1]:8002", "https://a.b:8/c"]
)
def test_ports_of_an_address(url):
    assert require_url(url + "/", "x") == url


def test_a_client_is_its_settings(monkeypatch):
    """Not its connections, which do not follow the environment either."""
    made, answer = [], httpx.Response(200, content=b"{}")
    monkeypatch.setattr(
        httpx, "HTTPTransport", lambda **more: made.append(more) or httpx.MockTransport(lambda r: answer)
    )
    used, fresh = WebClient("http://h"), WebClient("http://h")
    assert used.get_json("/x") == used.get_json("/y") == {}
    assert made == [{"trust_env": False}]
    assert used == fresh
    assert repr(used) == repr(fresh)
    assert "ransport" not in repr(used)


@pytest.mark.parametrize("most", [3, 100])
def test_an_answer_is_closed_whether_it_is_read_to_its_end_or_not(monkeypatch, most):
    """Else its connection is never used again."""

    class Parts(httpx.SyncByteStream):
        closed = False

        def __iter__(self):
            yield from (b"[1,", b" 2]")

        def close(self):
            self.closed = True

    parts = Parts()
    monkeypatch.setattr(web, "MAX_ANSWER_BYTES", most)
    asked = client(lambda _: httpx.Response(200, stream=parts))
    if most == 3:
        with pytest.raises(RemoteError, match="answer too large"):
            asked.get_json("/")
    else:
        assert asked.get_json("/") == [1, 2]
    assert parts.closed
