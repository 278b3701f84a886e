// STAND-IN for the vendor's header of this name, for tests. See tests/standin/README.md.
#pragma once

#include "WMX3Api.h"
#include "standin/parameters.h"

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

class CoreMotion;

// A part of CoreMotion; bound to the object that owns it.
class CoreMotionPart {
public:
    CoreMotion *cmApi;
    explicit CoreMotionPart(CoreMotion *owner) : cmApi(owner) {}
    bool IsDeviceValid();
};

class AxisControl : public CoreMotionPart {
public:
    using CoreMotionPart::CoreMotionPart;
#if STANDIN_SERVO_ON == 0 || STANDIN_SERVO_ON == 2
    WMX3APIFUNC SetServoOn(int axis, int newStatus);
    WMX3APIFUNC SetServoOn(AxisSelection *pAxisSelection, int newStatus);
#endif
#if STANDIN_SERVO_ON == 1
    WMX3APIFUNC SetServoOn(int axis, int newStatus, unsigned int waitTimeMilliseconds = 0);
    WMX3APIFUNC SetServoOn(AxisSelection *pAxisSelection, int newStatus,
                           unsigned int waitTimeMilliseconds = 0);
#elif STANDIN_SERVO_ON >= 2
    WMX3APIFUNC SetServoOn(int axis, int newStatus, int waitTimeMilliseconds);
    WMX3APIFUNC SetServoOn(AxisSelection *pAxisSelection, int newStatus, int waitTimeMilliseconds);
#endif
    WMX3APIFUNC ClearAmpAlarm(int axis);
    WMX3APIFUNC ClearAmpAlarm(AxisSelection *pAxisSelection);
    WMX3APIFUNC ClearAxisAlarm(int axis);
    WMX3APIFUNC ClearAxisAlarm(AxisSelection *pAxisSelection);
    WMX3APIFUNC SetAxisCommandMode(int axis, AxisCommandMode::T mode);
    WMX3APIFUNC SetAxisCommandMode(AxisSelection *pAxisSelection, AxisCommandMode::T mode);
    WMX3APIFUNC GetAxisCommandMode(int axis, AxisCommandMode::T *pMode);
    WMX3APIFUNC GetPosCommand(int axis, double *pValue);
    WMX3APIFUNC GetPosFeedback(int axis, double *pValue);
    WMX3APIFUNC GetVelCommand(int axis, double *pValue);
    WMX3APIFUNC GetVelFeedback(int axis, double *pValue);
};

class Config : public CoreMotionPart, public ConfigParams {
public:
    using CoreMotionPart::CoreMotionPart;
    WMX3APIFUNC SetParam(SystemParam *pParam, SystemParam *pParamError = nullptr);
    WMX3APIFUNC SetParam(int axis, SystemParam *pParam, SystemParam *pParamError = nullptr);
    WMX3APIFUNC GetParam(SystemParam *pParam);
    WMX3APIFUNC GetParam(int axis, SystemParam *pParam);
    WMX3APIFUNC SetAxisParam(AxisParam *pParam, AxisParam *pParamError = nullptr);
    WMX3APIFUNC SetAxisParam(int axis, AxisParam *pParam, AxisParam *pParamError = nullptr);
    WMX3APIFUNC GetAxisParam(AxisParam *pParam);
    WMX3APIFUNC GetAxisParam(int axis, AxisParam *pParam);
    WMX3APIFUNC SetGearRatio(int axis, double numerator, double denominator);
    WMX3APIFUNC GetGearRatio(int axis, double *pNumerator, double *pDenominator);
    WMX3APIFUNC SetAxisPolarity(int axis, char polarity);
    WMX3APIFUNC GetAxisPolarity(int axis, char *pPolarity);
    WMX3APIFUNC SetAbsoluteEncoderMode(int axis, bool enable);
    WMX3APIFUNC GetAbsoluteEncoderMode(int axis, bool *pEnable);
    WMX3APIFUNC SetAbsoluteEncoderHomeOffset(int axis, double offset);
    WMX3APIFUNC GetAbsoluteEncoderHomeOffset(int axis, double *pOffset);
    WMX3APIFUNC SetSingleTurn(int axis, bool enable, unsigned int encoderCount);
    WMX3APIFUNC GetSingleTurn(int axis, bool *pEnable, unsigned int *pEncoderCount);
    WMX3APIFUNC SetAxisUnit(int axis, double unit);
    WMX3APIFUNC GetAxisUnit(int axis, double *pUnit);
    WMX3APIFUNC SetFeedbackParam(int axis, FeedbackParam *p, FeedbackParam *pErr = nullptr);
    WMX3APIFUNC GetFeedbackParam(int axis, FeedbackParam *p);
    WMX3APIFUNC SetHomeParam(int axis, HomeParam *p, HomeParam *pErr = nullptr);
    WMX3APIFUNC GetHomeParam(int axis, HomeParam *p);
    WMX3APIFUNC SetLimitParam(int axis, LimitParam *p, LimitParam *pErr = nullptr);
    WMX3APIFUNC GetLimitParam(int axis, LimitParam *p);
    WMX3APIFUNC SetMotionParam(int axis, MotionParam *p, MotionParam *pErr = nullptr);
    WMX3APIFUNC GetMotionParam(int axis, MotionParam *p);
    WMX3APIFUNC SetAlarmParam(int axis, AlarmParam *p, AlarmParam *pErr = nullptr);
    WMX3APIFUNC GetAlarmParam(int axis, AlarmParam *p);
    WMX3APIFUNC SetSyncParam(int axis, SyncParam *p, SyncParam *pErr = nullptr);
    WMX3APIFUNC GetSyncParam(int axis, SyncParam *p);
    WMX3APIFUNC GetDefaultParam(SystemParam *pParam);
    WMX3APIFUNC GetDefaultAxisParam(AxisParam *pParam);
    WMX3APIFUNC Import(char *pPath, SystemParam *pParam);
    WMX3APIFUNC Import(char *pPath, AxisParam *pAxisParam);
    WMX3APIFUNC Import(char *pPath, SystemParam *pParam, AxisParam *pAxisParam);
    WMX3APIFUNC Export(char *pPath, SystemParam *pParam);
    WMX3APIFUNC Export(char *pPath, AxisParam *pAxisParam);
    WMX3APIFUNC Export(char *pPath, SystemParam *pParam, AxisParam *pAxisParam);
    WMX3APIFUNC GetAndExportAll(char *pPath);
    WMX3APIFUNC ImportAndSetAll(char *pPath, SystemParam *pParamError = nullptr,
                                AxisParam *pAxisParamError = nullptr);
    WMX3APIFUNC ImportAndSetAll(wchar_t *pPath, SystemParam *pParamError = nullptr,
                                AxisParam *pAxisParamError = nullptr);
};

