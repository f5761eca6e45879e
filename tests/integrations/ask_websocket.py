"""Sends one command to Home Assistant's WebSocket and prints its result; its own Python runs it, which has aiohttp.

`python ask_websocket.py URL TOKEN JSON`
"""

import asyncio
import json
import sys


async def ask(url: str, token: str, command: str) -> None:
    import aiohttp  # of the environment of Home Assistant

    async with aiohttp.ClientSession() as session, session.ws_connect(f"{url}/api/websocket") as socket:
        await socket.receive_json()
        await socket.send_json({"type": "auth", "access_token": token})
        await socket.receive_json()
        await socket.send_json({"id": 1, **json.loads(command)})
        print(json.dumps(await socket.receive_json()))  # noqa: T201


if __name__ == "__main__":
    asyncio.run(ask(*sys.argv[1:]))
