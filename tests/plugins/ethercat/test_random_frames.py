"""Random frames: the simulated slaves stay usable whatever arrives."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
from tests.plugins.ethercat.line_master import LineMaster, frame_of, master_of

from robotd_ethercat.simulated import registers as reg
from robotd_ethercat.simulated.datagrams import MAX_FRAME, Command

ADDRESSES = st.one_of(
    st.sampled_from([0, 0xFFFF, 0x1001, reg.FMMU, reg.SYNC_MANAGER, reg.AL_CONTROL, 0x1000]),
    st.integers(0, 0xFFFF),
)
DATAGRAMS = st.lists(
    st.tuples(st.integers(0, 16), ADDRESSES, ADDRESSES, st.binary(max_size=300)),
    min_size=1,
    max_size=4,
)


def usable(master: LineMaster) -> None:
    master.line.tick(master.now_ns)
    for slave in range(2):
        assert master.do(Command.APWR, -slave, reg.AL_CONTROL, b"\x11\x00").counter == 1
        assert master.read(slave, reg.AL_STATUS) == 1


@given(data=st.binary(max_size=MAX_FRAME))
def test_random_bytes(data: bytes) -> None:
    master = master_of(2)
    master.send(data)
    master.send(frame_of()[:16] + data[: MAX_FRAME - 16])
    usable(master)


@given(first=DATAGRAMS, second=DATAGRAMS)
def test_random_datagrams(
    first: list[tuple[int, int, int, bytes]], second: list[tuple[int, int, int, bytes]]
) -> None:
    master = master_of(2)
    for datagrams in (first, second):
        master.exchange(*datagrams)
        master.line.tick(master.now_ns)
    usable(master)
