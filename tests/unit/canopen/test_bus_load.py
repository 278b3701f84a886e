from robotd_canopen.bus_load import bus_load, frame_bits


def test_worst_case_bits_of_a_frame() -> None:
    assert frame_bits(0) == 55  # 47 + 33 // 4
    assert frame_bits(8) == 135  # the figure of the literature for eight bytes


def test_a_full_second_of_frames_is_the_whole_bus() -> None:
    frames = 125_000 / frame_bits(8)
    load = bus_load([(8, frames)], 1.0, 0, 1.0, 125_000)
    assert abs(load - 1.0 - frame_bits(0) / 125_000) < 1e-9
