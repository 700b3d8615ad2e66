"""The drive's SDO server, as dialogues of bytes from CiA 301 (section on the SDO protocol)."""

import binascii
import struct

import pytest
from hypothesis import given, settings, strategies as st

from robid_can.dictionary import virtual_drive_dictionary
from robid_can.drive.objects import ObjectStore
from robid_can.drive.sdo_server import SdoServer


class Dialogue:
    """A server over the virtual drive's dictionary, spoken to in hexadecimal."""

    def __init__(self, trace: bytes = b"") -> None:
        self.objects = ObjectStore(virtual_drive_dictionary(), {(0x1018, 4): 0x0A0B0C0D})
        self.objects.on_read[0x2103, 0] = lambda: trace
        self.loaded: list[bytes] = []
        self.objects.on_domain[0x2100, 0] = self.loaded.append
        self.answers: list[bytes] = []
        self.server = SdoServer(self.objects, self.answers.extend)

    def say(self, *requests: str) -> list[str]:
        self.answers.clear()
        self.server.receive([bytes.fromhex(request) for request in requests])
        return [answer.hex(" ") for answer in self.answers]


def test_expedited_upload_tells_how_many_bytes_count():
    dialogue = Dialogue()
    assert dialogue.say("40 18 10 04 00 00 00 00") == ["43 18 10 04 0d 0c 0b 0a"]  # UNSIGNED32
    assert dialogue.say("40 17 10 00 00 00 00 00") == ["4b 17 10 00 00 00 00 00"]  # UNSIGNED16
    assert dialogue.say("40 18 10 00 00 00 00 00") == ["4f 18 10 00 04 00 00 00"]  # UNSIGNED8


def test_expedited_download_is_confirmed_and_read_back():
    dialogue = Dialogue()
    assert dialogue.say("2b 17 10 00 64 00 00 00") == ["60 17 10 00 00 00 00 00"]
    assert dialogue.say("40 17 10 00 00 00 00 00") == ["4b 17 10 00 64 00 00 00"]
    assert dialogue.say("22 7a 60 00 fe ff ff ff") == ["60 7a 60 00 00 00 00 00"]  # size not stated
    assert dialogue.objects.number((0x607A, 0)) == -2


def test_segmented_upload_alternates_the_toggle_bit():
    dialogue = Dialogue()  # "robid virtual drive" has 19 characters
    assert dialogue.say("40 08 10 00 00 00 00 00") == ["41 08 10 00 13 00 00 00"]
    assert dialogue.say("60 00 00 00 00 00 00 00") == ["00 72 6f 62 69 64 20 76"]
    assert dialogue.say("70 00 00 00 00 00 00 00") == ["10 69 72 74 75 61 6c 20"]
    assert dialogue.say("60 00 00 00 00 00 00 00") == ["05 64 72 69 76 65 00 00"]  # 2 unused, last


def test_segmented_upload_with_a_wrong_toggle_is_aborted():
    dialogue = Dialogue()
    dialogue.say("40 08 10 00 00 00 00 00")
    assert dialogue.say("70 00 00 00 00 00 00 00") == ["80 08 10 00 00 00 03 05"]


def test_segmented_download_is_confirmed_segment_by_segment():
    dialogue = Dialogue()
    assert dialogue.say("21 00 21 00 08 00 00 00") == ["60 00 21 00 00 00 00 00"]
    assert dialogue.say("00 01 02 03 04 05 06 07") == ["20 00 00 00 00 00 00 00"]
    assert dialogue.say("1d 08 00 00 00 00 00 00") == ["30 00 00 00 00 00 00 00"]
    assert dialogue.loaded == [bytes(range(1, 9))]


