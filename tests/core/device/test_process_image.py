"""What the process image shows besides its arrays."""

from __future__ import annotations

import pytest

from robotd.device.process_image import FLAGS, NUMBERS, ProcessImage


@pytest.mark.parametrize("axes", [1, 2, 6, 7])
def test_the_states_change_with_flags_and_numbers_of_any_axis_only(axes: int) -> None:
    image = ProcessImage(axes)
    before = image.states.tobytes()
    image.values[:] = image.setpoint[:] = image.stamp_ns = image.fresh_ns = 1
    image.header[0] = 1
    assert image.states.tobytes() == before
    for name in (*FLAGS, *NUMBERS):
        for axis in range(axes):
            before = image.states.tobytes()
            getattr(image, name)[axis] = not getattr(image, name)[axis]
            assert image.states.tobytes() != before, (name, axis)
