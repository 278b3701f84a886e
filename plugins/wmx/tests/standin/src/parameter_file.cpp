// libcoremotionapi: the file of the parameters, as the engine writes it.
#include "parameter_file.hpp"

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <map>
#include <memory>
#include <sstream>
#include <string>
#include <type_traits>
#include <vector>

#include "parameters.inc"

namespace standin {

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
}  // namespace

int import_file(const char *path, Config::SystemParam *system, Config::AxisParam *axes, bool zero) {
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

int write_file(const char *path, Config::SystemParam &system, Config::AxisParam &axes) {
    std::ofstream file(path);
    if (!file) return ErrorCode::FileOperationFailed;
    file.precision(15);
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

}  // namespace standin
