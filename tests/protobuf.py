"""A slow, obvious reader of Protobuf by the schema that an MCAP file carries."""

import struct

#: Numbers of the fields of descriptor.proto that are needed here.
_FILES, _MESSAGES, _PACKAGE, _NESTED = 1, 4, 2, 3
_NAME, _FIELDS, _NUMBER, _LABEL, _TYPE, _TYPE_NAME = 1, 2, 3, 4, 5, 6
_REPEATED, _DOUBLE, _FLOAT, _FIXED, _STRING, _MESSAGE = 3, 1, 2, 7, 9, 11


def _varint(data: bytes, at: int) -> tuple[int, int]:
    value = shift = 0
    while True:
        value |= (data[at] & 0x7F) << shift
        shift, at = shift + 7, at + 1
        if not data[at - 1] & 0x80:
            return value, at


def _records(data: bytes):
    """Give number and value of each field: an int, or the bytes of everything longer."""
    at = 0
    while at < len(data):
        key, at = _varint(data, at)
        kind = key & 7
        if kind == 0:
            value, at = _varint(data, at)
        else:
            size, at = _varint(data, at) if kind == 2 else ({1: 8, 5: 4}[kind], at)
            value, at = data[at : at + size], at + size
        yield key >> 3, value


def _all(data: bytes, number: int) -> list:
    return [value for found, value in _records(data) if found == number]


def messages_of(schema: bytes) -> dict[str, dict[int, tuple]]:
    """Name, type, name of the type and whether it is repeated of each field of each message."""
    found: dict[str, dict[int, tuple]] = {}

    def add(prefix: str, message: bytes, nested: int) -> None:
        name = f"{prefix}.{_all(message, _NAME)[0].decode()}"
        found[name] = {}
        for field in _all(message, _FIELDS):
            type_name = [text.decode() for text in _all(field, _TYPE_NAME)]
            found[name][_all(field, _NUMBER)[0]] = (
                _all(field, _NAME)[0].decode(),
                _all(field, _TYPE)[0],
                type_name[0] if type_name else "",
                _all(field, _LABEL) == [_REPEATED],
            )
        for inner in _all(message, nested):
            add(name, inner, nested)

    for file in _all(schema, _FILES):
        package = b"".join(_all(file, _PACKAGE)).decode()
        for message in _all(file, _MESSAGES):
            add(f".{package}" if package else "", message, _NESTED)
    return found


def decode(data: bytes, name: str, messages: dict[str, dict[int, tuple]]) -> dict:
    """Read a message as a dict; fields that are not in it are missing, lists are empty."""
    fields = messages[name]
    result: dict = {field: [] for field, _, _, is_repeated in fields.values() if is_repeated}
    for number, value in _records(data):
        field, kind, type_name, is_repeated = fields[number]
        values = _values(value, kind, type_name, messages)
        if is_repeated:
            result[field] += values
        else:
            result[field] = values[0]
    return result


def _values(value: object, kind: int, type_name: str, messages: dict) -> list:
    if kind == _MESSAGE:
        return [decode(value, type_name, messages)]
    if kind == _STRING:
        return [value.decode()]
    if kind in (_DOUBLE, _FLOAT):  # packed, where there are several
        return [x for (x,) in struct.iter_unpack("<d" if kind == _DOUBLE else "<f", value)]
    return [int.from_bytes(value, "little") if kind == _FIXED else value]
