"""The values behind a drive's object dictionary, typed as the dictionary says, with hooks of the drive."""

from __future__ import annotations

from collections.abc import Callable

import canopen
from canopen.objectdictionary import ODVariable

Key = tuple[int, int]

# CiA 301: abort codes of the SDO protocol
NO_OBJECT = 0x0602_0000
NO_SUBINDEX = 0x0609_0011
READ_OF_WRITE_ONLY = 0x0601_0001
WRITE_OF_READ_ONLY = 0x0601_0002
LENGTH_TOO_HIGH = 0x0607_0012
LENGTH_TOO_LOW = 0x0607_0013
INVALID_VALUE = 0x0609_0030
VALUE_TOO_HIGH = 0x0609_0031
WRONG_STATE = 0x0800_0022  # cannot be stored because of the present device state


class SdoAbort(Exception):
    """The server refuses an access; `code` goes to the client."""

    def __init__(self, code: int) -> None:
        super().__init__(f"SDO abort 0x{code:08X}")
        self.code = code


class ObjectStore:
    """Values by (index, subindex); reading and writing may run a hook of the drive."""

    def __init__(self, dictionary: canopen.ObjectDictionary, values: dict[Key, int]) -> None:
        self.dictionary = dictionary
        self.values: dict[Key, int] = dict(values)
        self.on_read: dict[Key, Callable[[], int | bytes]] = {}
        self.on_write: dict[Key, Callable[[int], None]] = {}
        self.on_domain: dict[Key, Callable[[bytes], None]] = {}

    def variable(self, key: Key) -> ODVariable:
        """Return an object's description; SdoAbort where there is none."""
        if key[0] not in self.dictionary:
            raise SdoAbort(NO_OBJECT)
        found = self.dictionary.get_variable(*key)
        if found is None:
            raise SdoAbort(NO_SUBINDEX)
        return found

    def number(self, key: Key) -> int:
        """Return the present value of a numeric object."""
        if key in self.on_read:
            return int(self.on_read[key]())
        value = self.values.get(key)
        return int(self.variable(key).default or 0) if value is None else int(value)

    def upload(self, key: Key) -> bytes:
        """Return an object as a client reads it."""
        variable = self.variable(key)
        if not variable.readable:
            raise SdoAbort(READ_OF_WRITE_ONLY)
        value = self.on_read[key]() if key in self.on_read else self.values.get(key, variable.default)
        if value is None:
            value = 0 if variable.fixed_size else b""
        return bytes(variable.encode_raw(value))

    def download(self, key: Key, data: bytes) -> None:
        """Take an object as a client writes it; the hook may refuse by SdoAbort, then the old value stays."""
        variable = self.variable(key)
        if not variable.writable:
            raise SdoAbort(WRITE_OF_READ_ONLY)
        if not variable.fixed_size:
            if key in self.on_domain:
                self.on_domain[key](data)
            return
        wanted = len(variable) // 8
        if len(data) != wanted:
            raise SdoAbort(LENGTH_TOO_HIGH if len(data) > wanted else LENGTH_TOO_LOW)
        value = variable.decode_raw(data)
        assert isinstance(value, int)
        if key in self.on_write:
            self.on_write[key](value)
        self.values[key] = value
