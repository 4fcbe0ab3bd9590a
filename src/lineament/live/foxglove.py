"""Foxglove, live: what is found is served by WebSocket, in the messages of its recordings."""

from __future__ import annotations

from collections import defaultdict

import foxglove
from foxglove.websocket import ChannelView, Client, ServerListener

from ..errors import LineamentError
from ..output.foxglove import FoxgloveMessages
from ..output.scene import Message

__all__ = ["FoxgloveMessages", "FoxgloveServer"]

#: Messages that wait for a viewer that does not keep up; then the oldest go.
_BACKLOG = 64


class FoxgloveServer:
    """Serves Foxglove's own messages to its app: "Open connection", ``ws://localhost:8765``.

    A viewer that does not keep up loses messages and delays nobody.

    Parameters
    ----------
    host : str
        Address to listen on: this machine alone, or ``0.0.0.0`` for whoever can reach it.
    port : int
        Port to listen on; 0 for any that is free.
    name : str
        What the app calls the server.

    Raises
    ------
    LineamentError
        If nothing can be served there.

    Attributes
    ----------
    address : str
        What the app connects to.

    Examples
    --------
    >>> server = FoxgloveServer(port=0)
    >>> server.listeners("/scan")
    0
    >>> server.close()
    """

    #: Messages that could not be sent: the SDK does not tell.
    unsent = 0

    def __init__(self, host: str = "127.0.0.1", port: int = 8765, name: str = "lineament") -> None:
        self._messages, self._viewers = FoxgloveMessages(), _Viewers()
        self._context = foxglove.Context()
        self._channels: dict[str, foxglove.Channel] = {}
        try:
            self._server = foxglove.start_server(
                name=name,
                host=host,
                port=port,
                context=self._context,
                server_listener=self._viewers,
                message_backlog_size=_BACKLOG,
            )
        except (RuntimeError, OverflowError) as error:
            reason = str(error).rpartition(": ")[2]
            raise LineamentError(
                f"Foxglove cannot be served at {host}, port {port}: {reason}"
            ) from None
        self.address = f"ws://{host}:{self._server.port}"

    def advertise(self, topic: str, kind: str) -> None:
        """Make a topic known before its first message.

        Parameters
        ----------
        topic : str
        kind : str
            Name of the type of its messages: ``SceneUpdate``, ``LaserScan`` ...
        """
        name, encoding, data = self._messages.schema(kind)
        self._channels[topic] = foxglove.Channel(
            topic,
            message_encoding=self._messages.encoding,
            schema=foxglove.Schema(name=name, encoding=encoding, data=data),
            context=self._context,
        )

    def publish(self, message: Message) -> None:
        """Send a message to those who see its topic, without waiting until it is sent."""
        if message.topic not in self._channels:
            self.advertise(message.topic, message.kind)
        self._channels[message.topic].log(message.data)

    def listeners(self, topic: str) -> int:
        """How many viewers show a topic; 0 for one that is not advertised."""
        return len(self._viewers.of[topic])

    def close(self) -> None:
        """End the connections, and stop listening."""
        self._server.stop()
        for channel in self._channels.values():
            channel.close()
        self._channels.clear()


class _Viewers(ServerListener):
    """Keeps who is subscribed, by topic, as the server's threads tell it."""

    def __init__(self) -> None:
        self.of: defaultdict[str, set[int]] = defaultdict(set)

    def on_subscribe(self, client: Client, channel: ChannelView) -> None:
        self.of[channel.topic].add(client.id)

    def on_unsubscribe(self, client: Client, channel: ChannelView) -> None:
        self.of[channel.topic].discard(client.id)