@pytest.mark.parametrize(
    ("request_bytes", "code"),
    [
        ("40 99 99 00 00 00 00 00", "00 00 02 06"),  # no such object
        ("40 18 10 09 00 00 00 00", "11 00 09 06"),  # no such subindex
        ("40 00 21 00 00 00 00 00", "01 00 01 06"),  # read of a write-only object
        ("2f 41 60 00 01 00 00 00", "02 00 01 06"),  # write of a read-only object
        ("2f 17 10 00 01 00 00 00", "13 00 07 06"),  # too short
        ("23 17 10 00 01 00 00 00", "12 00 07 06"),  # too long
        ("e0 17 10 00 01 00 00 00", "01 00 04 05"),  # no command
        ("c6 00 21 00 ff ff ff ff", "05 00 04 05"),  # 4 GiB announced
    ],
)
def test_refused_access_names_its_reason(request_bytes, code):
    index = " ".join(request_bytes.split()[1:4])
    assert Dialogue().say(request_bytes) == [f"80 {index} {code}"]


def test_block_upload_of_ten_bytes():
    data = bytes(range(10))
    dialogue = Dialogue(data)
    assert dialogue.say("a4 03 21 00 7f 00 00 00") == ["c6 03 21 00 0a 00 00 00"]
    assert dialogue.say("a3 00 00 00 00 00 00 00") == ["01 00 01 02 03 04 05 06", "82 07 08 09 00 00 00 00"]
    crc = binascii.crc_hqx(data, 0).to_bytes(2, "little").hex(" ")
    assert dialogue.say("a2 02 7f 00 00 00 00 00") == [f"d1 {crc} 00 00 00 00 00"]  # 4 of 7 unused
    assert dialogue.say("a1 00 00 00 00 00 00 00") == []
    assert dialogue.say("40 17 10 00 00 00 00 00") == ["4b 17 10 00 00 00 00 00"]  # ready again


def test_crc_is_the_one_of_the_standard():
    # CiA 301: x^16 + x^12 + x^5 + 1 from 0; the check value over "123456789" is 0x31C3
    dialogue = Dialogue(b"123456789")
    dialogue.say("a4 03 21 00 7f 00 00 00")
    dialogue.say("a3 00 00 00 00 00 00 00")
    assert dialogue.say("a2 02 7f 00 00 00 00 00") == ["d5 c3 31 00 00 00 00 00"]


def test_lost_segments_of_an_upload_are_sent_again_from_the_acknowledged_one():
    dialogue = Dialogue(bytes(range(28)))
    dialogue.say("a4 03 21 00 04 00 00 00")
    first = dialogue.say("a3 00 00 00 00 00 00 00")
    assert [answer[:2] for answer in first] == ["01", "02", "03", "84"]
    again = dialogue.say("a2 01 04 00 00 00 00 00")  # only the first arrived
    assert again == ["01 07 08 09 0a 0b 0c 0d", "02 0e 0f 10 11 12 13 14", "83 15 16 17 18 19 1a 1b"]
    assert dialogue.say("a2 03 04 00 00 00 00 00")[0].startswith("c1 ")


def test_block_sizes_outside_1_to_127_are_refused():
    dialogue = Dialogue(bytes(9))
    assert dialogue.say("a4 03 21 00 00 00 00 00") == ["80 03 21 00 02 00 04 05"]
    assert dialogue.say("a4 03 21 00 80 00 00 00") == ["80 03 21 00 02 00 04 05"]


def block_download(data: bytes) -> list[str]:
    segments = [data[i : i + 7] for i in range(0, len(data), 7)]
    lines = [bytes([number + 1]) + part.ljust(7, b"\0") for number, part in enumerate(segments)]
    lines[-1] = bytes([lines[-1][0] | 0x80]) + lines[-1][1:]
    return [line.hex(" ") for line in lines]


def test_block_download_of_ten_bytes():
    data = bytes(range(1, 11))
    crc = binascii.crc_hqx(data, 0).to_bytes(2, "little").hex(" ")
    dialogue = Dialogue()
    assert dialogue.say("c6 00 21 00 0a 00 00 00") == ["a4 00 21 00 7f 00 00 00"]
    assert dialogue.say("01 01 02 03 04 05 06 07", "82 08 09 0a 00 00 00 00") == ["a2 02 7f 00 00 00 00 00"]
    assert dialogue.say(f"d1 {crc} 00 00 00 00 00") == ["a1 00 00 00 00 00 00 00"]
    assert dialogue.loaded == [data]


