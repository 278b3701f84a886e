// libadvancedmotionapi: spline buffers and splines.
#include <algorithm>
#include <cmath>
#include <vector>

#include "client.hpp"

using namespace standin;

namespace {
using Times = std::vector<double>;  // ms, of every point
using Way = std::vector<double>;    // length of the path up to every point

// Even speed along the path.
Times along(const Way &way, double total_ms) {
    Times times(way.size());
    for (std::size_t index = 0; index < way.size(); index++)
        times[index] = way.back() > 0 ? total_ms * way[index] / way.back() : total_ms;
    return times;
}

// Of a trapezoid as long, with room for the ramps of the spline.
double duration_ms(double length, double velocity, double acceleration) {
    if (!(velocity > 0) || !(acceleration > 0)) return 0;  // rejected as points without time
    return (1.5 * length / velocity + 2 * velocity / acceleration) * 1000;
}

template <class Command, class Timing>
int start(AdvancedMotion *advanced, int channel, const Command *command, unsigned int count,
          const AdvMotion::SplinePoint *given, bool relative, Timing times) {
    if (!command || !given) return ErrorCode::ArgumentIsNull;
    const int dimensions = static_cast<int>(command->dimensionCount);
    if (dimensions < 1 || dimensions > DIMENSIONS)
        return AdvancedMotionErrorCode::DimensionOutOfRange;
    if (count < 1) return AdvancedMotionErrorCode::PointCountBelowMinimum;
    return with_motion(advanced->wmx3Api, [&](Block &block) -> int {
        std::vector<AdvMotion::SplinePoint> points(given, given + count);
        AdvMotion::SplinePoint last;
        for (int index = 0; index < dimensions; index++) {
            if (int code = check_axis(block, command->axis[index])) return code;
            last.pos[index] = block.axes[command->axis[index]].command;
            for (AdvMotion::SplinePoint &point : points)
                point.pos[index] += relative ? last.pos[index] : 0;
        }
        Way way;
        for (const AdvMotion::SplinePoint &point : points) {
            double square = 0;
            for (int index = 0; index < dimensions; index++)
                square += std::pow(point.pos[index] - last.pos[index], 2);
            way.push_back((way.empty() ? 0 : way.back()) + std::sqrt(square));
            last = point;
        }
        return start_spline(block, channel, dimensions, command->axis, count, points.data(),
                            times(way).data());
    });
}
}  // namespace

