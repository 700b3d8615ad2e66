"""The messages of a raw log as protobuf schemas, built when they are needed.

Scalars carry their unit in the name, one channel per axis, so that Foxglove, PlotJuggler and rerun plot them;
exact traces are packed arrays beside, from which the record is made again.
"""

from __future__ import annotations

import functools
from typing import Any

from google.protobuf import (  # type: ignore[import-untyped]
    descriptor_pb2,
    descriptor_pool,
    message_factory,
)

_Field = descriptor_pb2.FieldDescriptorProto
_TYPES = {
    "double": _Field.TYPE_DOUBLE,
    "uint32": _Field.TYPE_UINT32,
    "string": _Field.TYPE_STRING,
    "bytes": _Field.TYPE_BYTES,
}

# Message -> fields in the order of their numbers; "*" is repeated. Fields may be added at the end, never moved.
MESSAGES: dict[str, tuple[str, ...]] = {
    "robid.AxisSample": ("double position_rad", "double torque_nm", "double speed_reference_rad_s"),
    "robid.CanFrame": ("uint32 identifier", "bytes data"),
    "robid.BulkTransfer": ("string note", "uint32 frames", "uint32 bytes"),
    "robid.Event": ("string text",),
    # One slice of a trace, (n_row, n_axis) row by row; *_unit empty: values, else increments of that unit
    "robid.Trace": (
        "string label",
        "uint32 configuration",
        "uint32 block",
        "uint32 experiment",
        "uint32 first_row",
        "uint32 n_row",
        "string position_type",
        "bytes position",
        "*double position_unit",
        "string torque_type",
        "bytes torque",
        "*double torque_unit",
        "bytes valid",
    ),
    "robid.Reference": (
        "uint32 configuration",
        "uint32 block",
        "uint32 experiment",
        "uint32 first_row",
        "uint32 n_row",
        "string reference_type",
        "bytes reference",
        "*double reference_unit",
        "*double saturated",
    ),
}


@functools.cache
def descriptor_set() -> Any:
    """Return the FileDescriptorSet of all messages above."""
    file = descriptor_pb2.FileDescriptorProto(name="robid.proto", package="robid", syntax="proto3")
    for name, fields in MESSAGES.items():
        message = file.message_type.add(name=name.removeprefix("robid."))
        for number, declaration in enumerate(fields, start=1):
            kind, field = declaration.split()
            label = _Field.LABEL_REPEATED if kind.startswith("*") else _Field.LABEL_OPTIONAL
            message.field.add(name=field, number=number, type=_TYPES[kind.lstrip("*")], label=label)
    return descriptor_pb2.FileDescriptorSet(file=[file])


@functools.cache
def message_class(name: str) -> Any:
    """Return the class of one of robid's messages."""
    return message_class_of(descriptor_set().SerializeToString(), name)


def message_class_of(descriptors: bytes, name: str) -> Any:
    """Return the class of a message from a serialized FileDescriptorSet; raises ValueError where it has none."""
    pool = descriptor_pool.DescriptorPool()
    files = descriptor_pb2.FileDescriptorSet.FromString(descriptors).file
    pending = {file.name: file for file in files}
    while pending:  # a file can be added when all that it imports are there
        ready = [file for file in pending.values() if not any(name in pending for name in file.dependency)]
        if not ready:
            raise ValueError(f"the schema's files import one another: {', '.join(pending)}")
        for file in ready:
            pool.Add(file)
            del pending[file.name]
    try:
        return message_factory.GetMessageClass(pool.FindMessageTypeByName(name))
    except KeyError as error:
        raise ValueError(f"the schema has no message {name}") from error
