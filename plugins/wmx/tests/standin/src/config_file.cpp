// libcoremotionapi: importing and exporting parameters. One axis' parameters: the others keep
// what they have, and a selection of axes gets copies.
#include <memory>
#include <string>

#include "parameter_file.hpp"

using namespace standin;

namespace {
// A path of the file system, of either kind of characters.
std::string narrow(const char *path) { return path ? path : ""; }
std::string narrow(const wchar_t *path) {
    const std::wstring wide(path ? path : L"");
    return std::string(wide.begin(), wide.end());
}

template <class Param>
void copy_axis(const Param &from, Param &to, int source, int target);

template <>
void copy_axis(const Config::SystemParam &from, Config::SystemParam &to, int source, int target) {
    to.feedbackParam[target] = from.feedbackParam[source];
    to.homeParam[target] = from.homeParam[source];
    to.limitParam[target] = from.limitParam[source];
    to.motionParam[target] = from.motionParam[source];
    to.alarmParam[target] = from.alarmParam[source];
    to.syncParam[target] = from.syncParam[source];
}

// The file's parameters of one axis, as far as the gear, the mode and the encoder go.
template <>
void copy_axis(const Config::AxisParam &from, Config::AxisParam &to, int source, int target) {
    to.axisCommandMode[target] = from.axisCommandMode[source];
    to.gearRatioNumerator[target] = from.gearRatioNumerator[source];
    to.gearRatioDenominator[target] = from.gearRatioDenominator[source];
    to.axisPolarity[target] = from.axisPolarity[source];
    to.absoluteEncoderMode[target] = from.absoluteEncoderMode[source];
    to.absoluteEncoderHomeOffset[target] = from.absoluteEncoderHomeOffset[source];
    to.maxTrqLimit[target] = from.maxTrqLimit[source];
    to.maxMotorSpeed[target] = from.maxMotorSpeed[source];
}

int import_axis(const std::string &path, Config::SystemParam *system, Config::AxisParam *axes,
                int axis, const AxisSelection *copies) {
    if (axis < 0 || axis >= AXES) return ErrorCode::AxisOutOfRange;
    auto file = std::make_unique<Parameters>();
    if (system) file->system = *system;
    if (axes) file->axis = *axes;
    if (int code = import_file(path.c_str(), &file->system, &file->axis, false)) return code;
    const AxisSelection own(1, &axis);
    for (const AxisSelection *selection : {&own, copies})
        for (int index = 0; selection && index < selection->axisCount; index++) {
            if (system) copy_axis(file->system, *system, axis, selection->axis[index]);
            if (axes) copy_axis(file->axis, *axes, axis, selection->axis[index]);
        }
    return ErrorCode::None;
}

int export_some(const std::string &path, Config::SystemParam *system, Config::AxisParam *axes,
                int axis = -1) {
    auto all = std::make_unique<Parameters>();
    if (system && axis < 0) all->system = *system;
    if (axes && axis < 0) all->axis = *axes;
    if (system && axis >= 0) copy_axis(*system, all->system, axis, axis);
    if (axes && axis >= 0) copy_axis(*axes, all->axis, axis, axis);
    return write_file(path.c_str(), all->system, all->axis);
}
}  // namespace

namespace wmx3Api {

#define FILE_CALLS(Char)                                                                       \
    WMX3APIFUNC Config::Import(Char *path, SystemParam *system) {                              \
        return import_file(narrow(path).c_str(), system, nullptr, false);                      \
    }                                                                                          \
    WMX3APIFUNC Config::Import(Char *path, AxisParam *axes) {                                  \
        return import_file(narrow(path).c_str(), nullptr, axes, false);                        \
    }                                                                                          \
    WMX3APIFUNC Config::Import(Char *path, SystemParam *system, AxisParam *axes) {             \
        return import_file(narrow(path).c_str(), system, axes, false);                         \
    }                                                                                          \
    WMX3APIFUNC Config::Import(Char *path, SystemParam *system, int axis, AxisSelection *to) { \
        return import_axis(narrow(path), system, nullptr, axis, to);                           \
    }                                                                                          \
    WMX3APIFUNC Config::Import(Char *path, AxisParam *axes, int axis, AxisSelection *to) {     \
        return import_axis(narrow(path), nullptr, axes, axis, to);                             \
    }                                                                                          \
    WMX3APIFUNC Config::Import(Char *path, SystemParam *system, AxisParam *axes, int axis,     \
                               AxisSelection *to) {                                            \
        return import_axis(narrow(path), system, axes, axis, to);                              \
    }                                                                                          \
    WMX3APIFUNC Config::Export(Char *path, SystemParam *system) {                              \
        return export_some(narrow(path), system, nullptr);                                     \
    }                                                                                          \
    WMX3APIFUNC Config::Export(Char *path, AxisParam *axes) {                                  \
        return export_some(narrow(path), nullptr, axes);                                       \
    }                                                                                          \
    WMX3APIFUNC Config::Export(Char *path, SystemParam *system, AxisParam *axes) {             \
        return export_some(narrow(path), system, axes);                                        \
    }                                                                                          \
    WMX3APIFUNC Config::Export(Char *path, SystemParam *system, int axis) {                    \
        return export_some(narrow(path), system, nullptr, axis);                               \
    }                                                                                          \
    WMX3APIFUNC Config::Export(Char *path, AxisParam *axes, int axis) {                        \
        return export_some(narrow(path), nullptr, axes, axis);                                 \
    }                                                                                          \
    WMX3APIFUNC Config::Export(Char *path, SystemParam *system, AxisParam *axes, int axis) {   \
        return export_some(narrow(path), system, axes, axis);                                  \
    }                                                                                          \
    WMX3APIFUNC Config::GetAndExportAll(Char *path) {                                          \
        int code = 0;                                                                          \
        auto all = current(cmApi->wmx3Api, code);                                              \
        return code ? code : write_file(narrow(path).c_str(), all->system, all->axis);         \
    }                                                                                          \
    WMX3APIFUNC Config::ImportAndSetAll(Char *path, SystemParam *bad, AxisParam *bad_axes) {   \
        auto all = std::make_unique<Parameters>();                                             \
        const std::string name = narrow(path);                                                 \
        if (int code = import_file(name.c_str(), &all->system, &all->axis, true)) return code; \
        return set_all(cmApi->wmx3Api, *all, bad, bad_axes);                                   \
    }
FILE_CALLS(char)
FILE_CALLS(wchar_t)

}  // namespace wmx3Api
