// The I/O images.
#include <nanobind/nanobind.h>

#include <vector>

#include "native.hpp"

namespace robotd {

namespace {
// The bytes that `get(data)` writes, called without the interpreter.
template <class Get>
nb::bytes bytes_of(const char *call, int length, Get get) {
    std::vector<unsigned char> data(length > 0 ? length : 0);
    {
        nb::gil_scoped_release unlocked;
        check(call, Api::Io, get(data.data()));
    }
    return nb::bytes(reinterpret_cast<char *>(data.data()), data.size());
}

nb::bytes read_inputs(Device &device, int address, int length) {
    return bytes_of("GetInBytesEx", length, [&](unsigned char *data) {
        return device.io.GetInBytesEx(address, length, data);
    });
}

nb::bytes read_outputs(Device &device, int address, int length) {
    return bytes_of("GetOutBytesEx", length, [&](unsigned char *data) {
        return device.io.GetOutBytesEx(address, length, data);
    });
}

void write_outputs(Device &device, int address, nb::bytes data) {
    const char *first = data.c_str();
    std::vector<unsigned char> copy(first, first + data.size());
    nb::gil_scoped_release unlocked;
    check("SetOutBytesEx", Api::Io,
          device.io.SetOutBytesEx(address, static_cast<int>(copy.size()), copy.data()));
}
}  // namespace

void bind_io(nb::class_<Device> &device) {
    device.def("read_inputs", &read_inputs)
        .def("read_outputs", &read_outputs)
        .def("write_outputs", &write_outputs)
        .def("write_output_bit", [](Device &self, int address, int bit, bool value) {
            check("SetOutBitEx", Api::Io, self.io.SetOutBitEx(address, bit, value));
        }, Unlocked());
}

}  // namespace robotd
