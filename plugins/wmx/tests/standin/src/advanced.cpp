// libadvancedmotionapi: spline buffers and splines.
#include <vector>

#include "client.hpp"

using namespace standin;

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

WMX3APIFUNC AdvMotion::StartCSplinePos(int channel, PointTimeSplineCommand *pSplineCommand,
                                       unsigned int numPoints, SplinePoint *pPoint,
                                       double *pPointTimeMilliseconds) {
    if (!pSplineCommand || !pPoint || !pPointTimeMilliseconds) return ErrorCode::ArgumentIsNull;
    return with_motion(amApi->wmx3Api, [&](Block &block) {
        return start_spline(block, channel, static_cast<int>(pSplineCommand->dimensionCount),
                            pSplineCommand->axis, numPoints, pPoint, pPointTimeMilliseconds);
    });
}
WMX3APIFUNC AdvMotion::StartCSplinePos(int channel, TotalTimeSplineCommand *pSplineCommand,
                                       unsigned int numPoints, SplinePoint *pPoint) {
    if (!pSplineCommand || !pPoint) return ErrorCode::ArgumentIsNull;
    std::vector<double> times(numPoints);  // evenly, whatever the distances
    for (unsigned int index = 0; index < numPoints; index++)
        times[index] = pSplineCommand->totalTimeMilliseconds * (index + 1) / numPoints;
    return with_motion(amApi->wmx3Api, [&](Block &block) {
        return start_spline(block, channel, static_cast<int>(pSplineCommand->dimensionCount),
                            pSplineCommand->axis, numPoints, pPoint, times.data());
    });
}
WMX3APIFUNC AdvMotion::StartCSplineMov(int channel, PointTimeSplineCommand *pSplineCommand,
                                       unsigned int numPoints, SplinePoint *pPoint,
                                       double *pPointTimeMilliseconds) {
    if (!pSplineCommand || !pPoint || !pPointTimeMilliseconds) return ErrorCode::ArgumentIsNull;
    std::vector<SplinePoint> points(pPoint, pPoint + numPoints);
    return with_motion(amApi->wmx3Api, [&](Block &block) -> int {
        const int dimensions = static_cast<int>(pSplineCommand->dimensionCount);
        if (dimensions < 1 || dimensions > DIMENSIONS)
            return AdvancedMotionErrorCode::DimensionOutOfRange;
        for (int index = 0; index < dimensions; index++) {
            const int axis = pSplineCommand->axis[index];
            if (int code = check_axis(block, axis)) return code;
            for (SplinePoint &point : points) point.pos[index] += block.axes[axis].command;
        }
        return start_spline(block, channel, dimensions, pSplineCommand->axis, numPoints,
                            points.data(), pPointTimeMilliseconds);
    });
}

}  // namespace wmx3Api
