// Members of the parameter groups. Part of the stand-in.
#pragma once

#include "standin/constants.h"
#include "standin/enums.h"

namespace wmx3Api {

// Nested in Config, which inherits them.
class ConfigParams : public ConfigEnums {
public:
    class FeedbackParam {
    public:
        double inPosWidth;
        double inPosWidth2;
        double inPosWidth3;
        double inPosWidth4;
        double inPosWidth5;
        VelocityMonitorSource::T velocityMonitorSource;
        double posSetWidth;
        double delayedPosSetWidth;
        double delayedPosSetMilliseconds;
        FeedbackParam();
    };
    class HomeParam {
    public:
        HomeType::T homeType;
        HomeDirection::T homeDirection;
        double homingVelocitySlow;
        double homingVelocitySlowAcc;
        double homingVelocitySlowDec;
        double homingVelocityFast;
        double homingVelocityFastAcc;
        double homingVelocityFastDec;
        double homingReverseDistance;
        double homeShiftVelocity;
        double homeShiftAcc;
        double homeShiftDec;
        double homeShiftDistance;
        bool invertHSPolarity;
        unsigned int multipleZPulse;
        bool roundPosCmdAfterHoming;
        bool pauseMode;
        double maxHSOnAtStartReverseDistance;
        double maxLSReverseDistance;
        unsigned int zPulseDistanceCheck;
        double homePosition;
        bool gantryHomingUseSlaveHS;
        bool gantryHomingUseSlaveLS;
        bool gantryHomingUseSlaveZPulse;
        bool gantryHomingUseSlaveTouchProbe;
        bool gantryHomingUseSlaveMechanicalEnd;
        bool gantryHomingRetainSyncOffset;
        bool immediateStopAtLS;
        double mechanicalEndDetectionPosDiff;
        double mechanicalEndDetectionTimeMilliseconds;
        bool mechanicalEndDetectionIgnoreLS;
        double mechanicalEndDetectionFirstTorqueLimit;
        double mechanicalEndDetectionSecondTorqueLimit;
        bool openLoopHoming;
        bool clearHomeDoneOnServoOff;
        bool clearHomeDoneOnCommStop;
        bool keepMechEndTorqueLimit;
        HomeParam();
    };
    class LimitParam {
    public:
        LimitSwitchType::T lsType;
        LimitSwitchType::T positiveLSType;
        LimitSwitchType::T negativeLSType;
        bool invertPositiveLSPolarity;
        bool invertNegativeLSPolarity;
        double lsDec;
        double lsSlowDec;
        LimitSwitchType::T softLimitType;
        LimitSwitchType::T positiveSoftLimitType;
        LimitSwitchType::T negativeSoftLimitType;
        double softLimitPositivePos;
        double softLimitNegativePos;
        bool allLSDuringHoming;
        LimitSwitchType::T nearLSType;
        LimitSwitchType::T nearPositiveLSType;
        LimitSwitchType::T nearNegativeLSType;
        bool invertNearPositiveLSPolarity;
        int nearPositiveLSByte;
        int nearPositiveLSBit;
        bool invertNearNegativeLSPolarity;
        int nearNegativeLSByte;
        int nearNegativeLSBit;
        LimitSwitchType::T externalLSType;
        LimitSwitchType::T externalPositiveLSType;
        LimitSwitchType::T externalNegativeLSType;
        bool invertExternalPositiveLSPolarity;
        int externalPositiveLSByte;
        int externalPositiveLSBit;
        bool invertExternalNegativeLSPolarity;
        int externalNegativeLSByte;
        int externalNegativeLSBit;
        LimitSwitchDirection::T lsDirection;
        LimitParam();
    };
    class MotionParam {
    public:
        double quickStopDec;
        ProhibitOvertravelType::T prohibitOvertravel;
        LinearIntplOverrideType::T linearIntplOverrideType;
        unsigned int linearIntplOverrideSmoothPercent;
        CircularIntplOverrideType::T circularIntplOverrideType;
        bool interruptedIntplUseQuickStop;
        bool singleTurnReduceToHalfTurn;
        bool enableGlobalStartingVelocity;
        double globalStartingVelocity;
        bool enableGlobalEndVelocity;
        double globalEndVelocity;
        bool enableGlobalMinVelocity;
        double globalMinVelocity;
        bool enableGlobalMovingAverageProfileTimeMilliseconds;
        double globalMovingAverageProfileTimeMilliseconds;
        bool apiWaitUntilMotionStart;
        LinearIntplProfileCalcMode::T linearIntplProfileCalcMode;
        MotionParam();
    };
    class AlarmParam {
    public:
        FollowingErrorAlarmType::T followingErrorType;
        double followingErrorStopped;
        double followingErrorMoving;
        VelocityFollowingErrorAlarmType::T velocityFollowingErrorType;
        double velocityFollowingErrorStopped;
        double velocityFollowingErrorStoppedMilliseconds;
        double velocityFollowingErrorMoving;
        double velocityFollowingErrorMovingMilliseconds;
        bool servoOffDuringAmpAlarm;
        int servoOnFollowingError;
        AlarmParam();
    };
    class SyncParam {
    public:
        int inSyncWidth;
        double limitCompensation;
        double syncGain;
        SyncCompensationMode::T syncCompensationMode;
        MasterDesyncType::T masterDesyncType;
        double masterDesyncDec;
        SlaveDesyncType::T slaveDesyncType;
        double slaveDesyncDec;
        bool syncLS;
        bool matchPos;
        SyncParam();
    };
    class FlightRecorderParam {
    public:
        bool enableFlightRecorder;
        bool flightRecorderTimeStamp;
        bool triggerFlightRecorderOnAmpAlarm;
        bool collectAxisFlightRecorderData[constants::maxAxes];
        FlightRecorderParam();
    };
    class EmergencyStopParam {
    public:
        bool enableEStopSignal;
        EStopSignalSource::T eStopSignalSource;
        EStopLevel::T eStopSignalLevel;
        bool invertEStopSignalPolarity;
        unsigned int eStopSignalByteAddress;
        unsigned char eStopSignalBitAddress;
        bool enableEStopStatusSignal;
        EStopStatusSignalDestination::T eStopStatusSignalDestination;
        bool invertEStopStatusSignalPolarity;
        unsigned int eStopStatusSignalByteAddress;
        unsigned char eStopStatusSignalBitAddress;
        EStopLevel1Type::T eStopLevel1Type;
        double eStopDec[constants::maxAxes];
        EmergencyStopParam();
    };
    class AxisParam {
    public:
        AxisCommandMode::T axisCommandMode[constants::maxAxes];
        double gearRatioNumerator[constants::maxAxes];
        double gearRatioDenominator[constants::maxAxes];
        bool singleTurnMode[constants::maxAxes];
        unsigned int singleTurnEncoderCount[constants::maxAxes];
        double maxTrqLimit[constants::maxAxes];
        bool enableMaxTrqLimitRamp[constants::maxAxes];
        double maxTrqLimitRampRate[constants::maxAxes];
        double posFErrorInstantMaxTrqLimitThreshold[constants::maxAxes];
        double negativeTrqLimit[constants::maxAxes];
        double positiveTrqLimit[constants::maxAxes];
        double axisUnit[constants::maxAxes];
        double velocityFeedforwardGain[constants::maxAxes];
        char axisPolarity[constants::maxAxes];
        double maxMotorSpeed[constants::maxAxes];
        bool absoluteEncoderMode[constants::maxAxes];
        double absoluteEncoderHomeOffset[constants::maxAxes];
        bool encoderRangeMode[constants::maxAxes];
        int encoderRangeLow[constants::maxAxes];
        int encoderRangeHigh[constants::maxAxes];
        AxisParam();
    };
    class SystemParam {
    public:
        FeedbackParam feedbackParam[constants::maxAxes];
        HomeParam homeParam[constants::maxAxes];
        LimitParam limitParam[constants::maxAxes];
        MotionParam motionParam[constants::maxAxes];
        AlarmParam alarmParam[constants::maxAxes];
        SyncParam syncParam[constants::maxAxes];
        FlightRecorderParam flightRecorderParam;
        EmergencyStopParam emergencyStopParam;
    };
};

}  // namespace wmx3Api
