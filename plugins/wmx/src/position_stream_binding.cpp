// PositionStream for Python.
#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "position_stream.hpp"

namespace robotd {

namespace {
using Numbers = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Values = std::vector<double>;
}  // namespace

void bind_position_stream(nb::module_ &module) {
    nb::class_<PositionStream>(module, "PositionStream")
        .def("__init__", [](PositionStream *self, Device &device, Values units, Values velocity,
                            Values acceleration, double period_s, double buffer_s, int priority, bool threaded) {
            std::vector<AxisLimits> limits;
            for (std::size_t axis = 0; axis < units.size(); axis++)
                limits.push_back({velocity.at(axis), acceleration.at(axis)});
            new (self) PositionStream(device, {std::move(units), std::move(limits), period_s,
                                               buffer_s, priority, threaded});
        }, nb::keep_alive<1, 2>(), nb::arg(), nb::arg(), nb::arg(), nb::arg(), nb::arg(), nb::arg(),
           nb::arg(), nb::arg("threaded") = true)
        .def("begin", &PositionStream::begin, Unlocked())
        .def("put", [](PositionStream &self, Numbers position, Numbers velocity, long long due_ns) {
            if (position.shape(0) != self.axes() || velocity.shape(0) != self.axes())
                throw nb::value_error("arrays must have one shape (n_axes,)");
            self.put(position.data(), velocity.data(), due_ns);
        })
        .def("ran_dry", &PositionStream::ran_dry)
        .def("stop", &PositionStream::stop, Unlocked())
        .def("quick_stop", &PositionStream::quick_stop, Unlocked())
        .def("close", &PositionStream::close, Unlocked())
        .def("turn", &PositionStream::turn, Unlocked())
        .def("active", &PositionStream::active)
        .def("stopping", &PositionStream::stopping)
        .def_prop_ro("fault", &PositionStream::fault)
        .def_prop_ro("rate", &PositionStream::rate);
}

}  // namespace robotd
