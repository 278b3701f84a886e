// Structures of CoreMotion::GetStatus. Part of the stand-in.
#pragma once

#include "WMX3Api.h"

namespace wmx3Api {

class AxisCompensation {
public:
    double pitchErrorCompensation, pitchErrorCompensation2D, backlashCompensation;
    double totalPosCompensation;
};

class AxisSupportedFunction {
public:
    bool posFeedbackSupport, posCommandSupport, velocityFeedbackSupport, velocityCommandSupport;
    bool velocityOffsetSupport, trqFeedbackSupport, trqCommandSupport, maxTrqLimitSupport;
    bool positiveTrqLimitSupport, negativeTrqLimitSupport, maxMotorSpeedSupport;
};

class CoreMotionAxisStatus {
public:
    bool servoOn;
    bool servoOffline;
    bool ampAlarm;
    int ampAlarmCode;
    int masterAxis;
    int secondMasterAxis;
    double posCmd;
    double actualPos;
    double compPosCmd;
    double compActualPos;
    double syncPosCmd;
    double syncActualPos;
    int encoderCommand;
    int encoderFeedback;
    long long accumulatedEncoderFeedback;
    double velocityCmd;
    double actualVelocity;
    double velocityLag;
    double torqueCmd;
    double actualTorque;
    double actualFollowingError;
    AxisCompensation compensation;
    AxisSupportedFunction axisSupportedFunction;
    OperationState::T opState;
    DetailOperationState::T detailOpState;
    AxisCommandMode::T axisCommandMode;
#if STANDIN_NEWER_STATUS
    AxisCommandMode::T axisCommandModeFeedback;
#endif
    AxisSyncMode::T axisSyncMode;
    double syncOffset, syncPhaseOffset, syncGearRatio;
    double profileTotalMilliseconds, profileAccMilliseconds, profileCruiseMilliseconds;
    double profileDecMilliseconds, profileRemainingMilliseconds, profileCompletedMilliseconds;
    double profileTargetPos;
    double profileTotalDistance, profileRemainingDistance, profileCompletedDistance;
    double intplVelocity;
    int intplSegment;
    bool followingErrorAlarm;
    bool commandReady;
    bool waitingForTrigger;
    bool motionPaused;
    bool motionComplete;
    bool execSuperimposedMotion;
    double cmdAcc;
    bool accFlag, decFlag;
    bool inPos, inPos2, inPos3, inPos4, inPos5;
    bool cmdDistributionEnd;
    bool posSet, delayedPosSet;
    unsigned int cmdDistributionEndDelayedPosSetDiff;
    bool positiveLS, negativeLS;
    bool nearPositiveLS, nearNegativeLS;
    bool externalPositiveLS, externalNegativeLS;
    bool positiveSoftLimit, negativeSoftLimit;
    HomeState::T homeState;
    HomeError::T homeError;
    double homeOffset;
    bool homeSwitch;
    bool homeDone;
    bool homePaused;
    bool cmdPosToFbPosFlag;
    unsigned int singleTurnCounter;
    double userOffset, userOffsetPosCmd, userOffsetActualPos;
#if STANDIN_NEWER_STATUS
    double userVelocityOffset, userTorqueOffset;
    double vibrationPosMin, vibrationPosMax, vibrationPosAvg;
    double vibrationVelMin, vibrationVelMax, vibrationVelAvg;
    double vibrationTrqMin, vibrationTrqMax, vibrationTrqAvg;
#endif
    CoreMotionAxisStatus();
};

class CoreMotionStatus {
public:
    bool invalidLicenseError = false;
    EngineState::T engineState = EngineState::Idle;
    int numOfInterrupts = 0;
    double cycleTimeMilliseconds[constants::maxInterrupts] = {};
    long long cycleCounter[constants::maxInterrupts] = {};
    bool emergencyStop = false;
    EStopLevel::T emergencyStopLevel = EStopLevel::Final;
    CoreMotionAxisStatus axesStatus[constants::maxAxes];
};

}  // namespace wmx3Api
