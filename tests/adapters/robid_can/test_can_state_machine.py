"""The power drive state machine, against tables written down here from CiA 402-2."""

import itertools

import pytest
from hypothesis import given, strategies as st

from robid_can.drive.state_machine import State, follow, statusword
from robid_can.host import state as host

# CiA 402-2, figure of the state machine: (state, command) -> (next state, transition); every pair that is not
# here changes nothing. "switch on" in ready to switch on with bit 3 set goes on to operation enabled (3 and 4).
TRANSITIONS = {
    ("SWITCH_ON_DISABLED", "shutdown"): "READY_TO_SWITCH_ON",  # 2
    ("READY_TO_SWITCH_ON", "switch on"): "SWITCHED_ON",  # 3
    ("READY_TO_SWITCH_ON", "enable operation"): "OPERATION_ENABLED",  # 3 and 4
    ("READY_TO_SWITCH_ON", "disable voltage"): "SWITCH_ON_DISABLED",  # 7
    ("READY_TO_SWITCH_ON", "quick stop"): "SWITCH_ON_DISABLED",  # 7
    ("SWITCHED_ON", "enable operation"): "OPERATION_ENABLED",  # 4
    ("SWITCHED_ON", "shutdown"): "READY_TO_SWITCH_ON",  # 6
    ("SWITCHED_ON", "disable voltage"): "SWITCH_ON_DISABLED",  # 10
    ("SWITCHED_ON", "quick stop"): "SWITCH_ON_DISABLED",  # 10
    ("OPERATION_ENABLED", "switch on"): "SWITCHED_ON",  # 5, there called disable operation
    ("OPERATION_ENABLED", "shutdown"): "READY_TO_SWITCH_ON",  # 8
    ("OPERATION_ENABLED", "disable voltage"): "SWITCH_ON_DISABLED",  # 9
    ("OPERATION_ENABLED", "quick stop"): "QUICK_STOP_ACTIVE",  # 11
    ("QUICK_STOP_ACTIVE", "disable voltage"): "SWITCH_ON_DISABLED",  # 12
    ("FAULT", "fault reset"): "SWITCH_ON_DISABLED",  # 15
}

# CiA 402-2, table of the command coding, bits 7, 3, 2, 1, 0; x does not matter. Fault reset is a rising edge.
COMMANDS = {
    "shutdown": "0x110",
    "switch on": "00111",
    "enable operation": "01111",
    "disable voltage": "0xx0x",
    "quick stop": "0x01x",
}


def command_of(controlword: int, previous: int) -> str | None:
    if controlword & 0x80:
        return None if previous & 0x80 else "fault reset"
    bits = "".join(str(controlword >> bit & 1) for bit in (7, 3, 2, 1, 0))
    matching = [
        name
        for name, pattern in COMMANDS.items()
        if all(wanted in ("x", bit) for wanted, bit in zip(pattern, bits, strict=True))
    ]
    assert len(matching) == 1  # the table is complete and without ambiguity
    return matching[0]


@pytest.mark.parametrize("name", [state.name for state in State])
def test_every_controlword_in_every_state_does_what_the_table_says(name):
    state = State[name]
    for controlword, previous in itertools.product(range(256), (0x00, 0x0F, 0x80, 0x8F)):
        command = command_of(controlword, previous)
        expected = TRANSITIONS.get((name, command), name)
        assert follow(state, controlword, previous).name == expected, (hex(controlword), hex(previous))


@given(st.sampled_from(list(State)), st.integers(0, 255), st.integers(0, 0xFF))
def test_bits_of_mode_and_maker_do_not_touch_the_state(state, controlword, high_byte):
    assert follow(state, controlword | high_byte << 8, 0) is follow(state, controlword, 0)
    assert follow(state, controlword ^ 0x70, 0) is follow(state, controlword, 0)


@pytest.mark.parametrize("option", range(-2, 9))
def test_operation_resumes_after_quick_stop_only_where_the_option_says_that_it_stays(option):
    expected = State.OPERATION_ENABLED if option in (5, 6, 7, 8) else State.QUICK_STOP_ACTIVE  # 16
    assert follow(State.QUICK_STOP_ACTIVE, 0x0F, 0x02, option) is expected


# CiA 402-2, table of the statusword: pattern of bits 6, 5, 3, 2, 1, 0
STATUSWORD = {
    "NOT_READY_TO_SWITCH_ON": "0x0000",
    "SWITCH_ON_DISABLED": "1x0000",
    "READY_TO_SWITCH_ON": "010001",
    "SWITCHED_ON": "010011",
    "OPERATION_ENABLED": "010111",
    "QUICK_STOP_ACTIVE": "000111",
    "FAULT_REACTION_ACTIVE": "0x1111",
    "FAULT": "0x1000",
}


def states_shown(word: int) -> list[str]:
    bits = "".join(str(word >> bit & 1) for bit in (6, 5, 3, 2, 1, 0))
    return [
        name
        for name, pattern in STATUSWORD.items()
        if all(wanted in ("x", bit) for wanted, bit in zip(pattern, bits, strict=True))
    ]


@pytest.mark.parametrize("name", list(STATUSWORD))
def test_drive_shows_its_state_as_the_table_says(name):
    for reached, acknowledge in itertools.product((False, True), repeat=2):
        word = statusword(State[name], target_reached=reached, acknowledge=acknowledge)
        assert states_shown(word) == [name]
        assert bool(word & 1 << 10) is reached
        assert bool(word & 1 << 12) is acknowledge


def test_host_reads_every_statusword_as_the_table_says_and_the_rest_as_no_state():
    for word in range(0x80):
        shown = states_shown(word)
        expected = shown[0].lower().replace("_", " ") if shown else None
        assert host.state_of(word) == expected, hex(word)
        assert host.state_of(word | 0xFF90) == expected  # bits that carry no state


def test_host_leads_every_drive_that_is_not_in_fault_to_operation_enabled():
    for start in (State.SWITCH_ON_DISABLED, State.READY_TO_SWITCH_ON, State.SWITCHED_ON):
        drive, steps = start, 0
        while drive is not State.OPERATION_ENABLED:
            controlword = host.towards_enabled(host.state_of(drive.value))
            assert controlword is not None
            drive, steps = follow(drive, controlword, 0), steps + 1
            assert steps <= 3


def test_host_knows_no_way_out_of_a_fault():
    assert host.towards_enabled(host.FAULT) is None
    assert host.towards_enabled(None) is None
