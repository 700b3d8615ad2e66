"""The host's SDO block client, as dialogues of bytes from CiA 301 with a scripted server."""

import binascii

import pytest

from robid_can.host.block import BlockClient, block_of, sequence
from robid_core import MotionAborted, MotionRefused


def crc(data: bytes) -> str:
    return binascii.crc_hqx(data, 0).to_bytes(2, "little").hex(" ")


@pytest.fixture
def client(scripted):
    return BlockClient(scripted.link, 1)


def test_upload_of_ten_bytes(scripted, client):
    data = bytes(range(10))
    scripted.bus.expect("601#a4 03 21 00 7f 00 00 00", "581#c6 03 21 00 0a 00 00 00")
    scripted.bus.expect(
        "601#a3 00 00 00 00 00 00 00", "581#01 00 01 02 03 04 05 06", "581#82 07 08 09 00 00 00 00"
    )
    scripted.bus.expect("601#a2 02 7f 00 00 00 00 00", f"581#d1 {crc(data)} 00 00 00 00 00")
    assert client.upload((0x2103, 0)) == data
    assert scripted.bus.sent[-1] == "601#a1 00 00 00 00 00 00 00"
    assert client.n_frame == 8


def test_upload_asks_again_from_the_last_segment_in_order(scripted, client):
    data = bytes(range(21))
    scripted.bus.expect("601#a4 03 21 00 7f 00 00 00", "581#c6 03 21 00 15 00 00 00")
    scripted.bus.expect(
        "601#a3 00 00 00 00 00 00 00", "581#01 00 01 02 03 04 05 06", "581#83 0e 0f 10 11 12 13 14"
    )
    scripted.bus.expect(
        "601#a2 01 7f 00 00 00 00 00", "581#01 07 08 09 0a 0b 0c 0d", "581#82 0e 0f 10 11 12 13 14"
    )
    scripted.bus.expect("601#a2 02 7f 00 00 00 00 00", f"581#c1 {crc(data)} 00 00 00 00 00")
    assert client.upload((0x2103, 0)) == data


def test_upload_waits_for_a_block_that_comes_in_pieces(scripted, client):
    data = bytes(range(14))
    scripted.bus.expect("601#a4 03 21 00 7f 00 00 00", "581#c6 03 21 00 0e 00 00 00")
    scripted.bus.expect("601#a3 00 00 00 00 00 00 00", "581#01 00 01 02 03 04 05 06")
    scripted.clock.at = [(0.04, "581#82 07 08 09 0a 0b 0c 0d")]
    scripted.bus.expect("601#a2 02 7f 00 00 00 00 00", f"581#c1 {crc(data)} 00 00 00 00 00")
    assert client.upload((0x2103, 0)) == data


def test_B01_upload_with_a_flipped_bit_is_refused_by_its_crc(scripted, client):
    data = bytes(7)
    scripted.bus.expect("601#a4 03 21 00 7f 00 00 00", "581#c6 03 21 00 07 00 00 00")
    scripted.bus.expect("601#a3 00 00 00 00 00 00 00", "581#81 00 00 00 00 00 00 01")
    scripted.bus.expect("601#a2 01 7f 00 00 00 00 00", f"581#c1 {crc(data)} 00 00 00 00 00")
    with pytest.raises(
        MotionRefused, match=r"B01: data of axis_1 \(node 1\) do not fit their CRC.*0x2103:00"
    ):
        client.upload((0x2103, 0))
    assert scripted.bus.sent[-1] == "601#80 03 21 00 04 00 04 05"  # abort: CRC error


def test_upload_of_another_size_than_announced_is_refused(scripted, client):
    data = bytes(7)
    scripted.bus.expect("601#a4 03 21 00 7f 00 00 00", "581#c6 03 21 00 08 00 00 00")
    scripted.bus.expect("601#a3 00 00 00 00 00 00 00", "581#81 00 00 00 00 00 00 00")
    scripted.bus.expect("601#a2 01 7f 00 00 00 00 00", f"581#c1 {crc(data)} 00 00 00 00 00")
    with pytest.raises(MotionRefused, match="announced 8 bytes and sent 7"):
        client.upload((0x2103, 0))


def test_abort_of_the_server_is_told_with_its_code(scripted, client):
    scripted.link.moving = True
    scripted.bus.expect("601#a4 03 21 00 7f 00 00 00", "581#80 03 21 00 24 00 00 08")
    with pytest.raises(MotionAborted, match=r"axis_1 \(node 1\) aborted with SDO code 0x08000024"):
        client.upload((0x2103, 0))


