"""Another node of ROS 1, of rospy's own messages; `live_driving.Remote` runs it in a process.

It shares nothing with the package.
"""

from __future__ import annotations

import genpy
import rospy
from roslib.message import get_message_class, get_service_class


class Peer:
    """A node with publishers and subscribers by the names of their topics."""

    def __init__(self, name: str) -> None:
        rospy.init_node(name, disable_signals=True)
        self._publishers: dict[str, rospy.Publisher] = {}
        self._heard: dict[str, list] = {}

    def publish(self, topic: str, kind: str, raw: bool = False, latch: bool = False) -> None:
        """Begin to publish; `raw` for messages of any bytes."""
        sent = get_message_class(kind)
        if raw:

            class Garbage(rospy.AnyMsg):
                _type, _md5sum, _full_text = sent._type, sent._md5sum, sent._full_text

            sent = Garbage
        self._publishers[topic] = rospy.Publisher(
            topic, sent, queue_size=1000, tcp_nodelay=True, latch=latch
        )

    def listeners(self, topic: str) -> int:
        return self._publishers[topic].get_num_connections()

    def write(self, topic: str, *messages: dict | bytes) -> None:
        for given in messages:
            message = self._publishers[topic].data_class()
            if isinstance(given, bytes):
                message._buff = given
            else:
                _fill(message, given)
            self._publishers[topic].publish(message)

    def call(self, service: str, kind: str) -> None:
        """Call a service that takes nothing, once it is there."""
        rospy.wait_for_service(service, timeout=10)
        rospy.ServiceProxy(service, get_service_class(kind))()

    def listen(self, topic: str, kind: str) -> None:
        heard = self._heard[topic] = []
        rospy.Subscriber(topic, get_message_class(kind), lambda got: heard.append(_plain(got)))

    def take(self, topic: str) -> list:
        """Take what has come."""
        taken, self._heard[topic][:] = self._heard[topic][:], []
        return taken


def _fill(message: object, fields: dict) -> None:
    for name, value in fields.items():
        if name == "stamp":
            message.stamp = rospy.Time(value["sec"], value["nanosec"])
        elif name == "transforms":
            message.transforms = [_filled("geometry_msgs/TransformStamped", one) for one in value]
        elif isinstance(value, dict):
            _fill(getattr(message, name), value)
        elif name in ("ranges", "intensities") and value and isinstance(value[0], dict):
            from sensor_msgs.msg import LaserEcho

            setattr(message, name, [LaserEcho(echo["echoes"]) for echo in value])
        else:
            setattr(message, name, value)


def _filled(kind: str, fields: dict) -> object:
    message = get_message_class(kind)()
    _fill(message, fields)
    return message


def _plain(value: object) -> object:
    """Make what a process can send of a message: as a peer over DDS has it."""
    if isinstance(value, genpy.rostime.TVal):
        return {"sec": value.secs, "nanosec": value.nsecs}
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    if hasattr(value, "__slots__"):
        return {name: _plain(getattr(value, name)) for name in value.__slots__}
    return value
