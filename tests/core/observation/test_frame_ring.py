from __future__ import annotations

import threading

import numpy as np
import pytest
from tests.features.recorder.frames import write_frame

from robotd.device.process_image import ProcessImage
from robotd.events import MAX_BYTES as EVENT_BYTES
from robotd.observation.frame_ring import HEADER, MEMORY_BYTES, FrameRing
from robotd.observation.io_sampler import QUEUE_BYTES
from robotd.observation.tap import MAX_MEMORY_BYTES, SAMPLE_BYTES


def test_a_frame_holds_every_value_of_the_image() -> None:
    image = ProcessImage(3)
    ring = FrameRing(image.axes, 500.0, 1.0)
    image.position[:] = 1.0, 2.0, 3.0
    image.torque[1] = -4.0
    image.setpoint[0, 2] = 0.25
    image.alarm_code[1], image.mode[0], image.operation[2] = 0x8611, 1, 3
    image.amp_alarm[1] = image.servo_on[0] = True
    header = {name: 11 + number for number, name in enumerate(HEADER)}
    write_frame(ring, image, **header)
    frame = ring.since(0)[0][0]
    assert {name: int(frame[name]) for name in HEADER} == header
    np.testing.assert_array_equal(frame["values"], image.values)
    np.testing.assert_array_equal(frame["setpoint"], image.setpoint)
    np.testing.assert_array_equal(frame["numbers"], image.numbers)
    np.testing.assert_array_equal(frame["flags"], image.flags)


def test_only_new_frames_are_returned_and_lost_ones_are_counted() -> None:
    image = ProcessImage(1)
    ring = FrameRing(image.axes, 10.0, 1.0)  # ten frames
    for number in range(4):
        write_frame(ring, image, start_ns=number)
    frames, cursor, lost = ring.since(0)
    assert ([*frames["start_ns"]], cursor, lost) == ([0, 1, 2, 3], 4, 0)
    for number in range(4, 20):
        write_frame(ring, image, start_ns=number)
    frames, cursor, lost = ring.since(cursor)
    assert ([*frames["start_ns"]], cursor, lost) == ([*range(11, 20)], 20, 7)
    assert len(ring.since(cursor)[0]) == 0


def test_the_newest_frame_comes_with_the_largest_lateness_since_the_last_one() -> None:
    image = ProcessImage(2)
    ring = FrameRing(image.axes, 10.0, 1.0)  # ten frames
    assert ring.newest(0) is None
    for number, late_ns in enumerate((5, 90, 7, 8, 6, 1, 2, 3, 4, 80, 3, 2, 1)):
        image.position[:] = number
        write_frame(ring, image, start_ns=number, late_ns=late_ns)
    newest = ring.newest(10)
    assert newest is not None
    assert (newest.cursor, newest.start_ns, newest.late_ns) == (13, 12, 3)
    assert newest.values == image.values.tobytes()
    assert ring.newest(13) is None
    for cursor in (9, 2, 0):  # around the end of the ring; the 90 was overwritten
        newest = ring.newest(cursor)
        assert newest is not None
        assert newest.late_ns == 80


@pytest.mark.parametrize(("axes", "rate_hz"), [(6, 500.0), (12, 1000.0), (128, 2000.0)])
def test_frames_and_events_take_at_most_22_mib(axes: int, rate_hz: float) -> None:
    ring = FrameRing(axes, rate_hz, 30.0)
    assert ring.nbytes <= MEMORY_BYTES
    used = ring.nbytes + EVENT_BYTES + SAMPLE_BYTES + QUEUE_BYTES
    assert used <= MAX_MEMORY_BYTES == 22 * 2**20
    if axes == 6:
        assert ring.capacity == 15000  # all 30 s


def test_a_reader_beside_the_writer_never_gets_a_torn_frame() -> None:
    image = ProcessImage(4)
    ring = FrameRing(image.axes, 100.0, 1.0)
    end = threading.Event()

    def run() -> None:
        number = 0
        while not end.is_set():
            number += 1
            image.values[:] = number
            write_frame(ring, image, start_ns=number)

    thread = threading.Thread(target=run)
    thread.start()
    cursor, seen = 0, 0
    try:
        while seen < 2000:
            frames, cursor, _ = ring.since(cursor)
            seen += len(frames)
            np.testing.assert_array_equal(frames["values"][:, 4, 3], frames["start_ns"])
            assert (np.diff(frames["start_ns"]) == 1).all()
    finally:
        end.set()
        thread.join()


def test_a_copy_of_the_image_has_memory_of_its_own() -> None:
    image = ProcessImage(2)
    image.position[:] = 1.0
    twin = image.copy()
    image.position[:] = 2.0
    image.servo_on[0] = True
    assert [*twin.position] == [1.0, 1.0]
    assert not twin.servo_on.any()
