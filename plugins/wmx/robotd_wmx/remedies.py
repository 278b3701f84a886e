"""Remedies for errors of WMX, by name in the SDK, and for AL status codes."""

from __future__ import annotations

_BUSY = "Another program starts or holds the engine: wait, or end it; 'robotd wmx doctor' looks"
_ENGINE = (
    "Read the engine's log, end its processes, and start robotd again; then: robotd wmx doctor"
)
_LINK = "Check network cable, network card and the power of the slaves; then: robotd wmx scan"
_CLIENTS = "End programs that use the engine, or raise their number of devices"
_LIMITS = "Move the axis away from the limit by a jog in the other direction"
_ALARM = "Read the alarm in 'robotd status', remove its cause, then: robotd recover"
_SERVO = "Switch the servo on: robotd servo on"
_DRIVE = "Check power and cable of the drive, then: robotd recover"
_MOVING = "Wait until the axis is at rest, or stop it"
_VALUE = "Compare the value with the limits of the axis in the parameter file: robotd check"
_SIGNAL = "Map the signal into the PDOs of the drive, or choose a homing type that needs none"

REMEDIES = {
    **dict.fromkeys(
        (
            "StartProcessLockError", "StartProcessMaxInstance", "ControlChannelLockFailed",
            "ControlChannelLockWaitTimeOut", "CreateDeviceLockError", "CloseDeviceLockError",
            "CommandIdLockError",
        ),
        _BUSY,
    ),
    **dict.fromkeys(
        (
            "StartProcessFailed", "StartProcessWaitTimeout", "IMLibIsNotRunning",
            "APIChannelError", "APIChannelTimeOut", "StatusChannelError", "RtssStartError",
            "RequestChannelTimeOut", "SystemError", "SystemIsNoRunning", "WaitEngineError",
            "SystemInitializationNotDone", "EngineNotStartedInSpecifiedTime",
            "EngineNotStoppedInSpecifiedTime",
        ),
        _ENGINE,
    ),
    **dict.fromkeys(("MemoryAllocFailed", "ChannelBufferMemoryFailedToAllocate"),
                    "Free memory of the computer, or use shorter trajectories and buffers"),
    "RtssFileNotFoundError": "Set backends.wmx.sdk_path: robotd wmx doctor",
    "ReachMaxChannelNumber": _CLIENTS,
    **dict.fromkeys(
        ("IMVersionMismatch", "ModuleVersionMismatch", "VersionCheckError"),
        "Build robotd-wmx against the SDK that is installed: robotd wmx doctor",
    ),
    "ModuleIsNotLoaded": "Enable the module of this call in the engine's Module.ini",
    **dict.fromkeys(
        (
            "StartCommunicationError", "CommNotStartedInSpecifiedTime", "ScanNetworkFailed",
            "CallbackFuncTimeOut", "HotconnectFailed", "SlaveStateBelowPreop",
        ),
        _LINK,
    ),
    "CommNotStarted": "Start the communication: robotd recover",
    "CommNotStopped": "Stop the communication first: service wmx/engine/set_comm",
    "DeviceIsNotInUse": "The program stalled longer than backends.wmx.watchdog_s: robotd recover",
    **dict.fromkeys(
        (
            "BusyReceivingAnotherAPICommand", "NotIdleState", "StartingPreviousCommand",
            "NotIdleOrPosState", "NotIdleOrJogState", "NotIdleOrVelocityState",
            "NotIdleOrIntplState", "NotIdleOrPosOrJogState", "ChannelExecutingCommands",
            "WaitTimeout",
        ),
        _MOVING,
    ),
    **dict.fromkeys(("AxisOutOfRange", "AxisCountOutOfRange", "DuplicateAxis"),
                    "Compare joints[].axis with the axes of the network: robotd wmx scan"),
    **dict.fromkeys(("IOAddressOutOfRange", "IOSizeOutOfRange"),
                    "Bytes are 0 to 7999 and bits 0 to 7: compare the names of inputs and outputs"),
    "IDOutOfRange": "Compare master and slave number with the network: robotd wmx scan",
    **dict.fromkeys(("FileOperationFailed", "ParameterFileParseError", "ParameterSettingsInvalid"),
                    "Check path and content of parameters_file: robotd check"),
    "ServoOffline": _DRIVE,
    **dict.fromkeys(("ServoOff", "NotServoOn", "AxisNotServoOn"), _SERVO),
    **dict.fromkeys(("AxisAmpAlarm", "ServoOnError"), _ALARM),
    **dict.fromkeys(
        ("AxisSoftLimit", "AxisNearLimit", "AxisExternalLimit", "AxisHardLimit"), _LIMITS
    ),
    "RequestedBufferTooLarge": "Lower trajectory.max_points",
    "ChannelNotEnoughSpace": "Lower trajectory.max_points",
    **dict.fromkeys(("NotPosMode", "NotVelocityMode", "NotTrqMode"),
                    "Set the command mode: service wmx/axis/set_mode"),
    **dict.fromkeys(
        (
            "PositionArgumentOutOfRange", "VelocityArgumentOutOfRange", "AccArgumentOutOfRange",
            "DecArgumentOutOfRange", "ArgumentOutOfRange", "ParamOutOfRange",
        ),
        _VALUE,
    ),
    "EmergencyStopSignalOn": "Release the emergency stop, then: robotd recover",
    "CurrentAxisCommandModeNotSupported": "Compare the modes of the drive: robotd wmx scan",
    **dict.fromkeys(
        (
            "ZPulseDetectionUnsupported", "TouchProbeDetectionUnsupported",
            "HomeSwitchDetectionUnsupported", "LimitSwitchDetectionUnsupported",
        ),
        _SIGNAL,
    ),
    "SharedMemoryNull": "Load the EtherCAT platform of the engine and start communication",
    "SlaveStateChangeError": "Read the AL status of the slave: robotd wmx scan, robotd explain",
    **dict.fromkeys(("SlaveSdoDownloadError", "SlaveSdoUploadError", "SlaveMailboxInUse"),
                    "Read the abort code of the slave: robotd explain CODE"),
    "SlavePdoReadWriteNotAllowed": "Allow PDO access (AllowPdoReadWrite) in the ENI file",
    **dict.fromkeys(("SlavePdoNotMapped", "PdoNotMapped"),
                    "Map the object into a PDO of the slave, in the ENI file"),
    **dict.fromkeys(("BufferSizeIsNotEnough", "OpenBufferError", "CreateBufferFailed"),
                    "Raise backends.wmx.stream_buffer_s, or end other programs that stream"),
    "BufferAlreadyOpened": "End the other program that streams to the axis",
}  # fmt: skip

_AL_CONFIGURATION = (
    "Compare the slave with the ENI file: another firmware or module needs a new one"
)
_AL_WATCHDOG = "Check cables and connectors between the slaves, and the load of the computer"
_AL_CLOCKS = "Check the distributed clocks in the ENI file and the jitter of the computer"
_AL_SLAVE = "Switch the slave off and on; if the fault stays, replace it"

AL_REMEDIES = {
    **dict.fromkeys((0x0001, 0x0002, 0x0014, 0x0020, 0x0050, 0x0051), _AL_SLAVE),
    **dict.fromkeys((0x0016, 0x0017, 0x001C, 0x001D, 0x001E, 0x001F), _AL_CONFIGURATION),
    **dict.fromkeys((0x0018, 0x0019, 0x001B), _AL_WATCHDOG),
    **dict.fromkeys((0x001A, 0x002C, 0x002D, 0x0030, 0x0031, 0x0032, 0x0033, 0x0034), _AL_CLOCKS),
    **dict.fromkeys((0x0011, 0x0012, 0x0021, 0x0022, 0x0023), "Start communication again"),
}