namespace wmx3Api {

AdvancedMotion::AdvancedMotion() : AdvancedMotion(nullptr) {}
AdvancedMotion::AdvancedMotion(WMX3Api *f)
    : advMotion(new AdvMotion(this)), advVelocity(new AdvVelocity(this)),
      advSync(new AdvSync(this)), wmx3Api(f) {}
AdvancedMotion::AdvancedMotion(const AdvancedMotion &other) : AdvancedMotion(other.wmx3Api) {}
AdvancedMotion &AdvancedMotion::operator=(const AdvancedMotion &other) {
    wmx3Api = other.wmx3Api;
    return *this;
}
AdvancedMotion::~AdvancedMotion() {
    delete advMotion;
    delete advVelocity;
    delete advSync;
}

bool AdvancedMotion::IsDeviceValid() { return wmx3Api && wmx3Api->IsDeviceValid(); }
bool AdvMotion::IsDeviceValid() { return amApi->IsDeviceValid(); }

WMX3APIFUNC AdvancedMotion::GetVersion(int *major, int *minor, int *revision, int *fix) {
    return version(major, minor, revision, fix);
}
WMX3APIFUNC AdvancedMotion::GetLibVersion(int *major, int *minor, int *revision, int *fix) {
    return version(major, minor, revision, fix);
}
WMX3APIFUNC AdvancedMotion::ErrorToString(int errCode, char *pString, unsigned int size) {
    return error_text(errCode, "ErrorCode CoreMotionErrorCode AdvancedMotionErrorCode", pString,
                      size);
}

WMX3APIFUNC AdvMotion::CreateSplineBuffer(int channel, unsigned int points) {
    return with_engine(amApi->wmx3Api,
                       [&](Block &block) { return create_buffer(block, channel, points); });
}
WMX3APIFUNC AdvMotion::FreeSplineBuffer(int channel) {
    return with_engine(amApi->wmx3Api, [&](Block &block) -> int {
        if (channel < 0 || channel >= CHANNELS) return ErrorCode::ChannelOutOfRange;
        if (block.channels[channel].running) return CoreMotionErrorCode::ChannelExecutingCommands;
        if (!block.channels[channel].points)
            return CoreMotionErrorCode::ChannelBufferMemoryNotAllocated;
        block.channels[channel].points = 0;
        return ErrorCode::None;
    });
}
WMX3APIFUNC AdvMotion::GetSplineBufferPoints(int channel, unsigned int *pPoints) {
    return with_engine(amApi->wmx3Api, [&](Block &block) -> int {
        if (channel < 0 || channel >= CHANNELS) return ErrorCode::ChannelOutOfRange;
        *pPoints = block.channels[channel].points;
        return ErrorCode::None;
    });
}
WMX3APIFUNC AdvMotion::GetSplineBytesPerPoint(unsigned int *pBytes) {
    *pBytes = 192;
    return ErrorCode::None;
}

// B-splines run as cubic splines through the same points.
#define SPLINE_CALLS(name, relative)                                                            \
    WMX3APIFUNC AdvMotion::name(int channel, PointTimeSplineCommand *pSplineCommand,            \
                                unsigned int numPoints, SplinePoint *pPoint, double *pTimes) {  \
        if (!pTimes) return ErrorCode::ArgumentIsNull;                                          \
        const auto given = [&](const Way &) { return Times(pTimes, pTimes + numPoints); };      \
        return start(amApi, channel, pSplineCommand, numPoints, pPoint, relative, given);       \
    }                                                                                           \
    WMX3APIFUNC AdvMotion::name(int channel, TotalTimeSplineCommand *pSplineCommand,            \
                                unsigned int numPoints, SplinePoint *pPoint) {                  \
        const auto even = [&](const Way &way) {                                                 \
            return along(way, pSplineCommand->totalTimeMilliseconds);                           \
        };                                                                                      \
        return start(amApi, channel, pSplineCommand, numPoints, pPoint, relative, even);        \
    }                                                                                           \
    WMX3APIFUNC AdvMotion::name(int channel, ProfileSplineCommand *pSplineCommand,              \
                                unsigned int numPoints, SplinePoint *pPoint) {                  \
        const auto profiled = [&](const Way &way) {                                             \
            const Profile &profile = pSplineCommand->profile;                                   \
            return along(way, duration_ms(way.back(), profile.velocity, profile.acc));          \
        };                                                                                      \
        return start(amApi, channel, pSplineCommand, numPoints, pPoint, relative, profiled);    \
    }                                                                                           \
    WMX3APIFUNC AdvMotion::name(int channel, VelAccLimitedSplineCommand *pSplineCommand,        \
                                unsigned int numPoints, SplinePoint *pPoint) {                  \
        const auto limited = [&](const Way &way) {                                              \
            const VelAccLimitedSplineCommand &limits = *pSplineCommand;                         \
            const int count = static_cast<int>(limits.dimensionCount);                          \
            return along(way, duration_ms(way.back(),                                           \
                                          *std::min_element(limits.velLimit, limits.velLimit + count), \
                                          *std::min_element(limits.accLimit, limits.accLimit + count))); \
        };                                                                                      \
        return start(amApi, channel, pSplineCommand, numPoints, pPoint, relative, limited);     \
    }
SPLINE_CALLS(StartCSplinePos, false)
SPLINE_CALLS(StartCSplineMov, true)
SPLINE_CALLS(StartCBSplinePos, false)
SPLINE_CALLS(StartCBSplineMov, true)

}  // namespace wmx3Api
