"""Requests to a service of tripwatt."""

from __future__ import annotations

import json
from collections.abc import AsyncGenerator, Mapping
from typing import Any, Final

from aiohttp import ClientError, ClientSession, ClientTimeout
from yarl import URL

TIMEOUT: Final = ClientTimeout(total=60)
"""The service itself gives up on a forecast after 20 s, on a journey with many stations later."""

STREAM_TIMEOUT: Final = ClientTimeout(total=None, sock_connect=10, sock_read=60)
"""A stream without news has a comment every 15 s."""

MAX_EVENT_BYTES: Final = 1 << 24
"""Largest event; the state of a car has some kilobytes."""


class ServiceAwayError(Exception):
    """The service does not answer."""


class NoServiceError(ServiceAwayError):
    """What answers is no tripwatt."""


class TokenRefusedError(Exception):
    """The service asks for another token."""


class ServiceProblemError(Exception):
    """The service refused a request with a problem document (RFC 9457).

    Attributes
    ----------
    kind : str
        The last part of the problem's `type`, such as "no-plan".
    """

    def __init__(self, document: Mapping[str, Any]) -> None:
        faults = [
            f"{fault.get('where')}: {fault.get('what')}, got {fault.get('got')}, allowed: {fault.get('allowed')}"
            for fault in document.get("faults", ())
        ]
        detail = document.get("detail") or document.get("title") or "refused"
        super().__init__("; ".join(faults) or str(detail))
        self.kind = str(document["type"]).rpartition("/")[2]


def service_url(text: str) -> URL:
    """The address of a service as the user gave it, without what follows its path.

    Raises
    ------
    ValueError
        When it is no address of the web.
    """
    url = URL(text.strip())
    if url.scheme not in ("http", "https") or not url.host:
        raise ValueError(text)
    return url.with_query(None).with_fragment(None).with_user(None).with_path(url.path.rstrip("/"))


class ServiceClient:
    """Asks one service, in the shared session of Home Assistant.

    Parameters
    ----------
    session : ClientSession
    url : str
        Address of the service.
    token : str
        Empty where the service asks for none.
    """

    def __init__(self, session: ClientSession, url: str, token: str = "") -> None:
        self._session = session
        self._url = service_url(url)
        self._headers = {"Authorization": f"Bearer {token}"} if token else {}

    async def get(self, path: str, **parameters: Any) -> Any:
        """The answer to a GET; parameters that are None are left out.

        Raises
        ------
        ServiceAwayError, TokenRefusedError, ServiceProblemError
        """
        given = {name: str(value) for name, value in parameters.items() if value is not None}
        return await self._answer("GET", path, params=given)

    async def post(self, path: str, body: Mapping[str, Any], **parameters: str) -> Any:
        """The answer to a POST of a JSON document; fields that are None are left out.

        Raises
        ------
        ServiceAwayError, TokenRefusedError, ServiceProblemError
        """
        given = {name: value for name, value in body.items() if value is not None}
        return await self._answer("POST", path, json=given, params=parameters)

    async def put(self, path: str, body: Mapping[str, Any]) -> Any:
        """The answer to a PUT of a JSON document; raises as `post`."""
        return await self._answer(
            "PUT", path, json={n: value for n, value in body.items() if value is not None}
        )

    async def events(self) -> AsyncGenerator[dict[str, Any]]:
        """The states of the cars on the road, each when it changes; an empty one tells that the stream is open.

        Raises
        ------
        ServiceAwayError, TokenRefusedError, ServiceProblemError
        """
        try:
            async with self._session.get(
                self._at("/v1/events"), headers=self._headers, timeout=STREAM_TIMEOUT, allow_redirects=False
            ) as answer:
                if answer.status != 200:
                    raise self._refusal(answer.status, await answer.json(content_type=None))
                if answer.content_type != "text/event-stream":
                    raise NoServiceError(f"{self._url}: no stream of tripwatt")
                yield {}
                rest = b""
                async for chunk in answer.content.iter_any():
                    *events, rest = (rest + chunk).split(b"\n\n")
                    if len(rest) > MAX_EVENT_BYTES:
                        raise NoServiceError(f"{self._url}: an event without an end")
                    for event in events:
                        lines = [line[5:] for line in event.splitlines() if line.startswith(b"data:")]
                        yield json.loads(b"\n".join(lines)) if lines else {}
        except ValueError as error:
            raise NoServiceError(f"{self._url}: no answer of tripwatt") from error
        except (ClientError, TimeoutError) as error:
            raise ServiceAwayError(f"{self._url}: {error!r}") from error

    def _at(self, path: str) -> URL:
        return self._url.with_path(self._url.path.rstrip("/") + path)

    async def _answer(self, method: str, path: str, **more: Any) -> Any:
        try:
            async with self._session.request(
                method, self._at(path), headers=self._headers, timeout=TIMEOUT, allow_redirects=False, **more
            ) as answer:
                document = await answer.json(content_type=None)
        except ValueError as error:
            raise NoServiceError(f"{self._url}: no answer of tripwatt") from error
        except (ClientError, TimeoutError) as error:
            raise ServiceAwayError(f"{self._url}: {error!r}") from error
        if answer.status == 200 and isinstance(document, dict):
            return document
        raise self._refusal(answer.status, document)

    def _refusal(self, status: int, document: Any) -> Exception:
        """What an answer means that is not a good one."""
        if not isinstance(document, dict) or not str(document.get("type", "")).startswith("/problems/"):
            kind = ServiceAwayError if status >= 500 else NoServiceError  # a proxy whose service is away
            return kind(f"{self._url}: status {status}, no answer of tripwatt")
        if status == 401:
            return TokenRefusedError(str(document.get("detail", "")))
        if status in (429, 502, 503, 504):
            return ServiceAwayError(f"{self._url}: {document.get('title')}")
        return ServiceProblemError(document)
