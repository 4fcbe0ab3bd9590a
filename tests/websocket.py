"""A slow, obvious WebSocket client of Foxglove's protocol, over plain sockets."""

from __future__ import annotations

import base64
import hashlib
import json
import os
import socket
import struct

#: Makes the server's answer to the client's key, by RFC 6455.
_MAGIC = b"258EAFA5-E914-47DA-95CA-C5AB0DC85B11"
_PROTOCOL = "foxglove.sdk.v1"
_TEXT, _BINARY, _CLOSE, _PING, _PONG = 1, 2, 8, 9, 10


class FoxgloveClient:
    """Takes texts as dicts, and messages of topics as bytes, in the order in which they come."""

    def __init__(self, port: int, timeout: float = 30.0) -> None:
        self._socket = socket.create_connection(("127.0.0.1", port), timeout)
        self._data = b""
        self.channels: dict[str, dict] = {}
        self.server = self._shake_hands()

    def subscribe(self, topic: str) -> None:
        while topic not in self.channels:
            self.take_text()
        number = self.channels[topic]["id"]
        self.tell({"op": "subscribe", "subscriptions": [{"id": number, "channelId": number}]})

    def unsubscribe(self, topic: str) -> None:
        number = self.channels[topic]["id"]
        self.tell({"op": "unsubscribe", "subscriptionIds": [number]})

    def tell(self, text: dict) -> None:
        self._send(_TEXT, json.dumps(text).encode())

    def take_text(self) -> dict:
        """Take the next text; the channels that it advertises are kept."""
        while True:
            kind, data = self._receive()
            if kind == _TEXT:
                text = json.loads(data)
                for channel in text.get("channels", ()):
                    self.channels[channel["topic"]] = channel
                return text

    def take_message(self) -> tuple[int, bytes]:
        """Take the next message of a topic: the id of the subscription, and its bytes."""
        while True:
            kind, data = self._receive()
            if kind == _BINARY:
                operation, number, _time = struct.unpack_from("<BIQ", data)
                assert operation == 1
                return number, data[13:]

    def close(self) -> None:
        self._socket.close()

    def _shake_hands(self) -> dict:
        key = base64.b64encode(os.urandom(16))
        request = [
            "GET / HTTP/1.1",
            "Host: 127.0.0.1",
            "Upgrade: websocket",
            "Connection: Upgrade",
            f"Sec-WebSocket-Key: {key.decode()}",
            "Sec-WebSocket-Version: 13",
            f"Sec-WebSocket-Protocol: {_PROTOCOL}",
        ]
        self._socket.sendall("\r\n".join([*request, "", ""]).encode())
        while b"\r\n\r\n" not in self._data:
            self._more()
        head, _, self._data = self._data.partition(b"\r\n\r\n")
        answer = base64.b64encode(hashlib.sha1(key + _MAGIC).digest())
        assert head.startswith(b"HTTP/1.1 101 ")
        assert answer in head
        return self.take_text()

    def _send(self, kind: int, data: bytes) -> None:
        mask = os.urandom(4)
        size = (
            bytes([0x80 | len(data)]) if len(data) < 126 else b"\xfe" + struct.pack(">H", len(data))
        )
        masked = bytes(byte ^ mask[i % 4] for i, byte in enumerate(data))
        self._socket.sendall(bytes([0x80 | kind]) + size + mask + masked)

    def _receive(self) -> tuple[int, bytes]:
        first, size = self._take(2)
        assert first & 0x80  # the server sends whole messages
        if size == 126:
            (size,) = struct.unpack(">H", self._take(2))
        elif size == 127:
            (size,) = struct.unpack(">Q", self._take(8))
        kind, data = first & 0x0F, self._take(size)
        if kind == _PING:
            self._send(_PONG, data)
        elif kind == _CLOSE:
            raise EOFError("the server has closed the connection")
        return kind, data

    def _take(self, n: int) -> bytes:
        while len(self._data) < n:
            self._more()
        taken, self._data = self._data[:n], self._data[n:]
        return taken

    def _more(self) -> None:
        data = self._socket.recv(65536)
        if not data:
            raise EOFError("the server has gone")
        self._data += data
