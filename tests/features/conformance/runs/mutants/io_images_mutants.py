"""Mutants: parts of images, changes together, and images that are live only at times."""

from __future__ import annotations

import time

from tests.features.conformance.runs.mutants.plugin import Mutant

from robotd_sim import SimIo


class LongReadsFromAnEvenAddress(Mutant):
    breaks = ("IoDriver.read_outputs/bytes", "wrong value")
    found_by = "test_io_images.py::test_parts_of_all_lengths_are_those_of_the_whole"
    says = "read_outputs"

    class Io(SimIo):
        def read_outputs(self, byte: int, length: int) -> bytes:
            even = byte - byte % 2 if length == 7 else byte
            return super().read_outputs(even, length)


class FiveInputsByTheirWord(Mutant):
    breaks = ("IoDriver.read_inputs/bytes", "wrong value")
    found_by = "test_io_images.py::test_parts_of_all_lengths_are_those_of_the_whole"
    says = "read_inputs"

    class Io(SimIo):
        def read_inputs(self, byte: int, length: int) -> bytes:
            return super().read_inputs(byte & ~3 if length == 5 else byte, length)


class SixteenBytesAtMost(Mutant):
    breaks = ("IoDriver.write_outputs/bytes", "ignored")
    found_by = "test_io_images.py::test_writes_of_all_lengths_change_their_bytes_alone"
    says = "outputs from byte|bytes at"

    class Io(SimIo):
        def write_outputs(self, byte: int, data: bytes) -> None:
            whole = len(data) == self.output_bytes
            super().write_outputs(byte, data if whole else data[:16])


class FirstChangedInputOnly(Mutant):
    """Of inputs that change together, those after the first are shown when they change again."""

    breaks = ("IoDriver.read_inputs/bytes", "stale")
    found_by = "test_io_images.py::test_inputs_that_change_together_are_all_shown"
    says = "of all bytes has changed"

    class Io(SimIo):
        def read_inputs(self, byte: int, length: int) -> bytes:
            now = super().read_inputs(0, self.input_bytes)
            shown = self.__dict__.setdefault("shown", bytearray(now))
            last = self.__dict__.get("last", now)
            for at, (old, new) in enumerate(zip(last, now, strict=True)):
                if old != new:
                    shown[at] = new
                    break
            self.__dict__["last"] = now
            return bytes(shown[byte : byte + length])


class LiveWhenRead(Mutant):
    breaks = ("IoDriver.live/images", "stale")
    found_by = "test_io_images.py::test_live_images_change_though_nobody_reads"
    says = "is live"

    class Io(SimIo):
        @property
        def live(self) -> tuple[memoryview, memoryview]:
            images = self.__dict__.setdefault(
                "images", (bytearray(self.input_bytes), bytearray(self.output_bytes))
            )
            return memoryview(images[0]), memoryview(images[1])

        def read_inputs(self, byte: int, length: int) -> bytes:
            _ = self.live
            self.__dict__["images"][0][:] = super().read_inputs(0, self.input_bytes)
            return super().read_inputs(byte, length)

        def read_outputs(self, byte: int, length: int) -> bytes:
            _ = self.live
            self.__dict__["images"][1][:] = super().read_outputs(0, self.output_bytes)
            return super().read_outputs(byte, length)


class BitsRewriteTheirWord(Mutant):
    breaks = ("IoDriver.write_output_bit/bit", "side effect")
    found_by = "test_io_images.py::test_a_byte_is_written_while_bits_beside_it_are"
    says = "overwritten by bits|outputs from byte"

    class Io(SimIo):
        def write_output_bit(self, byte: int, bit: int, value: bool) -> None:
            before = super().read_outputs(byte - 1, 1) if byte else b""
            time.sleep(0.0005)
            super().write_output_bit(byte, bit, value)
            if before:
                super().write_outputs(byte - 1, before)


class BitsOfTheSecondModuleShifted(Mutant):
    breaks = ("IoDriver.write_output_bit/bit", "wrong value")
    found_by = "test_io_images.py::test_bits_are_written_at_the_address_of_each_module"
    says = "shows it|outputs from byte"

    class Io(SimIo):
        def write_output_bit(self, byte: int, bit: int, value: bool) -> None:
            super().write_output_bit(byte ^ 1 if 8 <= byte < 16 else byte, bit, value)
