// Sizes. Part of the stand-in.
#pragma once

#include "standin/variant.h"

namespace wmx3Api {
namespace constants {
static const int maxAxes = 128;
static const int maxIoInSize = 8000;
static const int maxIoOutSize = 8000;
static const int maxDevices = 256;
static const int maxDeviceName = 64;
static const int maxInterrupts = 2;
static const int maxSyncGroup = 64;
static const int maxInPosChannel = 5;
static const int maxTriggerEvents = 8;
static const int moduleLen = 64;
static const int maxSplineDimensions = STANDIN_SPLINE_DIMENSIONS;
static const int maxSplineChannel = 128;
static const int maxPvtAppendPoints = 4096;
static const int maxPvtInterpolateAxes = 8;
static const unsigned long long maxProfileUnsignedInput = 274877906943ULL;
}  // namespace constants

namespace ecApi {
namespace constants {
static const int maxMasters = 2;
static const int maxSlaves = 256;
static const int maxSlaveAxes = 16;
static const int maxEniFilePathLen = 256;
}  // namespace constants
}  // namespace ecApi
}  // namespace wmx3Api
