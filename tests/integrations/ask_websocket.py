"""Sends commands to Home Assistant's WebSocket and prints their results; its own Python runs it, which has aiohttp.

`python ask_websocket.py URL TOKEN`; each line of the input is a command as JSON, each line of the output its result.
"""

import asyncio
import json
import sys


async def ask(url: str, token: str) -> None:
    import aiohttp  # of the environment of Home Assistant

    async with aiohttp.ClientSession() as session:
        for number, line in enumerate(sys.stdin, 1):
            async with session.ws_connect(f"{url}/api/websocket", max_msg_size=0) as socket:
                await socket.receive_json()
                await socket.send_json({"type": "auth", "access_token": token})
                await socket.receive_json()
                await socket.send_json({"id": number, **json.loads(line)})
                print(json.dumps(await socket.receive_json()), flush=True)  # noqa: T201


if __name__ == "__main__":
    asyncio.run(ask(*sys.argv[1:]))
