"""Topics of DDS whose messages are bytes: as ROS 2 has them on the wire.

The Python binding of Cyclone DDS reads and writes objects of classes that describe each field.
Here bytes are needed: they are decoded elsewhere, and only if they are used; a malformed message
has to arrive, so that it is counted and reported; and the binding holds the interpreter while a
writer waits for a slow reader. So these few functions of Cyclone DDS are called directly. A topic
is identified by its name and that of its type, as in ROS 2's own bindings.
"""

import ctypes
from typing import Any

from cyclonedds.core import DDSException, Entity, InstanceState, SampleState, ViewState
from cyclonedds.domain import DomainParticipant
from cyclonedds.internal import DDS, dds_c_t
from cyclonedds.pub import DataWriter
from cyclonedds.qos import Qos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

#: Every message, read or not.
ANY_STATE = ViewState.Any | SampleState.Any | InstanceState.Any
#: Kind of a serialised message: data, not a key.
_DATA = 2
#: Description of a type as far as Cyclone DDS uses it: at least one byte, and no key.
_ONE_BYTE = (ctypes.c_uint32 * 3)(0x01_01_00_00, 0, 0)


class _Meta(ctypes.Structure):
    _fields_ = (("data", ctypes.c_void_p), ("size", ctypes.c_uint32))


class _Description(ctypes.Structure):
    """``dds_topic_descriptor_t``."""

    _fields_ = (
        *((name, ctypes.c_uint32) for name in ("size", "alignment", "flags", "n_keys")),
        ("type_name", ctypes.c_char_p),
        ("keys", ctypes.c_void_p),
        ("n_operations", ctypes.c_uint32),
        ("operations", ctypes.POINTER(ctypes.c_uint32)),
        ("meta", ctypes.c_char_p),
        ("type_information", _Meta),
        ("type_mapping", _Meta),
        ("representations", ctypes.c_uint32),
    )


class _Piece(ctypes.Structure):
    """``ddsrt_iovec_t``: a piece of memory."""

    _fields_ = (("base", ctypes.c_char_p), ("size", ctypes.c_size_t))


def _function(name: str, result: Any, *arguments: Any) -> Any:
    function = getattr(DDS._dll_handle, name)
    function.restype, function.argtypes = result, arguments
    return function


_P, _Entity, _Int, _Word = ctypes.POINTER, dds_c_t.entity, ctypes.c_int32, ctypes.c_uint32
_Pointer, _Size, _Text = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_char_p
_create_topic = _function(
    "dds_create_topic", _Entity, _Entity, _P(_Description), _Text, _Pointer, _Pointer
)
_get_type = _function("dds_get_entity_sertype", _Int, _Entity, _P(_Pointer))
_take = _function("dds_takecdr", _Int, _Entity, _P(_Pointer), _Word, _P(dds_c_t.sample_info), _Word)
_size = _function("ddsi_serdata_size", _Word, _Pointer)
_copy = _function("ddsi_serdata_to_ser", None, _Pointer, _Size, _Size, _Text)
_release = _function("ddsi_serdata_unref", None, _Pointer)
_serialised = _function(
    "ddsi_serdata_from_ser_iov", _Pointer, _Pointer, ctypes.c_int, _Size, _P(_Piece), _Size
)
_count_listeners = _function("dds_get_matched_subscriptions", _Int, _Entity, _Pointer, _Size)
_write = _function("dds_writecdr", _Int, _Entity, _Pointer)


class RawTopic(Topic[Any]):
    """A topic by its name and that of its type, with messages of any bytes."""

    def __init__(self, participant: DomainParticipant, name: str, type_name: str) -> None:
        description = _Description(
            size=1, alignment=1, type_name=type_name.encode(), n_operations=2, operations=_ONE_BYTE
        )
        # The participant lives as long as the topic.
        self._keepalive_entities = [participant]
        self.data_type = bytes
        made = _create_topic(participant._ref, description, name.encode(), None, None)
        Entity.__init__(self, made)


class RawReader(DataReader[Any]):
    """Reads a topic; `depth` is how many messages are taken at a time."""

    def __init__(
        self, participant: DomainParticipant, topic: RawTopic, qos: Qos, depth: int
    ) -> None:
        super().__init__(participant, topic, qos)
        self._taken = (ctypes.c_void_p * depth)()
        self._infos = (dds_c_t.sample_info * depth)()

    def take_raw(self) -> list[tuple[bytes, int]]:
        """Take the messages that wait, oldest first: each in CDR, and its publisher's handle."""
        n = _take(self._ref, self._taken, len(self._taken), self._infos, ANY_STATE)
        if n < 0:
            raise DDSException(n, "while messages were taken")
        samples = []
        for i in range(n):
            serialised, info = self._taken[i], self._infos[i]
            if info.valid_data:  # Otherwise it is the notice that a publisher has gone.
                size = _size(serialised)
                data = ctypes.create_string_buffer(size)
                _copy(serialised, 0, size, data)
                samples.append((data.raw, info.publication_handle))
            _release(serialised)
            self._taken[i] = None
        return samples


class RawWriter(DataWriter[Any]):
    """Writes to a topic."""

    def __init__(self, participant: DomainParticipant, topic: RawTopic, qos: Qos) -> None:
        super().__init__(participant, topic, qos)
        self._type = ctypes.c_void_p()
        _get_type(self._ref, self._type)

    @property
    def listeners(self) -> int:
        """Number of listeners at the moment."""
        return max(int(_count_listeners(self._ref, None, 0)), 0)

    def write_raw(self, data: bytes) -> bool:
        """Write a message in CDR; return False if a slow reader prevented it."""
        data += bytes(-len(data) % 4)  # Messages end on a full word.
        serialised = _serialised(self._type, _DATA, 1, _Piece(data, len(data)), len(data))
        if not serialised:
            raise ValueError(f"message begins with {data[:4].hex()!r}, expected CDR: 0001")
        result: int = _write(self._ref, serialised)
        if result == DDSException.DDS_RETCODE_TIMEOUT:
            return False
        if result < 0:
            raise DDSException(result, "while a message was written")
        return True