class Home : public CoreMotionPart {
public:
    using CoreMotionPart::CoreMotionPart;
    WMX3APIFUNC StartHome(int axis);
    WMX3APIFUNC StartHome(AxisSelection *pAxisSelection);
    WMX3APIFUNC Continue(int axis);
    WMX3APIFUNC Cancel(int axis);
    WMX3APIFUNC SetCommandPos(int axis, double position);
    WMX3APIFUNC SetFeedbackPos(int axis, double position);
    WMX3APIFUNC SetCommandPosToFeedbackPos(int axis, double posChangePerCycle = 0);
    WMX3APIFUNC SetHomeDone(int axis, unsigned char value);
};

class Motion : public CoreMotionPart, public MotionEnums {
public:
    class PosCommand {
    public:
        int axis;
        double target;
        Profile profile;
        PosCommand() : axis(0), target(0) {}
        PosCommand(int axis, double target, Profile profile)
            : axis(axis), target(target), profile(profile) {}
    };
    class JogCommand {
    public:
        int axis;
        Profile profile;
        JogCommand() : axis(0) {}
        JogCommand(int axis, Profile profile) : axis(axis), profile(profile) {}
    };
    class StopCommand {
    public:
        int axis = 0;
        double dec = 0;
    };
    class TimeCommand {
    public:
        int axis = 0;
        double timeMilliseconds = 0;
    };
    class WaitCondition {
    public:
        WaitConditionType::T waitConditionType = WaitConditionType::AxisIdle;
        int axisCount = 0;
        int axis[constants::maxAxes] = {};
        unsigned int eventID = 0;
    };
    class LinearIntplCommand {
    public:
        unsigned int axisCount = 0;
        int axis[constants::maxAxes] = {};
        double target[constants::maxAxes] = {};
        double maxVelocity[constants::maxAxes] = {}, maxAcc[constants::maxAxes] = {};
        double maxDec[constants::maxAxes] = {}, maxJerkAcc[constants::maxAxes] = {};
        double maxJerkDec[constants::maxAxes] = {};
        Profile profile;
    };

