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

    AdvancedMotion *amApi;
    explicit AdvMotion(AdvancedMotion *owner) : amApi(owner) {}
    bool IsDeviceValid();
    WMX3APIFUNC CreateSplineBuffer(int channel, unsigned int points);
    WMX3APIFUNC FreeSplineBuffer(int channel);
    WMX3APIFUNC GetSplineBufferPoints(int channel, unsigned int *pPoints);
    WMX3APIFUNC GetSplineBytesPerPoint(unsigned int *pBytes);
    WMX3APIFUNC StartCSplinePos(int channel, PointTimeSplineCommand *pSplineCommand,
                                unsigned int numPoints, SplinePoint *pPoint,
                                double *pPointTimeMilliseconds);
    WMX3APIFUNC StartCSplinePos(int channel, TotalTimeSplineCommand *pSplineCommand,
                                unsigned int numPoints, SplinePoint *pPoint);
    WMX3APIFUNC StartCSplineMov(int channel, PointTimeSplineCommand *pSplineCommand,
                                unsigned int numPoints, SplinePoint *pPoint,
                                double *pPointTimeMilliseconds);
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
