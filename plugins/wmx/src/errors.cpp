// Error codes: their names in this SDK, their texts, and the exception. error_names.inc is made
// from the table of the codes when the binding is built: a line CODE(api, class, name) for each.
#include "native.hpp"

#if ROBOTD_CYCLIC_BUFFER
#include <CyclicBufferApi.h>
#endif

namespace robotd {

namespace {
using namespace wmx3Api;
using ecApi::EcErrorCode;

// The number of an enumerator, -1 where this SDK has none of that name.
#define CODE(api, type, name)                         \
    template <class E, int value = E::name>           \
    constexpr int find_##type##_##name(int) {         \
        return value;                                 \
    }                                                 \
    template <class E>                                \
    constexpr int find_##type##_##name(...) {         \
        return -1;                                    \
    }
#include "error_names.inc"
#undef CODE

struct Name {
    Api api;
    int code;
    const char *name;
};
const Name NAMES[] = {
#define CODE(api, type, name) {Api::api, find_##type##_##name<type>(0), #name},
#include "error_names.inc"
#undef CODE
};

const char *const API_NAMES[] = {"engine", "core motion", "advanced motion", "io", "ecat",
                                 "cyclic buffer"};

std::string text(Api api, int code) {
    char buffer[256] = {};
    switch (api) {
        case Api::Engine: WMX3Api::ErrorToString(code, buffer, sizeof buffer); break;
        case Api::CoreMotion: CoreMotion::ErrorToString(code, buffer, sizeof buffer); break;
        case Api::AdvancedMotion: AdvancedMotion::ErrorToString(code, buffer, sizeof buffer); break;
        case Api::Io: Io::ErrorToString(code, buffer, sizeof buffer); break;
        case Api::Ecat: ecApi::Ecat::ErrorToString(code, buffer, sizeof buffer); break;
        case Api::CyclicBuffer:
#if ROBOTD_CYCLIC_BUFFER
            CyclicBuffer::ErrorToString(code, buffer, sizeof buffer);
#endif
            break;
    }
    buffer[sizeof buffer - 1] = 0;
    return buffer;
}

// Codes that only an advanced class knows are core motion's or the engine's as well.
bool inherits(Api api, Api base) {
    return api == base || base == Api::Engine ||
           (api == Api::AdvancedMotion && base == Api::CoreMotion);
}

const char *name_of(Api api, int code) {
    for (const Name &name : NAMES)
        if (name.code == code && inherits(api, name.api)) return name.name;
    return "";
}
}  // namespace

void check(const char *call, Api api, long code) {
    if (code != 0) throw CallFailed{call, api, static_cast<int>(code)};
}

std::string describe(const CallFailed &failed) {
    const std::string name = name_of(failed.api, failed.code);
    return failed.call + ": " + (name.empty() ? "error" : name) + " (wmx " +
           std::to_string(failed.code) + ")";
}

void bind_errors(nb::module_ &module) {
    static PyObject *type = PyErr_NewException("robotd_wmx._native.CallError", nullptr, nullptr);
    module.attr("CallError") = nb::handle(type);
    nb::register_exception_translator([](const std::exception_ptr &pointer, void *) {
        try {
            std::rethrow_exception(pointer);
        } catch (const CallFailed &failed) {
            const int api = static_cast<int>(failed.api);
            nb::tuple values =
                nb::make_tuple(failed.call.c_str(), API_NAMES[api], failed.code,
                               name_of(failed.api, failed.code), text(failed.api, failed.code).c_str());
            PyErr_SetObject(type, values.ptr());
        }
    });
    module.def("error_names", [] {
        nb::list all;
        for (const Name &name : NAMES)
            if (name.code >= 0)
                all.append(nb::make_tuple(API_NAMES[static_cast<int>(name.api)], name.code, name.name));
        return all;
    });
}

}  // namespace robotd