def test_B07_silence_ends_in_an_error_within_half_a_second(scripted, client):
    with pytest.raises(MotionRefused, match=r"B07: axis_1 \(node 1\) does not answer \(upload of 0x2103:00"):
        client.upload((0x2103, 0))
    assert scripted.clock.time <= 0.51


def test_download_of_ten_bytes(scripted, client):
    data = bytes(range(1, 11))
    scripted.bus.expect("601#c6 00 21 00 0a 00 00 00", "581#a4 00 21 00 7f 00 00 00")
    scripted.bus.expect("601#82 08 09 0a 00 00 00 00", "581#a2 02 7f 00 00 00 00 00")
    scripted.bus.expect(f"601#d1 {crc(data)} 00 00 00 00 00", "581#a1 00 00 00 00 00 00 00")
    client.download((0x2100, 0), data)
    assert scripted.bus.sent[1] == "601#01 01 02 03 04 05 06 07"


def test_download_keeps_to_the_servers_block_size_and_repeats_what_was_lost(scripted, client):
    data = bytes(range(21))
    scripted.bus.expect("601#c6 00 21 00 15 00 00 00", "581#a4 00 21 00 02 00 00 00")
    scripted.bus.expect("601#02 07 08 09 0a 0b 0c 0d", "581#a2 01 7f 00 00 00 00 00")  # the second was lost
    scripted.bus.expect("601#82 0e 0f 10 11 12 13 14", "581#a2 02 7f 00 00 00 00 00")
    scripted.bus.expect(f"601#c1 {crc(data)} 00 00 00 00 00", "581#a1 00 00 00 00 00 00 00")
    client.download((0x2100, 0), data)
    assert scripted.bus.sent[1:5] == [
        "601#01 00 01 02 03 04 05 06",
        "601#02 07 08 09 0a 0b 0c 0d",
        "601#01 07 08 09 0a 0b 0c 0d",
        "601#82 0e 0f 10 11 12 13 14",
    ]


@pytest.mark.parametrize("answer", ["a4 00 21 00 00 00 00 00", "a4 00 21 00 80 00 00 00"])
def test_download_gives_up_on_an_impossible_block_size(scripted, client, answer):
    scripted.bus.expect("601#c6 00 21 00 07 00 00 00", f"581#{answer}")
    with pytest.raises(MotionRefused, match="asks for blocks of"):
        client.download((0x2100, 0), bytes(7))
    assert scripted.bus.sent[-1] == "601#80 00 21 00 02 00 04 05"


def test_segments_lost_for_ever_end_in_an_error(scripted, client):
    scripted.bus.expect("601#c6 00 21 00 07 00 00 00", "581#a4 00 21 00 7f 00 00 00")
    for _ in range(30):
        scripted.bus.expect("601#81 00 00 00 00 00 00 00", "581#a2 00 7f 00 00 00 00 00")
    with pytest.raises(MotionRefused, match="B01: segments to axis_1"):
        client.download((0x2100, 0), bytes(7))


def test_segments_from_the_server_lost_for_ever_end_in_an_error(scripted, client):
    scripted.bus.expect("601#a4 03 21 00 7f 00 00 00", "581#c6 03 21 00 0e 00 00 00")
    scripted.bus.expect("601#a3 00 00 00 00 00 00 00", "581#82 00 00 00 00 00 00 00")
    for _ in range(30):
        scripted.bus.expect("601#a2 00 7f 00 00 00 00 00", "581#82 00 00 00 00 00 00 00")
    with pytest.raises(MotionRefused, match="B01: segments of axis_1"):
        client.upload((0x2103, 0))


def test_sequence_takes_segments_up_to_the_first_gap_or_the_last_of_the_transfer():
    payload = [bytes([n]) + bytes([n] * 7) for n in (1, 2, 4)]
    rows, last = sequence(payload)
    assert (len(rows), last) == (2, False)
    rows, last = sequence([payload[0], b"\x82" + bytes(7), payload[2]])
    assert (len(rows), last) == (2, True)
    rows, last = sequence([payload[0], b"\x02\x00"])
    assert (len(rows), last) == (1, False)  # a frame of 2 bytes is no segment


def test_blocks_put_together_are_the_data():
    data = bytes(range(256)) * 5
    parts, position = [], 0
    while position < len(data):
        segments = block_of(data, position, 127)
        rows, last = sequence(segments)
        parts.append(rows.tobytes())
        position += 7 * len(segments)
        assert last is (position >= len(data))
    assert b"".join(parts)[: len(data)] == data
