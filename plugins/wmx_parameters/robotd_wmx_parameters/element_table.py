"""Table of the elements of a WMX parameter file: kind, unit, range and default.

Ranges and defaults are those of WMX 3.7, in the order in which the engine writes them. "uu" is
the user unit of an axis: the radian where the gear denominator is 2π. A nested element is
named by its path (``pid/integralGain``).
"""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple


class Kind(Enum):
    """Syntax of the text of an element."""

    REAL = "a number"
    WHOLE = "a whole number"
    CHOICE = "a number of an enumeration"
    FLAG = "0 or 1"
    SIGN = "1 or -1"


class Parameter(NamedTuple):
    """One element. ``enum`` is the vendor's name of a choice's enumeration, else empty."""

    name: str
    kind: Kind
    unit: str
    low: float
    high: float
    default: float
    enum: str = ""


_MAX = 274_877_906_943
_INT_MAX = 2**31 - 1
_TINY = 1e-6
_LAST_BYTE = 7999
_LAST_BIT = 7


def _real(name: str, unit: str, low: float, high: float, default: float) -> Parameter:
    return Parameter(name, Kind.REAL, unit, low, high, default)


def _whole(name: str, unit: str, low: float, high: float, default: float) -> Parameter:
    return Parameter(name, Kind.WHOLE, unit, low, high, default)


def _choice(name: str, enum: str, highest: int, default: int) -> Parameter:
    return Parameter(name, Kind.CHOICE, "", 0, highest, default, enum)


def _flag(name: str, default: int) -> Parameter:
    return Parameter(name, Kind.FLAG, "", 0, 1, default)


Sections = dict[str, tuple[Parameter, ...]]

GLOBAL_SECTIONS: Sections = {
    "FlightRecorderParam": (
        _flag("EnableFlightRecorder", 1),
        _flag("FlightRecorderTimeStamp", 0),
        _flag("TriggerFlightRecorderOnAmpAlarm", 1),
    ),
    "EmergencyStopParam": (
        _flag("EnableEStopSignal", 0),
        _choice("EStopSignalSource", "EStopSignalSource", 2, 0),
        _choice("EStopSignalLevel", "EStopLevel", 1, 1),
        _flag("InvertEStopSignalPolarity", 0),
        _whole("EStopSignalByteAddress", "", 0, _LAST_BYTE, 0),
        _whole("EStopSignalBitAddress", "", 0, _LAST_BIT, 0),
        _flag("EnableEStopStatusSignal", 0),
        _choice("EStopStatusSignalDestination", "EStopStatusSignalDestination", 1, 0),
        _flag("InvertEStopStatusSignalPolarity", 0),
        _whole("EStopStatusSignalByteAddress", "", 0, _LAST_BYTE, 0),
        _whole("EStopStatusSignalBitAddress", "", 0, _LAST_BIT, 0),
        _choice("EStopLevel1Type", "EStopLevel1Type", 1, 0),
    ),
}

