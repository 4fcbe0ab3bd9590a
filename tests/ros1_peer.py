"""Another node of ROS 1, of rospy's own messages: told what to do in lines of JSON.

Run by the tests; it shares nothing with the package.
"""

from __future__ import annotations

import json
import sys
import time

import genpy
import rospy
from roslib.message import get_message_class

publishers: dict[str, rospy.Publisher] = {}
heard: dict[str, list] = {}


def advertise(topic: str, kind: str, raw: bool = False) -> None:
    sent = get_message_class(kind)
    if raw:

        class Garbage(rospy.AnyMsg):
            _type, _md5sum, _full_text = sent._type, sent._md5sum, sent._full_text

        sent = Garbage
    publishers[topic] = rospy.Publisher(topic, sent, queue_size=1000, tcp_nodelay=True)


def connections(topic: str) -> int:
    return publishers[topic].get_num_connections()


def publish(topic: str, messages: list[dict], pause: float = 0.0) -> None:
    for fields in messages:
        message = publishers[topic].data_class()
        _fill(message, fields)
        publishers[topic].publish(message)
        time.sleep(pause)


def publish_raw(topic: str, messages: list[str]) -> None:
    for text in messages:
        message = publishers[topic].data_class()
        message._buff = bytes.fromhex(text)
        publishers[topic].publish(message)


def listen(topic: str, kind: str) -> None:
    heard[topic] = []
    rospy.Subscriber(topic, get_message_class(kind), lambda got: heard[topic].append(_plain(got)))


def take(topic: str) -> list:
    taken, heard[topic][:] = heard[topic][:], []
    return taken


def _fill(message: object, fields: dict) -> None:
    for name, value in fields.items():
        if isinstance(value, dict):
            _fill(getattr(message, name), value)
        elif name == "stamp":
            message.stamp = rospy.Time(*value)
        elif name in ("ranges", "intensities") and value and isinstance(value[0], list):
            from sensor_msgs.msg import LaserEcho

            setattr(message, name, [LaserEcho(echoes) for echoes in value])
        else:
            setattr(message, name, value)


def _plain(value: object) -> object:
    """Make what JSON can hold of a message."""
    if isinstance(value, genpy.rostime.TVal):
        return [value.secs, value.nsecs]
    if isinstance(value, bytes):
        return value.hex()
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    if hasattr(value, "__slots__"):
        return {name: _plain(getattr(value, name)) for name in value.__slots__}
    return value


def main() -> None:
    rospy.init_node(sys.argv[1], disable_signals=True)
    for line in sys.stdin:
        name, arguments = json.loads(line)
        print(json.dumps(globals()[name](**arguments)), flush=True)
    rospy.signal_shutdown("told nothing more")


if __name__ == "__main__":
    main()
