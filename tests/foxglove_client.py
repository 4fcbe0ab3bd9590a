"""A client of Foxglove's WebSocket protocol that shares nothing with the server."""

from __future__ import annotations

import base64
import json
import struct
from contextlib import ExitStack
from typing import Any

from protobuf import decode, messages_of
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

_PROTOCOL = "foxglove.sdk.v1"


class FoxgloveClient:
    """Takes texts as dicts, and messages of topics as bytes, in the order in which they come."""

    def __init__(self, port: int, timeout: float = 60.0) -> None:
        address = f"ws://127.0.0.1:{port}"
        self._timeout, self._stack = timeout, ExitStack()
        options = {"subprotocols": [_PROTOCOL], "max_size": None, "proxy": None}
        connecting = connect(address, open_timeout=timeout, close_timeout=1, **options)
        self._socket = self._stack.enter_context(connecting)
        self.channels: dict[str, dict] = {}
        self.server = self.take_text()

    def subscribe(self, topic: str) -> None:
        while topic not in self.channels:
            self.take_text()
        number = self.channels[topic]["id"]
        self.tell({"op": "subscribe", "subscriptions": [{"id": number, "channelId": number}]})

    def unsubscribe(self, topic: str) -> None:
        number = self.channels[topic]["id"]
        self.tell({"op": "unsubscribe", "subscriptionIds": [number]})

    def tell(self, text: dict) -> None:
        self._socket.send(json.dumps(text))

    def take_text(self) -> dict:
        """Take the next text; the channels that it advertises are kept."""
        while not isinstance(data := self._receive(), str):
            pass
        text = json.loads(data)
        for channel in text.get("channels", ()):
            self.channels[channel["topic"]] = channel
        return text

    def take_message(self) -> tuple[int, bytes]:
        """Take the next message of a topic: the id of the subscription, and its bytes."""
        while isinstance(data := self._receive(), str):
            pass
        operation, number, _time = struct.unpack_from("<BIQ", data)
        assert operation == 1
        return number, data[13:]

    def take_decoded(self, topic: str) -> dict[str, Any]:
        """Take the next message, which is of a topic, by the schema that the server sent."""
        channel = self.channels[topic]
        number, data = self.take_message()
        assert number == channel["id"]
        assert channel["encoding"] == channel["schemaEncoding"] == "protobuf"
        schema = messages_of(base64.b64decode(channel["schema"]))
        return decode(data, f".{channel['schemaName']}", schema)

    def close(self) -> None:
        self._stack.close()

    def _receive(self) -> str | bytes:
        try:
            return self._socket.recv(self._timeout)
        except ConnectionClosed:
            raise EOFError("the server has closed the connection") from None
