// Constructors of the plain types, and the texts of errors (own words: the names).
#include <cstring>
#include <string>

#include "client.hpp"
#include "parameters.inc"

namespace standin {

namespace {
struct Name {
    int code;
    const char *type, *text;
};
using ecApi::EcErrorCode;
const Name NAMES[] = {
    {ErrorCode::None, "ErrorCode", "None"},
#define CODE(api, type, name) {type::name, #type, #name},
#include "error_names.inc"
#undef CODE
};
}  // namespace

int error_text(int code, const char *classes, char *text, unsigned int size) {
    int result = ErrorCode::ErrorCodeNotDefined;
    std::string found = "ErrorCodeNotDefined";
    for (const Name &name : NAMES)
        if (name.code == code && std::strstr(classes, name.type)) {
            found = name.text;
            result = ErrorCode::None;
        }
    if (!text) return ErrorCode::ArgumentIsNull;
    if (found.size() >= size) {
        if (size) text[0] = 0;
        return ErrorCode::BufferTooSmall;
    }
    std::strcpy(text, found.c_str());
    return result;
}

}  // namespace standin

namespace wmx3Api {

Profile::Profile() { std::memset(static_cast<void *>(this), 0, sizeof *this); }

Profile Profile::SetupTrapezoidal(double velocity, double acc, double dec, double startingVelocity,
                                  double endVelocity) {
    Profile profile;
    profile.velocity = velocity, profile.acc = acc, profile.dec = dec;
    profile.startingVelocity = startingVelocity, profile.endVelocity = endVelocity;
    return profile;
}

Profile Profile::SetupTimeAccTrapezoidal(double velocity, double accTime, double decTime,
                                         double startingVelocity, double endVelocity) {
    Profile profile = SetupTrapezoidal(velocity, 0, 0, startingVelocity, endVelocity);
    profile.type = ProfileType::TimeAccTrapezoidal;
    profile.accTimeMilliseconds = accTime, profile.decTimeMilliseconds = decTime;
    return profile;
}

AxisSelection::AxisSelection() : axisCount(0), axis() {}

AxisSelection::AxisSelection(int count, const int *axes) : axisCount(count), axis() {
    for (int index = 0; index < count && index < constants::maxAxes; index++)
        axis[index] = axes[index];
}

CoreMotionAxisStatus::CoreMotionAxisStatus() {
    std::memset(static_cast<void *>(this), 0, sizeof *this);
    masterAxis = secondMasterAxis = -1;
}

namespace ecApi {
EcMasterInfo::EcMasterInfo() { std::memset(static_cast<void *>(this), 0, sizeof *this); }

int EcMasterInfo::GetOfflineSlaveCount() {
    int count = 0;
    for (unsigned int index = 0; index < numOfSlaves; index++) count += slaves[index].offline;
    return count;
}
int EcMasterInfo::GetInaccessibleSlaveCount() {
    int count = 0;
    for (unsigned int index = 0; index < numOfSlaves; index++) count += slaves[index].inaccessible;
    return count;
}
int EcMasterInfo::GetOnlineSlaveCount() {
    return static_cast<int>(numOfSlaves) - GetOfflineSlaveCount();
}
}  // namespace ecApi

// The defaults of every parameter.
namespace {
template <class T>
void fill(T &member, double value) {
    member = static_cast<T>(static_cast<long long>(value));
}
template <>
void fill(double &member, double value) {
    member = value;
}
template <class T, int N>
void fill(T (&members)[N], double value) {
    for (T &member : members) fill(member, value);
}
}  // namespace

#define ITEM(element, member, low, high, value) fill(member, value);
ConfigParams::FeedbackParam::FeedbackParam() { STANDIN_FeedbackParam(ITEM) }
ConfigParams::HomeParam::HomeParam() { STANDIN_HomeParam(ITEM) }
ConfigParams::LimitParam::LimitParam() { STANDIN_LimitParam(ITEM) }
ConfigParams::MotionParam::MotionParam() { STANDIN_MotionParam(ITEM) }
ConfigParams::AlarmParam::AlarmParam() { STANDIN_AlarmParam(ITEM) }
ConfigParams::SyncParam::SyncParam() { STANDIN_SyncParam(ITEM) }
ConfigParams::FlightRecorderParam::FlightRecorderParam() {
    STANDIN_FlightRecorderParam(ITEM) STANDIN_FlightRecorderParam_Axis(ITEM)
}
ConfigParams::EmergencyStopParam::EmergencyStopParam() {
    STANDIN_EmergencyStopParam(ITEM) STANDIN_EmergencyStopParam_Axis(ITEM)
}
ConfigParams::AxisParam::AxisParam() { STANDIN_AxisParam(ITEM) }
#undef ITEM

}  // namespace wmx3Api
