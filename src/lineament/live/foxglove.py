"""Foxglove, live: messages are served by WebSocket, the same as in a recording."""

import foxglove

from ..errors import LineamentError
from ..output.foxglove import FoxgloveMessages
from ..output.scene import Message
from .publisher import Publisher

#: Messages that wait for a slow viewer; then the oldest are dropped.
_BACKLOG = 64


class FoxgloveServer(Publisher):
    """Serves Foxglove's own messages to its app, at `address`; port 0 is any that is free.

    A viewer that does not keep up loses messages, uncounted, and delays nobody.
    """

    def __init__(self, host: str = "127.0.0.1", port: int = 8765, name: str = "lineament") -> None:
        super().__init__()
        self._messages = FoxgloveMessages()
        self._context = foxglove.Context()
        try:
            self._server = foxglove.start_server(
                name=name,
                host=host,
                port=port,
                context=self._context,
                message_backlog_size=_BACKLOG,
            )
        except (RuntimeError, OverflowError) as error:
            reason = str(error).rpartition(": ")[2]
            raise LineamentError(
                f"Foxglove cannot be served at {host}, port {port}: {reason}"
            ) from None
        self.address = f"ws://{host}:{self._server.port}"

    def close(self) -> None:
        """End the connections, and stop listening."""
        self._server.stop()
        for channel in self._topics.values():
            channel.close()
        self._topics.clear()

    def _open(self, topic: str, kind: str) -> foxglove.Channel:
        name, encoding, data = self._messages.schema(kind)
        schema = foxglove.Schema(name=name, encoding=encoding, data=data)
        encoding = self._messages.encoding
        return foxglove.Channel(
            topic, message_encoding=encoding, schema=schema, context=self._context
        )

    def _send(self, topic: foxglove.Channel, message: Message) -> None:
        topic.log(message.data)

    def _count(self, topic: foxglove.Channel) -> int:
        return int(topic.has_sinks())
