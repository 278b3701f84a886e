from hypothesis import given
from hypothesis import strategies as st

from robotd_cia402.controlword import TOWARDS_ENABLED, DriveState, drive_state
from robotd_cia402.simulated.drive import TRANSITIONS, SimulatedState, command


@given(st.integers(0, 0xFFFF))
def test_bits_beside_the_state_do_not_change_it(word: int) -> None:
    assert drive_state(word) is drive_state(word & 0x6F)


def test_the_states_of_the_standard() -> None:
    words = {
        0x0000: DriveState.NOT_READY_TO_SWITCH_ON,
        0x0240: DriveState.SWITCH_ON_DISABLED,
        0x0221: DriveState.READY_TO_SWITCH_ON,
        0x0233: DriveState.SWITCHED_ON,
        0x1637: DriveState.OPERATION_ENABLED,
        0x0217: DriveState.QUICK_STOP_ACTIVE,
        0x021F: DriveState.FAULT_REACTION_ACTIVE,
        0x0218: DriveState.FAULT,
    }
    assert {word: drive_state(word) for word in words} == words


def test_the_table_leads_a_drive_from_anywhere_to_operation() -> None:
    """Two tables that were written apart: the master's and the simulated drive's."""
    for start in SimulatedState:
        if drive_state(start.value) not in TOWARDS_ENABLED:
            continue
        state = start
        for _ in range(4):
            word = TOWARDS_ENABLED[drive_state(state.value)]
            state = TRANSITIONS.get((state, command(word)), state)
        assert state is SimulatedState.OPERATION_ENABLED, start
