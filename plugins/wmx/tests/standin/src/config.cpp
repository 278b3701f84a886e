// libcoremotionapi: parameters of the axes and of the engine.
#include <memory>
#include <string>

#include "parameter_file.hpp"

using namespace standin;

namespace {
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

template <class Command>
int for_axis(CoreMotion *core, int axis, Command command) {
    return with_engine(core->wmx3Api, [&](Block &block) {
        if (axis < 0 || axis >= AXES) return static_cast<int>(ErrorCode::AxisOutOfRange);
        return static_cast<int>(command(block));
    });
}
}  // namespace

namespace standin {

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

}  // namespace standin

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
COLUMN_SET(SetVelocityFeedforwardGain, double, velocityFeedforwardGain)
COLUMN_GET(GetVelocityFeedforwardGain, double, velocityFeedforwardGain)

WMX3APIFUNC Config::SetMovingAverageProfileTime(int axis, double milliseconds) {
    return for_axis(cmApi, axis, [&](Block &block) -> int {
        if (!(milliseconds >= 0 && milliseconds <= 120000)) return ErrorCode::ArgumentOutOfRange;
        block.system.motionParam[axis].globalMovingAverageProfileTimeMilliseconds = milliseconds;
        return ErrorCode::None;
    });
}
WMX3APIFUNC Config::GetMovingAverageProfileTime(int axis, double *pMilliseconds) {
    return for_axis(cmApi, axis, [&](Block &block) {
        *pMilliseconds = block.system.motionParam[axis].globalMovingAverageProfileTimeMilliseconds;
        return 0;
    });
}
WMX3APIFUNC Config::SetEncoderRange(int axis, bool enable, int low, int high) {
    return for_axis(cmApi, axis, [&](Block &block) {
        block.axis.encoderRangeMode[axis] = enable;
        block.axis.encoderRangeLow[axis] = low;
        block.axis.encoderRangeHigh[axis] = high;
        return 0;
    });
}
WMX3APIFUNC Config::GetEncoderRange(int axis, bool *pEnable, int *pLow, int *pHigh) {
    return for_axis(cmApi, axis, [&](Block &block) {
        *pEnable = block.axis.encoderRangeMode[axis];
        *pLow = block.axis.encoderRangeLow[axis];
        *pHigh = block.axis.encoderRangeHigh[axis];
        return 0;
    });
}

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

#define GLOBAL_ACCESS(type, member)                             \
    WMX3APIFUNC Config::Set##type(type *p, type *) {            \
        return with_engine(cmApi->wmx3Api, [&](Block &block) {  \
            block.system.member = *p;                           \
            return 0;                                           \
        });                                                     \
    }                                                           \
    WMX3APIFUNC Config::Get##type(type *p) {                    \
        return with_engine(cmApi->wmx3Api, [&](Block &block) {  \
            *p = block.system.member;                           \
            return 0;                                           \
        });                                                     \
    }
GLOBAL_ACCESS(FlightRecorderParam, flightRecorderParam)
GLOBAL_ACCESS(EmergencyStopParam, emergencyStopParam)

WMX3APIFUNC Config::SetFlightRecorderPath(char *pPath) {
    return pPath ? with_engine(cmApi->wmx3Api, [](Block &) { return 0; })
                 : static_cast<int>(ErrorCode::ArgumentIsNull);
}

WMX3APIFUNC Config::GetDefaultParam(SystemParam *pParam) {
    *pParam = *std::make_unique<SystemParam>();
    return ErrorCode::None;
}
WMX3APIFUNC Config::GetDefaultAxisParam(AxisParam *pParam) {
    *pParam = *std::make_unique<AxisParam>();
    return ErrorCode::None;
}

}  // namespace wmx3Api
