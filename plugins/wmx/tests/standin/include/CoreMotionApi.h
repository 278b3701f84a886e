// STAND-IN for the vendor's header of this name, for tests. See tests/standin/README.md.
#pragma once

#include "WMX3Api.h"
#include "standin/parameters.h"
#include "standin/status.h"

namespace wmx3Api {

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
    WMX3APIFUNC SetMovingAverageProfileTime(int axis, double milliseconds);
    WMX3APIFUNC GetMovingAverageProfileTime(int axis, double *pMilliseconds);
    WMX3APIFUNC SetVelocityFeedforwardGain(int axis, double gain);
    WMX3APIFUNC GetVelocityFeedforwardGain(int axis, double *pGain);
    WMX3APIFUNC SetEncoderRange(int axis, bool enable, int low, int high);
    WMX3APIFUNC GetEncoderRange(int axis, bool *pEnable, int *pLow, int *pHigh);
    WMX3APIFUNC SetFlightRecorderParam(FlightRecorderParam *p, FlightRecorderParam *pErr = nullptr);
    WMX3APIFUNC GetFlightRecorderParam(FlightRecorderParam *p);
    WMX3APIFUNC SetFlightRecorderPath(char *pPath);
    WMX3APIFUNC SetEmergencyStopParam(EmergencyStopParam *p, EmergencyStopParam *pErr = nullptr);
    WMX3APIFUNC GetEmergencyStopParam(EmergencyStopParam *p);
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
    // Each with a path of char and of wchar_t, of one object or both, of all axes or one of them.
#define STANDIN_FILE_CALLS(Char)                                                              \
    WMX3APIFUNC Import(Char *pPath, SystemParam *pParam);                                     \
    WMX3APIFUNC Import(Char *pPath, AxisParam *pAxisParam);                                   \
    WMX3APIFUNC Import(Char *pPath, SystemParam *pParam, AxisParam *pAxisParam);              \
    WMX3APIFUNC Import(Char *pPath, SystemParam *pParam, int axis,                            \
                       AxisSelection *copyParamToAxes = nullptr);                             \
    WMX3APIFUNC Import(Char *pPath, AxisParam *pAxisParam, int axis,                          \
                       AxisSelection *copyParamToAxes = nullptr);                             \
    WMX3APIFUNC Import(Char *pPath, SystemParam *pParam, AxisParam *pAxisParam, int axis,     \
                       AxisSelection *copyParamToAxes = nullptr);                             \
    WMX3APIFUNC Export(Char *pPath, SystemParam *pParam);                                     \
    WMX3APIFUNC Export(Char *pPath, AxisParam *pAxisParam);                                   \
    WMX3APIFUNC Export(Char *pPath, SystemParam *pParam, AxisParam *pAxisParam);              \
    WMX3APIFUNC Export(Char *pPath, SystemParam *pParam, int axis);                           \
    WMX3APIFUNC Export(Char *pPath, AxisParam *pAxisParam, int axis);                         \
    WMX3APIFUNC Export(Char *pPath, SystemParam *pParam, AxisParam *pAxisParam, int axis);
    STANDIN_FILE_CALLS(char)
    STANDIN_FILE_CALLS(wchar_t)
#undef STANDIN_FILE_CALLS
    WMX3APIFUNC GetAndExportAll(char *pPath);
    WMX3APIFUNC GetAndExportAll(wchar_t *pPath);
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
    WMX3APIFUNC Continue(AxisSelection *pAxisSelection);
    WMX3APIFUNC Cancel(int axis);
    WMX3APIFUNC Cancel(AxisSelection *pAxisSelection);
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
#if STANDIN_NEWER_STATUS
        void SetRunTime(double milliseconds) { standinRunTime = milliseconds; }
        double standinRunTime = 0;  // 0: until it is stopped
#endif
    };
    class TimedJogCommand {
    public:
        int axis = 0;
        double runTimeMilliseconds = 0;
        Profile profile;
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
    WMX3APIFUNC StartJog(TimedJogCommand *pCommand);
    WMX3APIFUNC StartJog(unsigned int numCommands, TimedJogCommand *pCommands);
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
    WMX3APIFUNC ExecTimedStop(unsigned int numCommands, TimeCommand *pCommands);
    WMX3APIFUNC Pause(int axis);
    WMX3APIFUNC Pause(AxisSelection *pAxisSelection);
    WMX3APIFUNC Resume(int axis);
    WMX3APIFUNC Resume(AxisSelection *pAxisSelection);
    WMX3APIFUNC Wait(int axis);
    WMX3APIFUNC Wait(AxisSelection *pAxisSelection);
    WMX3APIFUNC Wait(WaitCondition *pWaitCondition);
    WMX3APIFUNC Wait(int axis, unsigned int waitTimeMilliseconds);
    WMX3APIFUNC Wait(AxisSelection *pAxisSelection, unsigned int waitTimeMilliseconds);
    WMX3APIFUNC Wait(WaitCondition *pWaitCondition, unsigned int waitTimeMilliseconds);
    WMX3APIFUNC OverridePos(PosCommand *pCommand);
    WMX3APIFUNC OverridePos(unsigned int numCommands, PosCommand *pCommands);
    WMX3APIFUNC OverrideMov(PosCommand *pCommand);
    WMX3APIFUNC OverrideMov(unsigned int numCommands, PosCommand *pCommands);
    WMX3APIFUNC OverrideVel(PosCommand *pCommand);
    WMX3APIFUNC OverrideVel(unsigned int numCommands, PosCommand *pCommands);
    WMX3APIFUNC OverrideAcc(PosCommand *pCommand);
    WMX3APIFUNC OverrideAcc(unsigned int numCommands, PosCommand *pCommands);
    WMX3APIFUNC OverrideDec(PosCommand *pCommand);
    WMX3APIFUNC OverrideDec(unsigned int numCommands, PosCommand *pCommands);
    WMX3APIFUNC OverrideJerkAcc(PosCommand *pCommand);
    WMX3APIFUNC OverrideJerkAcc(unsigned int numCommands, PosCommand *pCommands);
    WMX3APIFUNC OverrideJerkDec(PosCommand *pCommand);
    WMX3APIFUNC OverrideJerkDec(unsigned int numCommands, PosCommand *pCommands);
    WMX3APIFUNC OverrideProfile(PosCommand *pCommand);
    WMX3APIFUNC OverrideProfile(unsigned int numCommands, PosCommand *pCommands);
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
    class TimedVelCommand {
    public:
        int axis = 0;
        double runTimeMilliseconds = 0;
        Profile profile;
    };
    class TimeCommand {
    public:
        int axis = 0;
        double timeMilliseconds = 0;
    };
    using CoreMotionPart::CoreMotionPart;
    WMX3APIFUNC StartVel(VelCommand *pCommand);
    WMX3APIFUNC StartVel(unsigned int numCommands, VelCommand *pCommands);
    WMX3APIFUNC StartVel(VelCommand *pCommand, double maxTrqLimit);
    WMX3APIFUNC StartVel(TimedVelCommand *pCommand);
    WMX3APIFUNC StartVel(unsigned int numCommands, TimedVelCommand *pCommands);
    WMX3APIFUNC OverrideVel(VelCommand *pCommand);
    WMX3APIFUNC OverrideVel(unsigned int numCommands, VelCommand *pCommands);
    WMX3APIFUNC Stop(int axis);
    WMX3APIFUNC Stop(AxisSelection *pAxisSelection);
    WMX3APIFUNC ExecQuickStop(int axis);
    WMX3APIFUNC ExecQuickStop(AxisSelection *pAxisSelection);
    WMX3APIFUNC ExecTimedStop(int axis, double timeMilliseconds);
    WMX3APIFUNC ExecTimedStop(AxisSelection *pAxisSelection, double timeMilliseconds);
    WMX3APIFUNC ExecTimedStop(unsigned int numCommands, TimeCommand *pCommands);
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
    WMX3APIFUNC TriggerFlightRecorder();
    WMX3APIFUNC ResetFlightRecorder();
#if STANDIN_NEWER_STATUS
    WMX3APIFUNC ClearVibrationStatus(int axis);
    WMX3APIFUNC ClearVibrationStatus(AxisSelection *pAxisSelection);
#endif
    static WMX3APIFUNC ErrorToString(int errCode, char *pString, unsigned int size);
    static WMX3APIFUNC GetLibVersion(int *major, int *minor, int *revision, int *fix);
    bool IsDeviceValid();

    WMX3Api *wmx3Api;
};

}  // namespace wmx3Api
