// Numbers and names of the enumerations, as far as they are known. Part of the stand-in.
#pragma once

#include "standin/error_codes.h"

namespace wmx3Api {

class DeviceType {
public:
    enum T {
        DeviceTypeNormal = 0, DeviceTypeLowPriority, DeviceTypeExitWOCnt,
        DeviceTypeLowpriorityExitWOCnt
    };
};

class EngineState {
public:
    enum T {
        Idle = 0, Running, Communicating, Shutdown, Unknown
    };
};

class ModuleId {
public:
    enum T {
        WMX3Engine = 0, SimuPlatform, EcPlatform, RtexPlatform, MIIIPlatform, CCLinkPlatform,
        M4Platform, CoreMotion = 10, Log, APIBuffer, CyclicBuffer, IO, Compensation, Event,
        AdvancedMotion, UserMemory, PMMotion, Coordinate = 26, CNC, Kinematics, PLC,
        UserRtdll0 = 32, UserRtdll1, UserRtdll2, ModuleSize = 64
    };
};

class ModuleType {
public:
    enum T {
        Motion = 0, Platform, Unknown
    };
};

class OperationState {
public:
    enum T {
        Idle = 0, Pos, Jog, Home, Sync, GantryHome, Stop, Intpl, Velocity, ConstLinearVelocity,
        Trq, DirectControl, PVT, ECAM, SyncCatchUp, DancerControl
    };
};

class DetailOperationState {
public:
    enum T {
        Idle = 0, Pos = 200, Pos_OverrideSetup, Pos_WaitingForTrigger, Jog = 300,
        Jog_OverrideSetup, Home = 400, Sync = 500, Sync_PhaseShift, Sync_GearShift,
        GantryHome = 600, Stop = 700, Stop_QStop, Stop_EStop, Intpl = 800, Intpl_Linear,
        Intpl_Circular, Intpl_Helical, Intpl_Spline, Intpl_Path, Intpl_PathWithRotation,
        Intpl_PathLookahead, Intpl_OverrideSetup, Intpl_OverrideSmoothing, Velocity = 900,
        Velocity_OverrideSetup, ConstLinearVelocity = 1100, Trq = 1200, Trq_OverrideSetup,
        DirectControl = 1300, PVT = 1400, ECAM = 1500, SyncCatchUp = 1600,
        DancerControl = 1700
    };
};

class AxisCommandMode {
public:
    enum T {
        Position = 0, Velocity, Torque
    };
};

class ProfileType {
public:
    enum T {
        Trapezoidal = 0, SCurve, JerkRatio, Parabolic, Sin, AdvancedS, TrapezoidalMAT,
        JerkLimited, JerkLimitedSCurve, JerkLimitedAdvancedS, TwoVelocityTrapezoidal,
        TwoVelocitySCurve, TwoVelocityJerkRatio, TimeAccTrapezoidal, TimeAccSCurve,
        TimeAccJerkRatio, TimeAccParabolic, TimeAccSin, TimeAccAdvancedS, ConstantDec,
        JerkRatioFixedVelocityT, JerkRatioFixedVelocityS, JerkLimitedFixedVelocityT,
        JerkLimitedFixedVelocityS, ParabolicVelocity
    };
};

class EStopLevel {
public:
    enum T {
        Final = 0, Level1
    };
};

class IOSourceType {
public:
    enum T {
        Input = 0, Output
    };
};

class FormatType {
public:
    enum T {
        Char = 0, Uchar, Short, Ushort, Int, Uint, Long, Ulong, Float, Double
    };
};

class SizeUnit {
public:
    enum T {
        Byte = 0, Kilobyte, Megabyte
    };
};

class HomeState {
public:
    enum T {
        Idle = 0, ZPulseSearch, ZPulseSearchReverse, ZPulseSearchPauseReverse, HSSearch,
        HSSearchPause, HSAndZPulseSearch, HSAndZPulseSearchPause, HSOffSearch,
        HSOffSearchPause, HSOffAndZPulseSearch, HSOffAndZPulseSearchPause, LSSearch,
        LSSearchPause, HSClearReverse, HSClearReversePause, HSFallingEdgeSearchReverse,
        HSFallingEdgeSearchReversePause, LSFallingEdgeSearchReverse,
        LSFallingEdgeSearchReversePause, TouchProbeSearch, TouchProbeSearchPause,
        SecondHSSearch, SecondHSSearchPause, SecondTouchProbeSearch,
        SecondTouchProbeSearchPause, MechanicalEndDetection, HomeShift, HomeShiftPause, Cancel
    };
};

class HomeError {
public:
    enum T {
        NoError = 0, LSTriggered, MaxLSRevDistanceTraveled, MaxHSOnAtStartRevDistanceTraveled,
        ZPulseDistanceCheckError
    };
};

class AxisSyncMode {
public:
    enum T {
        NoSync = 0, NoOffset, VelocityOffset, SymmetricVelocityOffset
    };
};

class TriggerType {
public:
    enum T {
        RemainingTime = 0, RemainingDistance, SameTimeCompletion, CompletedTime,
        CompletedDistance, StaggeredTimeCompletion, StaggeredDistanceCompletion,
        DistanceToTarget
    };
};

class TriggerEventInputFunction {
public:
    enum T {
        IOBit = 0, NotIOBit, OrIOBit, AndIOBit, XorIOBit, NandIOBit, NorIOBit, XnorIOBit, MBit,
        NotMBit, OrMBit, AndMBit, XorMBit, NandMBit, NorMBit, XnorMBit, Reg, NotReg, OrReg,
        AndReg, XorReg, NandReg, NorReg, XnorReg, EqualPos, GreaterPos, LessPos, EqualVelocity,
        GreaterVelocity, LessVelocity, EqualTrq, GreaterTrq, LessTrq, RemainingTime,
        RemainingDistance, SameTimeCompletion, CompletedTime, CompletedDistance,
        StaggeredTimeCompletion, StaggeredDistanceCompletion, DistanceToTarget
    };
};

class TriggerEventOutputFunction {
public:
    enum T {
        TriggerMotion = 0, SetReg
    };
};

// Nested in Config, which inherits them.
class ConfigEnums {
public:
    class VelocityMonitorSource {
    public:
        enum T {
            UseVelocityFeedback = 0, CalculateFromPositionFeedback
        };
    };
    class HomeDirection {
    public:
        enum T {
            Positive = 0, Negative
        };
    };
    class HomeType {
    public:
        enum T {
            CurrentPos = 0, ZPulse, HS, HSHS, HSZPulse, HSReverseZPulse, HSOff, HSOffZPulse,
            HSOffReverseZPulse, LSReverseZPulse, NearLSReverseZPulse, ExternalLSReverseZPulse,
            TouchProbe, HSTouchProbe, LS, NearLS, ExternalLS, MechanicalEndDetection,
            MechanicalEndDetectionHS, MechanicalEndDetectionLS,
            MechanicalEndDetectionReverseZPulse
        };
    };
    class LimitSwitchType {
    public:
        enum T {
            None = 0, ServoOff, DecServoOff, Dec, SlowDecServoOff, SlowDec,
            SeparatePositiveLSNegativeLS
        };
    };
    class LimitSwitchDirection {
    public:
        enum T {
            Normal = 0, Reverse
        };
    };
    class ProhibitOvertravelType {
    public:
        enum T {
            Disabled = 0, ChangeDeceleration, ChangeInitialVelocity
        };
    };
    class LinearIntplOverrideType {
    public:
        enum T {
            Smoothing = 0, Blending, FastBlending
        };
    };
    class LinearIntplProfileCalcMode {
    public:
        enum T {
            AxisLimit = 0, MatchSlowestAxis, MatchFarthestAxis
        };
    };
    class CircularIntplOverrideType {
    public:
        enum T {
            Blending = 0, FastBlending
        };
    };
    class FollowingErrorAlarmType {
    public:
        enum T {
            NoAction = 0, QuickStop
        };
    };
    class VelocityFollowingErrorAlarmType {
    public:
        enum T {
            NoAction = 0, QuickStop, Warning
        };
    };
    class SyncCompensationMode {
    public:
        enum T {
            None = 0, VelocityOffset, SymmetricVelocityOffset
        };
    };
    class MasterDesyncType {
    public:
        enum T {
            NoAction = 0, ServoOff, DecServoOff, Dec
        };
    };
    class SlaveDesyncType {
    public:
        enum T {
            NoAction = 0, ServoOff, ResolveSync
        };
    };
    class EStopSignalSource {
    public:
        enum T {
            Input = 0, Output, UserMemory
        };
    };
    class EStopStatusSignalDestination {
    public:
        enum T {
            Output = 0, UserMemory
        };
    };
    class EStopLevel1Type {
    public:
        enum T {
            Dec = 0, DecServoOff
        };
    };
};

// Nested in Motion, which inherits them.
class MotionEnums {
public:
    class WaitConditionType {
    public:
        enum T {
            AxisIdle = 0, MotionStarted, MotionStartedOverrideReady, Event
        };
    };
};

}  // namespace wmx3Api
