// Numbers and names of the error codes, as far as they are known. Part of the stand-in.
#pragma once

namespace wmx3Api {

class ErrorCode {
public:
    enum {
        None = 0, StartProcessFailed = 256, StartProcessNull, StartProcessMaxInstance,
        StartProcessLockError, StartProcessWaitEventFailed, StartProcessWaitTimeout,
        MemoryAllocFailed, IMLibIsNotRunning, ControlChannelLockFailed,
        ControlChannelEventFailed, ControlChannelWaitEventFailed,
        ControlChannelSharedMemoryFailed, ControlChannelLockWaitTimeOut, APIChannelError,
        APIChannelTimeOut, StatusChannelError, RtssFileNotFoundError, RtssStartError,
        RequestChannelTimeOut, FreeChannelTimeOut, CloseDeviceTimeOut, RequestChannelFailed,
        ReachMaxChannelNumber, FreeChannelFailed, InvalidChannelId, CloseDeviceFailed,
        StatusChannelNull, StatusChannelIdError, StatusSharedMemoryChannelIndexError,
        StatusChannelGettingInitialData, RequestQueueFailed, InvalidQueueId, InvalidQueueSize,
        RequestQueueTimeout, InvalidQueue, FreeQueueTimeout, InvalidQueueControlCommand,
        ControlQueueTimeout, SetQueueOptionsTimeout, FreeQueueFailed,
        RequestQueueIDAlreadyUsed, CreateDeviceLockError, CloseDeviceLockError,
        SetDeviceNameTimeout, GetActiveDeviceTimeout, DeviceIsNull, InvalidModuleId,
        InvalidDeterMode, NoSupportedFunction, CommandInvalidQueueId, CommandQueueAddFailed,
        CommandQueueIsFull, CommandQueueAddTimeOut, IMVersionMismatch, ModuleVersionMismatch,
        CommandIdLockError, CommandIdGetError, CallbackMallocFailed, CallbackThreadNull,
        CallbackThreadError, CallbackThreadTimeOut, IMLibNullParam, IMLibInvalidParam,
        ConflictingErrorCode, UtilDataChnlSizeTooSmall, UtilBuffAndDataSizeDiff,
        UtilNoEnoughDataChnlSize, UtilReachMaxDataChnlSize, UtilIndexOutOfRange,
        UtilInitFailed, UtilLockFailed, UtilQueueFull, UtilQueueEmpty, UtilBufferSizeNotEnough,
        WaitForDeviceEventTimeOut, WaitForDeviceEventTimeout = WaitForDeviceEventTimeOut,
        DeviceEventProcessFailed, ImCommandNotMatched,
        ApiLogCreateQueueFailed, ApiLogIsNotSet, ApiLogIsRunning, ApiLogIsNotRunning,
        ApiLogQueueError, ApiLogOpenFileFailed, ApiLogWriteFileFailed, ApiLogReadFileFailed,
        ApiLogFolderNotExist, ApiLogGetStatusError, SystemError = 1280, SystemIsNoRunning,
        SystemInitializationNotDone, EngineNotStartedInSpecifiedTime,
        EngineNotStoppedInSpecifiedTime, CommNotStartedInSpecifiedTime,
        CommNotStoppedInSpecifiedTime, ModuleIsNotLoaded, StartCommunicationError,
        DeviceIsNotInUse, SetDeviceEventFailed, ResetDeviceEventFailed,
        WaitForDeviceEventFailed, Reserved = 1536, CommNotStarted, CommNotStopped,
        VersionCheckError, CallbackFuncError, CallbackFuncTimeOut, CallbackFuncInvalidState,
        CallbackFuncInvalidMode, MissingRequiredRtdll, BusyReceivingAnotherAPICommand,
        NotIdleState, AxisOutOfRange, AxisCountOutOfRange, DuplicateAxis, IOAddressOutOfRange,
        IOSizeOutOfRange, ChannelOutOfRange, ChannelUninitialized, ChannelInUse,
        ArgumentOutOfRange, ArgumentIsNull, PrevSettingsBeingApplied, ParamOutOfRange,
        IDOutOfRange, IDNotDefined, ResourceInUse, FileOperationFailed,
        StartingPreviousCommand, StringConversionError, NoMotion, ServoOffline, ServoOff,
        AxisAmpAlarm, AxisSoftLimit, AxisNearLimit, AxisExternalLimit, AxisHardLimit,
        UserMemoryAddressOutOfRange, UserMemorySizeOutOfRange, InvalidCommandProcessingMode,
        InterruptMismatch, ErrorCodeNotDefined, BufferTooSmall, RequestedBufferTooLarge,
        RequestedBufferTooSmall, ModuleIDOutOfRange, UpdatesListUninitialized,
        UpdatesListDoesNotMatchInstalledUpdates, UpdatesListTimeout, UnknownError
    };
};

class CoreMotionErrorCode : public ErrorCode {
public:
    enum {
        ParameterSettingsInvalid = 0x10000, ServoOnError, SyncAxisSingleTurnMismatch,
        PositionNotPassed, NotPausedDuringHoming, OpenWaitEventError, ParameterFileParseError,
        SyncGroupIDOutOfRange, SyncGroupMasterAxisUndefined, ReferenceAxisOfActiveCompensation,
        CurrentEmergencyStopLevelIsHigher, AcyclicStatusError, AxisExecutingPhaseShift,
        AxisSettingSyncGearRatio, NotSynchronizedToSpecifiedMasterAxis,
        OpenWaitSharedMemoryError, WaitEngineError, IsSyncSlave, IsSyncMaster,
        IsCombineSyncMaster, NotServoOn, NotIdleOrPosState, NotPosState, NotIdleOrJogState,
        NotIdleOrVelocityState, NotIdleOrIntplState, NotIdleOrPosOrJogState,
        NotPosOrJogOrVelocityState, NotJogState, NotTorqueState, NotIdleOrTorqueState,
        NotIdleOrSyncState, NotECAMState, NotDancerControlState, NotIdleOrDancerControlState,
        NotPosMode, NotVelocityMode, NotTrqMode, NotPosOrVelocityMode, NotSyncSlave,
        NotHomeState, AxisNotPaused, AxisArgumentOutOfRange, ProfileArgumentOutOfRange,
        PositionArgumentOutOfRange, VelocityArgumentOutOfRange, AccArgumentOutOfRange,
        DecArgumentOutOfRange, JerkAccArgumentOutOfRange, JerkDecArgumentOutOfRange,
        JerkAccRatioArgumentOutOfRange, JerkDecRatioArgumentOutOfRange,
        StartingVelocityArgumentOutOfRange, EndVelocityArgumentOutOfRange,
        SecondVelocityArgumentOutOfRange, RunTimeArgumentOutOfRange, TimeArgumentOutOfRange,
        TriggerTypeArgumentOutOfRange, TriggerAxisArgumentOutOfRange,
        TriggerValueArgumentOutOfRange, TriggerTypeNotSupported, AccDecCouldNotBeCalculated,
        NoFreeVirtualAxis, NoFreeVirtualAxisAddlData, AxisNotSingleTurn, AxisIsSingleTurn,
        ProfileErrorOnTargetPos, ProfileUsageError, ProfileAccelerationIsInvalid,
        ProfileDecelerationIsInvalid, ProfileJerkIsInvalid, ProfileVelocityIsInvalid,
        ProfileNullCalculation, ProfileNoMotion, ProfileUserRangeIsInvalid, OtherProfileError,
        ProfileUnknownError, ProfileSetupFailed, ProfileCancelOvertravel, PointCountOutOfRange,
        WaitTimeout, ProfileTypeNotSupported, AxisMismatch, NoRotationalMotion, DeviceIDError,
        InvalidAxis, ChannelExecutingCommands, ChannelIsNotExecutingCommands,
        ChannelNotEnoughSpace, ChannelIsStopping, ChannelIsNotStopped,
        ChannelBufferMemoryNotAllocated, ChannelBufferMemoryAlreadyAllocated,
        ChannelBufferMemoryFailedToAllocate, ProcessingOverride,
        CircularInterpolationArgumentOutOfRange, EmergencyStopSignalOn,
        SyncGroupDoesNotContainAxis, SyncGroupParameterOutOfRange,
        CurrentAxisCommandModeNotSupported, MasterAxisOutOfRange, SlaveAxisOutOfRange,
        SlaveAxisCountOutOfRange, EnabledArgumentOutOfRange,
        MovingAverageTimeArgumentOutOfRange, NumEventsOutOfRange, RegisterNumberOutOfRange,
        SyncGearRatioOutOfRange, PosChangePerCycleOutOfRange, MaxTorqueLimitOutOfRange,
        TorqueArgumentOutOfRange, MaxMotorSpeedOutOfRange, RampCycleTimeOutOfRange,
        RampRateOutOfRange, CircularInterpolationTypeOutOfRange,
        CircularInterpolationCenterPosTooCloseToInitialPos,
        CircularInterpolationEndPosTooCloseToInitialPos,
        CircularInterpolationThroughPosTooCloseToInitialPos,
        CircularInterpolationThroughPosTooCloseToEndPos,
        CircularInterpolationPathGenerationError, HelicalInterpolationTypeOutOfRange,
        HelicalInterpolationCenterPosTooCloseToInitialPos,
        HelicalInterpolationPathGenerationError, AxisCommandModeOutOfRange,
        ZPulseDetectionUnsupported, TouchProbeDetectionUnsupported,
        HomeSwitchDetectionUnsupported, LimitSwitchDetectionUnsupported,
        ChannelCountOutOfRange, NumCommandsOutOfRange  // invented numbers
    };
};

class AdvancedMotionErrorCode : public CoreMotionErrorCode {
public:
    enum {
        PositionNotOnPath = 0x17000, SplineModeNotSupported,
        SplineStartingPositionNotCurrentPosition, PathInterpolationChannelNotCleared,
        PathInterpolationConfigurationNotSet, PathInterpolationAxesHaveBeenMoved,
        PathInterpolationAbnormalStop, NotConstLinearVelocitySlave,
        ConstLinearVelocityMinRTooSmall, ConstLinearVelocityPositiveMaxRTooSmall,
        ConstLinearVelocityNegativeMaxRTooSmall, InvalidCurrentVelocity,
        MasterPositionNotAscendingOrder, PositionNotWithinSingleTurnEncoderCount,
        TimeBetweenPointsTooClose, TotalTimeTooSmall, DimensionOutOfRange,
        PointCountBelowMinimum, L1ArgumentOutOfRange, L2ArgumentOutOfRange,
        LdirArgumentOutOfRange, RzeroArgumentOutOfRange, RspanArgumentOutOfRange,
        L1ArgumentGreaterThanL2, SlaveCurrentPositionNotInRange, OutputCountOutOfRange,
        OutputPointNotFound, ConfigurationNotSet, SegmentTypeNotSupported,
        AngleCorrectionProfileArgumentOutOfRange, AxisNotExecutingPathIntpl,
        AxisNotExecutingPathIntpl3D, VelocityMultiplierOutOfRange, NoCommandsInBuffer,
        DancerControlDerivativeSamplesOutOfRange, DancerControlIntegralTimeOutOfRange,
        DancerControlInputMinMaxDifferenceOutOfRange, FirstPointTimeNotZero,
        PointTimeOutOfRange, PointTimeNotIncreasing, SmoothRatioOutOfRange,
        TwoLinkMotionTypeOutOfRange, OutputIOAddressOutOfRange, OutputPointOutOfRange,
        TotalDistanceBelowMinimum, DistanceBetweenPointsTooClose,
        AuxiliaryAxisOutOfRange, AuxiliaryAxisCountOutOfRange  // invented numbers
    };
};

class IOErrorCode : public ErrorCode {
public:
    enum {
        SharedMemoryNull = 0x14000, IOCountOutOfRange, ParameterSettingInvalid
    };
};

class CyclicBufferErrorCode : public ErrorCode {
public:
    enum {
        CreateBufferFailed = 0x13000, BufferIsNull, OpenBufferError, BufferIsNotOpened,
        BufferSizeIsNotEnough, LockBufferFailed, BufferAlreadyOpened
    };
};

}  // namespace wmx3Api