AXIS_SECTIONS: Sections = {
    "FeedbackParam": (
        _real("InPosWidth", "uu", 0, _MAX, 1000),
        _real("InPosWidth2", "uu", 0, _MAX, 1000),
        _real("InPosWidth3", "uu", 0, _MAX, 1000),
        _real("InPosWidth4", "uu", 0, _MAX, 1000),
        _real("InPosWidth5", "uu", 0, _MAX, 1000),
        _choice("VelMonitorSource", "VelocityMonitorSource", 1, 0),
        _real("PosSetWidth", "uu", 0, _MAX, 1000),
        _real("DelayedPosSetWidth", "uu", 0, _MAX, 1000),
        _real("DelayedPosSetMilliseconds", "ms", 0, _MAX, 0),
    ),
    "HomeParam": (
        _choice("HomeType", "HomeType", 20, 0),
        _choice("HomeDir", "HomeDirection", 1, 0),
        _real("HomingVelSlow", "uu/s", _TINY, _MAX, 10000),
        _real("HomingVelSlowAcc", "uu/s²", _TINY, _MAX, 10000),
        _real("HomingVelSlowDec", "uu/s²", _TINY, _MAX, 10000),
        _real("HomingVelFast", "uu/s", _TINY, _MAX, 10000),
        _real("HomingVelFastAcc", "uu/s²", _TINY, _MAX, 10000),
        _real("HomingVelFastDec", "uu/s²", _TINY, _MAX, 10000),
        _real("HomingReverseDistance", "uu", 0, _MAX, 0),
        _real("HomeShiftVel", "uu/s", _TINY, _MAX, 10000),
        _real("HomeShiftAcc", "uu/s²", _TINY, _MAX, 10000),
        _real("HomeShiftDec", "uu/s²", _TINY, _MAX, 10000),
        _real("HomeShiftDistance", "uu", -_MAX, _MAX, 0),
        _flag("InvertHSPolarity", 0),
        _whole("MultipleZPulse", "", 0, 100, 0),
        _flag("RoundPosCmdAfterHoming", 0),
        _flag("PauseMode", 0),
        _real("MaxHSOnAtStartReverseDistance", "uu", 0, _MAX, 0),
        _real("MaxLSReverseDistance", "uu", 0, _MAX, 0),
        _whole("ZPulseDistanceCheck", "uu", 0, _MAX, 0),
        _real("HomePosition", "uu", -_MAX, _MAX, 0),
        _flag("GantryHomingUseSlaveHS", 0),
        _flag("GantryHomingUseSlaveLS", 0),
        _flag("GantryHomingUseSlaveZPulse", 0),
        _flag("GantryHomingUseSlaveTouchProbe", 0),
        _flag("GantryHomingUseSlaveMechanicalEnd", 0),
        _flag("GantryHomingRetainSyncOffset", 0),
        _flag("ImmediateStopAtLS", 0),
        _real("MechanicalEndDetectionPosDiff", "uu", 0, _MAX, 0),
        _real("MechanicalEndDetectionTimeMilliseconds", "ms", 0, _MAX, 0),
        _flag("MechanicalEndDetectionIgnoreLS", 0),
        _real("MechanicalEndDetectionFirstTorqueLimit", "%", 0, _MAX, 0),
        _real("MechanicalEndDetectionSecondTorqueLimit", "%", 0, _MAX, 0),
        _flag("OpenLoopHoming", 0),
        _flag("ClearHomeDoneOnServoOff", 0),
        _flag("ClearHomeDoneOnCommStop", 1),
        _flag("KeepMechEndTorqueLimit", 1),
    ),
    "LimitParam": (
        _choice("LSType", "LimitSwitchType", 6, 3),
        _choice("PositiveLSType", "LimitSwitchType", 6, 0),
        _choice("NegativeLSType", "LimitSwitchType", 6, 0),
        _flag("InvertPositiveLSPolarity", 0),
        _flag("InvertNegativeLSPolarity", 0),
        _real("LSDec", "uu/s²", _TINY, _MAX, 10000),
        _real("LSSlowDec", "uu/s²", _TINY, _MAX, 10000),
        _choice("SoftLimitType", "LimitSwitchType", 6, 0),
        _choice("PositiveSoftLimitType", "LimitSwitchType", 6, 0),
        _choice("NegativeSoftLimitType", "LimitSwitchType", 6, 0),
        _real("SoftLimitPositivePos", "uu", -_MAX, _MAX, 0),
        _real("SoftLimitNegativePos", "uu", -_MAX, _MAX, 0),
        _flag("AllLSDuringHoming", 0),
        _choice("NearLSType", "LimitSwitchType", 6, 0),
        _choice("NearPositiveLSType", "LimitSwitchType", 6, 0),
        _choice("NearNegativeLSType", "LimitSwitchType", 6, 0),
        _flag("InvertNearPositiveLSPolarity", 0),
        _whole("NearPositiveLSByte", "", 0, _LAST_BYTE, 0),
        _whole("NearPositiveLSBit", "", 0, _LAST_BIT, 0),
        _flag("InvertNearNegativeLSPolarity", 0),
        _whole("NearNegativeLSByte", "", 0, _LAST_BYTE, 0),
        _whole("NearNegativeLSBit", "", 0, _LAST_BIT, 0),
        _choice("ExternalLSType", "LimitSwitchType", 6, 0),
        _choice("ExternalPositiveLSType", "LimitSwitchType", 6, 0),
        _choice("ExternalNegativeLSType", "LimitSwitchType", 6, 0),
        _flag("InvertExternalPositiveLSPolarity", 0),
        _whole("ExternalPositiveLSByte", "", 0, _LAST_BYTE, 0),
        _whole("ExternalPositiveLSBit", "", 0, _LAST_BIT, 0),
        _flag("InvertExternalNegativeLSPolarity", 0),
        _whole("ExternalNegativeLSByte", "", 0, _LAST_BYTE, 0),
        _whole("ExternalNegativeLSBit", "", 0, _LAST_BIT, 0),
        _choice("LSDirection", "LimitSwitchDirection", 1, 0),
    ),
    "MotionParam": (
        _real("QuickStopDec", "uu/s²", _TINY, _MAX, 100000),
        _choice("ProhibitOvertravel", "ProhibitOvertravelType", 2, 1),
        _choice("LinearIntplOverrideType", "LinearIntplOverrideType", 2, 2),
        _whole("LinearIntplOverrideSmoothPercent", "%", 0, 100, 30),
        _choice("CircularIntplOverrideType", "CircularIntplOverrideType", 1, 1),
        _flag("InterruptedIntplUseQuickStop", 0),
        _flag("SingleTurnReduceToHalfTurn", 1),
        _flag("EnableGlobalStartingVelocity", 0),
        _real("GlobalStartingVelocity", "uu/s", 0, _MAX, 0),
        _flag("EnableGlobalEndVelocity", 0),
        _real("GlobalEndVelocity", "uu/s", 0, _MAX, 0),
        _flag("EnableGlobalMinVelocity", 0),
        _real("GlobalMinVelocity", "uu/s", 0, _MAX, 0),
        _flag("EnableGlobalMovingAverageProfileTimeMilliseconds", 0),
        _real("GlobalMovingAverageProfileTimeMilliseconds", "ms", 0, 120000, 0),
        _flag("APIWaitUntilMotionStart", 1),
        _choice("LinearIntplProfileCalcMode", "LinearIntplProfileCalcMode", 2, 0),
    ),
    "AlarmParam": (
        _choice("FollowingErrorType", "FollowingErrorAlarmType", 1, 0),
        _real("FollowingErrorStopped", "uu", 0, _MAX, 0),
        _real("FollowingErrorMoving", "uu", 0, _MAX, 0),
        _choice("VelFollowingErrorType", "VelocityFollowingErrorAlarmType", 2, 0),
        _real("VelFollowingErrorStopped", "uu/s", 0, _MAX, 0),
        _real("VelFollowingErrorStoppedMilliseconds", "ms", 0, _MAX, 0),
        _real("VelFollowingErrorMoving", "uu/s", 0, _MAX, 0),
        _real("VelFollowingErrorMovingMilliseconds", "ms", 0, _MAX, 0),
        _flag("ServoOffDuringAmpAlarm", 1),
        _whole("ServoOnFollowingError", "pulse", 0, _MAX, 10000),
    ),
    "SyncParam": (
        _real("InSyncWidth", "uu", 0, _INT_MAX, 0),
        _real("LimitCompensation", "", -_MAX, _MAX, 0),
        _real("SyncGain", "", 0, 3, 0),
        _choice("SyncCompensationMode", "SyncCompensationMode", 2, 1),
        _choice("MasterDesyncType", "MasterDesyncType", 3, 0),
        _real("MasterDesyncDec", "uu/s²", _TINY, _MAX, 10000),
        _choice("SlaveDesyncType", "SlaveDesyncType", 2, 0),
        _real("SlaveDesyncDec", "uu/s²", _TINY, _MAX, 10000),
        _flag("SyncLS", 0),
        _flag("MatchPos", 0),
    ),
    "ClosedLoopParam": (
        _real("pid/proportionalGain", "", -_MAX, _MAX, 0),
        _real("pid/integralGain", "", -_MAX, _MAX, 0),
        _real("pid/derivativeGain", "", -_MAX, _MAX, 0),
        _real("pid/derivativeFilterTimeConstant", "", -_MAX, _MAX, 0),
        _real("pid/limitIntegral", "", -_MAX, _MAX, 0),
        _real("pid/limitOutput", "", -_MAX, _MAX, 0),
        _real("pid/deadband", "", -_MAX, _MAX, 0),
        _real("pid/controlOutputOffset", "", -_MAX, _MAX, 0),
        _real("pid/rampRate", "", -_MAX, _MAX, 0),
        _whole("sensor/sensorType", "", 0, _INT_MAX, 0),
        _whole("sensor/analogData/byteAddress", "", 0, _LAST_BYTE, 0),
        _whole("sensor/analogData/type", "", 0, _INT_MAX, 0),
        _real("sensor/analogData/minimum", "", -_MAX, _MAX, 0),
        _real("sensor/analogData/maximum", "", -_MAX, _MAX, 0),
        _whole("sensor/axisData/axis", "", 0, 127, 0),
        _whole("sensor/axisData/type", "", 0, _INT_MAX, 0),
        _real("sensor/minimum", "", -_MAX, _MAX, 0),
        _real("sensor/maximum", "", -_MAX, _MAX, 0),
        _real("sensor/offset", "", -_MAX, _MAX, 0),
    ),
    "FlightRecorderParam": (_flag("CollectAxisFlightRecorderData", 1),),
    "EmergencyStopParam": (_real("EStopDec", "uu/s²", 0, _MAX, 100000),),
    "AxisParam": (
        _choice("AxisCommandMode", "AxisCommandMode", 2, 0),
        _real("AxisGearRatioNumerator", "", _TINY, _MAX, 1),
        _real("AxisGearRatioDenominator", "", _TINY, _MAX, 1),
        _flag("SingleTurnMode", 0),
        _whole("SingleTurnEncoderCount", "pulse", 256, _INT_MAX + 1, 65536),
        _real("MaxTrqLimit", "%", 0, _MAX, 300),
        _flag("EnableMaxTrqLimitRamp", 0),
        _real("MaxTrqLimitRampRate", "", -_MAX, _MAX, 300),
        _real("PosFErrorInstantMaxTrqLimitThreshold", "", -_MAX, _MAX, 0),
        _real("NegativeTrqLimit", "%", 0, _MAX, 300),
        _real("PositiveTrqLimit", "%", 0, _MAX, 300),
        _real("AxisUnit", "uu", 0, _MAX, 0),
        _real("VelocityFeedforwardGain", "", -_MAX, _MAX, 0),
        Parameter("AxisPolarity", Kind.SIGN, "", -1, 1, 1),
        _real("MaxMotorSpeed", "rpm", 0, _MAX, 3000),
        _flag("AbsoluteEncoderMode", 0),
        _real("AbsoluteEncoderHomeOffset", "pulse", 0, _MAX, 0),
        _flag("EncoderRangeMode", 0),
        _whole("EncoderRangeLow", "pulse", -_INT_MAX - 1, 0, 0),
        _whole("EncoderRangeHigh", "pulse", 0, _INT_MAX, 0),
    ),
}
