// libcoremotionapi: parameters, their file, their ranges.
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <map>
#include <memory>
#include <sstream>
#include <string>
#include <type_traits>
#include <vector>

#include "client.hpp"
#include "parameters.inc"

using namespace standin;

namespace {
constexpr double M = 274877906943.0;
using Texts = std::map<std::string, double>;  // "3/HomeParam/HomeType" (axis -1: global) → value

// Elements and texts only, as the engine writes them: no attributes but Axis, no entities.
bool parse(std::istream &file, Texts &texts) {
    std::stringstream content;
    content << file.rdbuf();
    const std::string xml = content.str();
    std::vector<std::string> open;
    std::string axis = "-1";
    std::size_t at = 0;
    while ((at = xml.find('<', at)) != std::string::npos) {
        const std::size_t end = xml.find('>', at);
        if (end == std::string::npos) return false;
        std::string tag = xml.substr(at + 1, end - at - 1);
        at = end + 1;
        if (tag.empty() || tag[0] == '?' || tag[0] == '!' || tag.back() == '/') continue;
        if (tag[0] == '/') {
            if (open.empty() || open.back() != tag.substr(1)) return false;
            if (tag == "/AxisParameters") axis = "-1";
            open.pop_back();
            continue;
        }
        open.push_back(tag.substr(0, tag.find_first_of(" \t\r\n")));
        if (open.back() == "AxisParameters") {
            const std::size_t quote = tag.find('"');
            if (quote == std::string::npos) return false;
            axis = tag.substr(quote + 1, tag.find('"', quote + 1) - quote - 1);
        }
        const std::string text = xml.substr(at, xml.find('<', at) - at);
        if (open.size() < 4 || text.find_first_not_of(" \t\r\n") == std::string::npos) continue;
        std::string path = axis;
        for (std::size_t level = 2; level < open.size(); level++) path += "/" + open[level];
        char *rest = nullptr;
        texts[path] = std::strtod(text.c_str(), &rest);
        if (rest == text.c_str()) return false;
    }
    return open.empty() && !texts.empty();
}

template <class T>
void assign(T &member, double value) {
    if constexpr (std::is_floating_point_v<T>) member = value;
    else member = static_cast<T>(static_cast<long long>(value));
}

// Takes every parameter of both objects past `visit(path, member, low, high)`.
template <class Visit>
void every(Config::SystemParam &system, Config::AxisParam &axes, Visit visit) {
    std::string prefix = "-1/";
#define ITEM(element, member, low, high, value) \
    visit(prefix + section + #element, target.member, static_cast<double>(low), static_cast<double>(high));
    {
        auto &target = system.flightRecorderParam;
        std::string section = "FlightRecorderParam/";
        STANDIN_FlightRecorderParam(ITEM)
    }
    {
        auto &target = system.emergencyStopParam;
        std::string section = "EmergencyStopParam/";
        STANDIN_EmergencyStopParam(ITEM)
    }
#define SECTION(name, member_name)                     \
    {                                                  \
        auto &target = system.member_name[axis];       \
        const std::string section = #name "/";         \
        STANDIN_##name(ITEM)                           \
    }
    for (int axis = 0; axis < AXES; axis++) {
        prefix = std::to_string(axis) + "/";
        SECTION(FeedbackParam, feedbackParam)
        SECTION(HomeParam, homeParam)
        SECTION(LimitParam, limitParam)
        SECTION(MotionParam, motionParam)
        SECTION(AlarmParam, alarmParam)
        SECTION(SyncParam, syncParam)
    }
#undef SECTION
#undef ITEM
#define ITEM(element, member, low, high, value) \
    visit(prefix + section + #element, target.member[axis], static_cast<double>(low), static_cast<double>(high));
    for (int axis = 0; axis < AXES; axis++) {
        prefix = std::to_string(axis) + "/";
        std::string section = "AxisParam/";
        {
            auto &target = axes;
            STANDIN_AxisParam(ITEM)
        }
        section = "FlightRecorderParam/";
        {
            auto &target = system.flightRecorderParam;
            STANDIN_FlightRecorderParam_Axis(ITEM)
        }
        section = "EmergencyStopParam/";
        {
            auto &target = system.emergencyStopParam;
            STANDIN_EmergencyStopParam_Axis(ITEM)
        }
    }
#undef ITEM
}

bool good(double value, double low, double high, const std::string &path) {
    if (path.find("AxisPolarity") != std::string::npos) return std::fabs(value) == 1;
    return value >= low && value <= high;
}

// Both objects together are about 0.1 MB: kept off the stack.
struct Parameters {
    Config::SystemParam system;
    Config::AxisParam axis;
};

int import(const char *path, Config::SystemParam *system, Config::AxisParam *axes, bool zero) {
    if (!path) return ErrorCode::ArgumentIsNull;
    std::ifstream file(path);
    if (!file) return ErrorCode::FileOperationFailed;
    Texts texts;
    if (!parse(file, texts)) return CoreMotionErrorCode::ParameterFileParseError;
    auto scratch = std::make_unique<Parameters>();
    if (!system) system = &scratch->system;
    if (!axes) axes = &scratch->axis;
    every(*system, *axes, [&](const std::string &name, auto &member, double, double) {
        const auto found = texts.find(name);
        if (found != texts.end()) assign(member, found->second);
        else if (zero) assign(member, 0);
    });
    return ErrorCode::None;
}

// Counts bad members and marks them in the error objects.
int bad_members(Parameters &given, Config::SystemParam *system, Config::AxisParam *axes) {
    int bad = 0;
    std::vector<bool> wrong;
    every(given.system, given.axis, [&](const std::string &name, auto &member, double low,
                                        double high) {
        wrong.push_back(!good(static_cast<double>(member), low, high, name));
        bad += wrong.back();
    });
    auto scratch = std::make_unique<Parameters>();
    std::size_t index = 0;
    every(system ? *system : scratch->system, axes ? *axes : scratch->axis,
          [&](const std::string &, auto &member, double, double) {
              assign(member, wrong[index++] ? 1 : 0);
          });
    return bad;
}

int write(const char *path, Config::SystemParam &system, Config::AxisParam &axes) {
    std::ofstream file(path);
    if (!file) return ErrorCode::FileOperationFailed;
    file.precision(15);
    std::string axis = "", section;
    file << "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<Parameters ver=\"1.00\">\n";
    std::map<int, std::map<std::string, std::string>> sections;
    every(system, axes, [&](const std::string &name, auto &member, double, double) {
        const std::size_t first = name.find('/'), last = name.rfind('/');
        std::ostringstream leaf;
        leaf.precision(15);
        const std::string element = name.substr(last + 1);
        leaf << "\t\t\t<" << element << ">" << static_cast<double>(member) << "</" << element << ">\n";
        sections[std::stoi(name)][name.substr(first + 1, last - first - 1)] += leaf.str();
    });
    for (const auto &[number, groups] : sections) {
        const std::string name = number < 0 ? "GlobalParameters" : "AxisParameters";
        file << "\t<" << name;
        if (number >= 0) file << " Axis=\"" << number << "\"";
        file << ">\n";
        for (const auto &[group, leaves] : groups)
            file << "\t\t<" << group << ">\n" << leaves << "\t\t</" << group << ">\n";
        file << "\t</" << name << ">\n";
    }
    file << "</Parameters>\n";
    return file ? ErrorCode::None : ErrorCode::FileOperationFailed;
}

void apply(Block &block) {
    for (int axis = 0; axis < AXES; axis++) {
        Axis &mine = block.axes[axis];
        if (block.axis.absoluteEncoderMode[axis])
            mine.home_counts = block.axis.absoluteEncoderHomeOffset[axis];
        mine.mode = block.axis.axisCommandMode[axis];
        mine.mode_delay = 2;
        mine.sent_counts = mine.counts;
        rescale(block, axis);
    }
}

int set_all(WMX3Api *api, Parameters &given, Config::SystemParam *system_error,
            Config::AxisParam *axis_error) {
    if (bad_members(given, system_error, axis_error))
        return CoreMotionErrorCode::ParameterSettingsInvalid;
    return with_engine(api, [&](Block &block) {
        for (int axis = 0; axis < AXES; axis++)
            if (block.status.axesStatus[axis].opState != OperationState::Idle)
                return static_cast<int>(ErrorCode::NotIdleState);
        block.system = given.system;
        block.axis = given.axis;
        apply(block);
        return static_cast<int>(ErrorCode::None);
    });
}

std::unique_ptr<Parameters> current(WMX3Api *api, int &code) {
    auto all = std::make_unique<Parameters>();
    code = with_engine(api, [&](Block &block) {
        all->system = block.system;
        all->axis = block.axis;
        return 0;
    });
    return all;
}

template <class Command>
int for_axis(CoreMotion *core, int axis, Command command) {
    return with_engine(core->wmx3Api, [&](Block &block) {
        if (axis < 0 || axis >= AXES) return static_cast<int>(ErrorCode::AxisOutOfRange);
        return static_cast<int>(command(block));
    });
}
}  // namespace

namespace wmx3Api {

WMX3APIFUNC Config::SetParam(SystemParam *pParam, SystemParam *pError) {
    int code = 0;
    auto all = current(cmApi->wmx3Api, code);
    if (code) return code;
    all->system = *pParam;
    return set_all(cmApi->wmx3Api, *all, pError, nullptr);
}
WMX3APIFUNC Config::SetParam(int axis, SystemParam *pParam, SystemParam *pError) {
    int code = 0;
    auto all = current(cmApi->wmx3Api, code);
    if (code) return code;
    if (axis < 0 || axis >= AXES) return ErrorCode::AxisOutOfRange;
    all->system.feedbackParam[axis] = pParam->feedbackParam[axis];
    all->system.homeParam[axis] = pParam->homeParam[axis];
    all->system.limitParam[axis] = pParam->limitParam[axis];
    all->system.motionParam[axis] = pParam->motionParam[axis];
    all->system.alarmParam[axis] = pParam->alarmParam[axis];
    all->system.syncParam[axis] = pParam->syncParam[axis];
    return set_all(cmApi->wmx3Api, *all, pError, nullptr);
}
WMX3APIFUNC Config::GetParam(SystemParam *pParam) {
    return with_engine(cmApi->wmx3Api, [&](Block &block) {
        *pParam = block.system;
        return 0;
    });
}
WMX3APIFUNC Config::GetParam(int axis, SystemParam *pParam) {
    if (axis < 0 || axis >= AXES) return ErrorCode::AxisOutOfRange;
    return GetParam(pParam);
}
WMX3APIFUNC Config::SetAxisParam(AxisParam *pParam, AxisParam *pError) {
    int code = 0;
    auto all = current(cmApi->wmx3Api, code);
    if (code) return code;
    all->axis = *pParam;
    return set_all(cmApi->wmx3Api, *all, nullptr, pError);
}
WMX3APIFUNC Config::SetAxisParam(int axis, AxisParam *pParam, AxisParam *pError) {
    if (axis < 0 || axis >= AXES) return ErrorCode::AxisOutOfRange;
    return SetAxisParam(pParam, pError);
}
WMX3APIFUNC Config::GetAxisParam(AxisParam *pParam) {
    return with_engine(cmApi->wmx3Api, [&](Block &block) {
        *pParam = block.axis;
        return 0;
    });
}
WMX3APIFUNC Config::GetAxisParam(int axis, AxisParam *pParam) {
    if (axis < 0 || axis >= AXES) return ErrorCode::AxisOutOfRange;
    return GetAxisParam(pParam);
}

WMX3APIFUNC Config::SetGearRatio(int axis, double numerator, double denominator) {
    return for_axis(cmApi, axis, [&](Block &block) -> int {
        const double ratio = numerator / denominator;
        if (!(ratio >= 1e-6 && ratio <= 2147483647.0)) return ErrorCode::ArgumentOutOfRange;
        block.axis.gearRatioNumerator[axis] = numerator;
        block.axis.gearRatioDenominator[axis] = denominator;
        rescale(block, axis);
        return ErrorCode::None;
    });
}
WMX3APIFUNC Config::SetAxisPolarity(int axis, char polarity) {
    return for_axis(cmApi, axis, [&](Block &block) -> int {
        if (polarity != 1 && polarity != -1) return ErrorCode::ArgumentOutOfRange;
        block.axis.axisPolarity[axis] = polarity;
        rescale(block, axis);
        return ErrorCode::None;
    });
}
WMX3APIFUNC Config::GetGearRatio(int axis, double *pNumerator, double *pDenominator) {
    return for_axis(cmApi, axis, [&](Block &block) {
        *pNumerator = block.axis.gearRatioNumerator[axis];
        *pDenominator = block.axis.gearRatioDenominator[axis];
        return 0;
    });
}

#define COLUMN_GET(function, type, member)                          \
    WMX3APIFUNC Config::function(int axis, type *pValue) {          \
        return for_axis(cmApi, axis, [&](Block &block) {            \
            *pValue = block.axis.member[axis];                      \
            return 0;                                               \
        });                                                         \
    }
#define COLUMN_SET(function, type, member)                          \
    WMX3APIFUNC Config::function(int axis, type value) {            \
        return for_axis(cmApi, axis, [&](Block &block) {            \
            block.axis.member[axis] = value;                        \
            return 0;                                               \
        });                                                         \
    }
COLUMN_GET(GetAxisPolarity, char, axisPolarity)
COLUMN_SET(SetAbsoluteEncoderMode, bool, absoluteEncoderMode)
COLUMN_GET(GetAbsoluteEncoderMode, bool, absoluteEncoderMode)
COLUMN_SET(SetAbsoluteEncoderHomeOffset, double, absoluteEncoderHomeOffset)
COLUMN_GET(GetAbsoluteEncoderHomeOffset, double, absoluteEncoderHomeOffset)
COLUMN_SET(SetAxisUnit, double, axisUnit)
COLUMN_GET(GetAxisUnit, double, axisUnit)

WMX3APIFUNC Config::SetSingleTurn(int axis, bool enable, unsigned int encoderCount) {
    return for_axis(cmApi, axis, [&](Block &block) {
        block.axis.singleTurnMode[axis] = enable;
        block.axis.singleTurnEncoderCount[axis] = encoderCount;
        return 0;
    });
}
WMX3APIFUNC Config::GetSingleTurn(int axis, bool *pEnable, unsigned int *pEncoderCount) {
    return for_axis(cmApi, axis, [&](Block &block) {
        *pEnable = block.axis.singleTurnMode[axis];
        *pEncoderCount = block.axis.singleTurnEncoderCount[axis];
        return 0;
    });
}

#define GROUP_ACCESS(type, member)                                        \
    WMX3APIFUNC Config::Set##type(int axis, type *p, type *) {            \
        return for_axis(cmApi, axis, [&](Block &block) {                  \
            block.system.member[axis] = *p;                               \
            return 0;                                                     \
        });                                                               \
    }                                                                     \
    WMX3APIFUNC Config::Get##type(int axis, type *p) {                    \
        return for_axis(cmApi, axis, [&](Block &block) {                  \
            *p = block.system.member[axis];                               \
            return 0;                                                     \
        });                                                               \
    }
GROUP_ACCESS(FeedbackParam, feedbackParam)
GROUP_ACCESS(HomeParam, homeParam)
GROUP_ACCESS(LimitParam, limitParam)
GROUP_ACCESS(MotionParam, motionParam)
GROUP_ACCESS(AlarmParam, alarmParam)
GROUP_ACCESS(SyncParam, syncParam)

WMX3APIFUNC Config::GetDefaultParam(SystemParam *pParam) {
    *pParam = *std::make_unique<SystemParam>();
    return ErrorCode::None;
}
WMX3APIFUNC Config::GetDefaultAxisParam(AxisParam *pParam) {
    *pParam = *std::make_unique<AxisParam>();
    return ErrorCode::None;
}

WMX3APIFUNC Config::Import(char *pPath, SystemParam *pParam) {
    return import(pPath, pParam, nullptr, false);
}
WMX3APIFUNC Config::Import(char *pPath, AxisParam *pAxisParam) {
    return import(pPath, nullptr, pAxisParam, false);
}
WMX3APIFUNC Config::Import(char *pPath, SystemParam *pParam, AxisParam *pAxisParam) {
    return import(pPath, pParam, pAxisParam, false);
}
WMX3APIFUNC Config::Export(char *pPath, SystemParam *pParam) {
    return write(pPath, *pParam, *std::make_unique<AxisParam>());
}
WMX3APIFUNC Config::Export(char *pPath, AxisParam *pAxisParam) {
    return write(pPath, *std::make_unique<SystemParam>(), *pAxisParam);
}
WMX3APIFUNC Config::Export(char *pPath, SystemParam *pParam, AxisParam *pAxisParam) {
    return write(pPath, *pParam, *pAxisParam);
}
WMX3APIFUNC Config::GetAndExportAll(char *pPath) {
    int code = 0;
    auto all = current(cmApi->wmx3Api, code);
    return code ? code : write(pPath, all->system, all->axis);
}
WMX3APIFUNC Config::ImportAndSetAll(char *pPath, SystemParam *pError, AxisParam *pAxisError) {
    auto all = std::make_unique<Parameters>();
    if (int code = import(pPath, &all->system, &all->axis, true)) return code;
    return set_all(cmApi->wmx3Api, *all, pError, pAxisError);
}
WMX3APIFUNC Config::ImportAndSetAll(wchar_t *pPath, SystemParam *pError, AxisParam *pAxisError) {
    const std::wstring wide(pPath);
    return ImportAndSetAll(std::string(wide.begin(), wide.end()).data(), pError, pAxisError);
}

}  // namespace wmx3Api
