// STAND-IN for the vendor's header of this name, for tests. See tests/standin/README.md.
#pragma once

#include "CoreMotionApi.h"

namespace wmx3Api {

class AdvancedMotion;

class AdvMotion {
public:
    class SplinePoint {
    public:
        double pos[constants::maxSplineDimensions] = {};
    };
    class PointTimeSplineCommand {
    public:
        unsigned int dimensionCount = 0;
        int axis[constants::maxSplineDimensions] = {};
    };
    class TotalTimeSplineCommand {
    public:
        unsigned int dimensionCount = 0;
        int axis[constants::maxSplineDimensions] = {};
        double totalTimeMilliseconds = 0;
        unsigned char ignoreDimensionForDistanceCalc[constants::maxSplineDimensions] = {};
    };
    class ProfileSplineCommand {
    public:
        unsigned int dimensionCount = 0;
        int axis[constants::maxSplineDimensions] = {};
        Profile profile;
        unsigned char ignoreDimensionForDistanceCalc[constants::maxSplineDimensions] = {};
        unsigned int sampleMultiplier = 0;
        unsigned char sampleMultiplierCubicDistribution = 0;
    };
    class VelAccLimitedSplineCommand {
    public:
        unsigned int dimensionCount = 0;
        int axis[constants::maxSplineDimensions] = {};
        double velLimit[constants::maxSplineDimensions] = {};
        double accLimit[constants::maxSplineDimensions] = {};
        double compositeVel = 0;
        double compositeAcc = 0;
        unsigned char ignoreDimensionForDistanceCalc[constants::maxSplineDimensions] = {};
        unsigned int sampleMultiplier = 0;
        unsigned char sampleMultiplierCubicDistribution = 0;
    };

    AdvancedMotion *amApi;
    explicit AdvMotion(AdvancedMotion *owner) : amApi(owner) {}
    bool IsDeviceValid();
    WMX3APIFUNC CreateSplineBuffer(int channel, unsigned int points);
    WMX3APIFUNC FreeSplineBuffer(int channel);
    WMX3APIFUNC GetSplineBufferPoints(int channel, unsigned int *pPoints);
    WMX3APIFUNC GetSplineBytesPerPoint(unsigned int *pBytes);
    // Cubic and B-splines, to positions or by distances, timed in four ways.
#define STANDIN_SPLINE_CALLS(name)                                                             \
    WMX3APIFUNC name(int channel, PointTimeSplineCommand *pSplineCommand,                      \
                     unsigned int numPoints, SplinePoint *pPoint,                              \
                     double *pPointTimeMilliseconds);                                          \
    WMX3APIFUNC name(int channel, TotalTimeSplineCommand *pSplineCommand,                      \
                     unsigned int numPoints, SplinePoint *pPoint);                             \
    WMX3APIFUNC name(int channel, ProfileSplineCommand *pSplineCommand,                        \
                     unsigned int numPoints, SplinePoint *pPoint);                             \
    WMX3APIFUNC name(int channel, VelAccLimitedSplineCommand *pSplineCommand,                  \
                     unsigned int numPoints, SplinePoint *pPoint);
    STANDIN_SPLINE_CALLS(StartCSplinePos)
    STANDIN_SPLINE_CALLS(StartCSplineMov)
    STANDIN_SPLINE_CALLS(StartCBSplinePos)
    STANDIN_SPLINE_CALLS(StartCBSplineMov)
#undef STANDIN_SPLINE_CALLS
};

class AdvVelocity {
public:
    AdvancedMotion *amApi;
    explicit AdvVelocity(AdvancedMotion *owner) : amApi(owner) {}
};

class AdvSync {
public:
    AdvancedMotion *amApi;
    explicit AdvSync(AdvancedMotion *owner) : amApi(owner) {}
};

class AdvancedMotion {
public:
    AdvMotion *advMotion;
    AdvVelocity *advVelocity;
    AdvSync *advSync;

    AdvancedMotion();
    explicit AdvancedMotion(WMX3Api *f);
    AdvancedMotion(const AdvancedMotion &other);
    AdvancedMotion &operator=(const AdvancedMotion &other);
    ~AdvancedMotion();

    WMX3APIFUNC GetVersion(int *major, int *minor, int *revision, int *fix);
    static WMX3APIFUNC ErrorToString(int errCode, char *pString, unsigned int size);
    static WMX3APIFUNC GetLibVersion(int *major, int *minor, int *revision, int *fix);
    bool IsDeviceValid();

    WMX3Api *wmx3Api;
};

}  // namespace wmx3Api