    using CoreMotionPart::CoreMotionPart;
    WMX3APIFUNC StartPos(PosCommand *pCommand);
    WMX3APIFUNC StartPos(unsigned int numCommands, PosCommand *pCommands);
    WMX3APIFUNC StartMov(PosCommand *pCommand);
    WMX3APIFUNC StartMov(unsigned int numCommands, PosCommand *pCommands);
    WMX3APIFUNC StartJog(JogCommand *pCommand);
    WMX3APIFUNC StartJog(unsigned int numCommands, JogCommand *pCommands);
    WMX3APIFUNC StartLinearIntplPos(LinearIntplCommand *pCommand);
    WMX3APIFUNC StartLinearIntplMov(LinearIntplCommand *pCommand);
    WMX3APIFUNC Stop(int axis);
    WMX3APIFUNC Stop(int axis, double dec);
    WMX3APIFUNC Stop(AxisSelection *pAxisSelection);
    WMX3APIFUNC Stop(unsigned int numCommands, StopCommand *pCommands);
    WMX3APIFUNC ExecQuickStop(int axis);
    WMX3APIFUNC ExecQuickStop(AxisSelection *pAxisSelection);
    WMX3APIFUNC ExecTimedStop(int axis, double timeMilliseconds);
    WMX3APIFUNC ExecTimedStop(AxisSelection *pAxisSelection, double timeMilliseconds);
    WMX3APIFUNC Wait(int axis);
    WMX3APIFUNC Wait(AxisSelection *pAxisSelection);
    WMX3APIFUNC Wait(WaitCondition *pWaitCondition);
    WMX3APIFUNC Wait(int axis, unsigned int waitTimeMilliseconds);
    WMX3APIFUNC Wait(AxisSelection *pAxisSelection, unsigned int waitTimeMilliseconds);
    WMX3APIFUNC Wait(WaitCondition *pWaitCondition, unsigned int waitTimeMilliseconds);
    WMX3APIFUNC OverridePos(PosCommand *pCommand);
    WMX3APIFUNC OverrideVel(PosCommand *pCommand);
};

class Velocity : public CoreMotionPart {
public:
    class VelCommand {
    public:
        int axis;
        Profile profile;
        VelCommand() : axis(0) {}
        VelCommand(int axis, Profile profile) : axis(axis), profile(profile) {}
    };
    using CoreMotionPart::CoreMotionPart;
    WMX3APIFUNC StartVel(VelCommand *pCommand);
    WMX3APIFUNC StartVel(unsigned int numCommands, VelCommand *pCommands);
    WMX3APIFUNC OverrideVel(VelCommand *pCommand);
    WMX3APIFUNC Stop(int axis);
    WMX3APIFUNC Stop(AxisSelection *pAxisSelection);
    WMX3APIFUNC ExecQuickStop(int axis);
    WMX3APIFUNC ExecQuickStop(AxisSelection *pAxisSelection);
    WMX3APIFUNC ExecTimedStop(int axis, double timeMilliseconds);
    WMX3APIFUNC SetMaxMotorSpeed(int axis, double rpm);
    WMX3APIFUNC GetMaxMotorSpeed(int axis, double *pRpm);
};

class Torque : public CoreMotionPart {
public:
    class TrqCommand {
    public:
        int axis = 0;
        double torque = 0;
    };
    using CoreMotionPart::CoreMotionPart;
    WMX3APIFUNC StartTrq(TrqCommand *pCommand);
    WMX3APIFUNC StopTrq(int axis);
    WMX3APIFUNC SetMaxTrqLimit(int axis, double percent);
    WMX3APIFUNC GetMaxTrqLimit(int axis, double *pPercent);
    WMX3APIFUNC SetPositiveTrqLimit(int axis, double percent);
    WMX3APIFUNC GetPositiveTrqLimit(int axis, double *pPercent);
    WMX3APIFUNC SetNegativeTrqLimit(int axis, double percent);
    WMX3APIFUNC GetNegativeTrqLimit(int axis, double *pPercent);
};

class Sync : public CoreMotionPart {
public:
    using CoreMotionPart::CoreMotionPart;
};

class CoreMotion {
public:
    AxisControl *axisControl;
    Motion *motion;
    Home *home;
    Velocity *velocity;
    Torque *torque;
    Sync *sync;
    Config *config;

    CoreMotion();
    explicit CoreMotion(WMX3Api *f);
    CoreMotion(const CoreMotion &other);
    CoreMotion &operator=(const CoreMotion &other);
    ~CoreMotion();

    WMX3APIFUNC GetStatus(CoreMotionStatus *pStatus);
    WMX3APIFUNC GetVersion(int *major, int *minor, int *revision, int *fix);
    WMX3APIFUNC ExecEStop(EStopLevel::T level);
    WMX3APIFUNC ReleaseEStop();
    static WMX3APIFUNC ErrorToString(int errCode, char *pString, unsigned int size);
    static WMX3APIFUNC GetLibVersion(int *major, int *minor, int *revision, int *fix);
    bool IsDeviceValid();

    WMX3Api *wmx3Api;
};

}  // namespace wmx3Api