def test_block_download_with_a_wrong_crc_is_not_taken():
    dialogue = Dialogue()
    dialogue.say("c6 00 21 00 07 00 00 00")
    dialogue.say("81 01 02 03 04 05 06 07")
    assert dialogue.say("c1 00 00 00 00 00 00 00") == ["80 00 21 00 04 00 04 05"]
    assert dialogue.loaded == []


def test_download_of_another_size_than_announced_is_not_taken():
    dialogue = Dialogue()
    dialogue.say("c6 00 21 00 08 00 00 00")
    dialogue.say("81 01 02 03 04 05 06 07")
    crc = binascii.crc_hqx(bytes(range(1, 8)), 0).to_bytes(2, "little").hex(" ")
    assert dialogue.say(f"c1 {crc} 00 00 00 00 00") == ["80 00 21 00 10 00 07 06"]
    dialogue.say("21 00 21 00 08 00 00 00")
    assert dialogue.say("01 01 02 03 04 05 06 07") == ["80 00 21 00 10 00 07 06"]
    assert dialogue.loaded == []


def test_block_download_acknowledges_only_what_came_in_order():
    dialogue = Dialogue()
    dialogue.say("c6 00 21 00 15 00 00 00")
    lines = block_download(bytes(range(21)))
    assert dialogue.say(lines[0], lines[2]) == ["a2 01 7f 00 00 00 00 00"]  # the second was lost
    rest = block_download(bytes(range(7, 21)))
    assert dialogue.say(*rest) == ["a2 02 7f 00 00 00 00 00"]
    crc = binascii.crc_hqx(bytes(range(21)), 0).to_bytes(2, "little").hex(" ")
    assert dialogue.say(f"c1 {crc} 00 00 00 00 00") == ["a1 00 00 00 00 00 00 00"]
    assert dialogue.loaded == [bytes(range(21))]


def test_client_can_give_up_in_the_middle_of_a_block():
    dialogue = Dialogue()
    dialogue.say("c6 00 21 00 0e 00 00 00")
    assert dialogue.say("01 01 02 03 04 05 06 07", "80 00 21 00 00 00 00 08") == []
    assert dialogue.say("40 17 10 00 00 00 00 00") == ["4b 17 10 00 00 00 00 00"]


def test_bursts_may_be_cut_anywhere():
    data = bytes(range(200)) * 6  # 1200 bytes: 172 segments, two blocks
    dialogue = Dialogue()
    dialogue.say("c6 00 21 00 b0 04 00 00")
    first, second = data[: 127 * 7], data[127 * 7 :]
    lines = block_download(first)
    lines[-1] = "7f" + lines[-1][2:]  # the block ends, the transfer does not
    assert dialogue.say(*lines[:50]) == []
    assert dialogue.say(*lines[50:]) == ["a2 7f 7f 00 00 00 00 00"]
    rest = block_download(second)
    assert dialogue.say(*rest) == [f"a2 {len(rest):02x} 7f 00 00 00 00 00"]
    unused = -len(second) % 7
    end = struct.pack("<BH5x", 0xC1 | unused << 2, binascii.crc_hqx(data, 0))
    assert dialogue.say(end.hex()) == ["a1 00 00 00 00 00 00 00"]
    assert dialogue.loaded == [data]


@settings(max_examples=150, deadline=None)
@given(st.lists(st.binary(min_size=0, max_size=8), max_size=40))
def test_no_sequence_of_frames_breaks_the_server(frames):
    dialogue = Dialogue(bytes(100))
    dialogue.server.receive(frames)
    for frame in frames:
        dialogue.server.receive([frame])
    assert all(len(answer) == 8 for answer in dialogue.answers)
    dialogue.say("80 00 00 00 00 00 00 00", "80 00 00 00 00 00 00 00")
    assert dialogue.say("40 18 10 04 00 00 00 00") == ["43 18 10 04 0d 0c 0b 0a"]  # still serves
