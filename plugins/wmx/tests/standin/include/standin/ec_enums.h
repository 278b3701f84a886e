// Numbers and names of the enumerations, as far as they are known. Part of the stand-in.
#pragma once

#include "standin/enums.h"
#include "standin/variant.h"

namespace wmx3Api {
namespace ecApi {

class EcErrorCode : public ErrorCode {
public:
    enum {
        EcError = 0x2000, ScanNetworkFailed, HotconnectFailed, SharedMemoryNull,
        SlaveStateChangeError, SlaveStateBelowPreop, SlaveInvalidAddressingMode,
        SlaveInEmergencyState, SlaveMailboxInUse, SlaveSdoDownloadError, SlaveSdoUploadError,
        SlaveSdoInfoGetODListError, SlaveSdoInfoGetODError, SlaveSdoInfoGetEDError,
        SlaveActualSizeLargerThanBufferSize, SlaveRegWriteError, SlaveRegReadError,
        SlaveSIIWriteError, SlaveSIIWriteFailedToSetChecksum, SlaveSIIReadError,
        SlavePdoReadWriteNotAllowed, SlavePdoReadWriteTimeout, SlavePdoNotMapped,
        SlaveTxPdoWriteNotAllowed, SlaveFoENotInBootState, SlaveFoEFileOpenError,
        SlaveFoEReadError, SlaveFoEWriteError, SlaveFoEFilePathTooLong,
        SlaveFoEFileNameTooLong, SlaveAoEReadError, SlaveAoEWriteError, SlaveSoEReadError,
        SlaveSoEWriteError, SlaveVoEReadError, SlaveVoEWriteError, AxisNotServoOn, NotInPPMode,
        NotInHMMode, NotInPVMode, NotInTQMode, PdoNotMapped, SlaveNotSupportVirtualSerial,
        OpenComFailed, CreateComProcessThreadFailed, NotInMonitorMode, VirtualSlaveNotEnabled,
        OtherOperationIsRunning, IoExtNotAttached, IoExtFuncNotSupported
    };
};

class EcStateMachine {
public:
#if STANDIN_EC_STATES_BY_BIT
    enum T { None = 0, Init = 1, Preop = 2, Boot = 4, Safeop = 8, Op = 16 };
#else
    enum T { None = 0, Init = 1, Preop = 2, Boot = 3, Safeop = 4, Op = 8 };
#endif
};

class EcMasterMode {
public:
    enum T {
        CyclicMode = 0, PPMode, MonitorMode
    };
};

class EcSdoType {
public:
    enum T {
        Expedited = 0, Normal
    };
};

class EcHotconnectState {
public:
    enum T {
        Idle = 0, Running, Abort, Unknown
    };
};

class EcHotconnectAbortCode {
public:
    enum T {
        None = 0, PortOpenError, Timeout, ScanNetworkFailed, ApplyNewTopologyError,
        InitNewSlavesError, RecalculateDcError, ClearDLEventError, Unknown
    };
};

class EcDiagnosisScanState {
public:
    enum T {
        None = 0, Scanning, Done, MemoryAllocError, PortStateError, PortOpenError, Unknown
    };
};

class EcOperationMode {
public:
    enum T {
        NONE = 0, PP, VL, PV, TQ, HM = 6, IP, CSP, CSV, CST, CSTCA, Unknown
    };
};

class EcObjectDescriptionListType {
public:
    enum T {
        Len = 0, AllObjects, RxPdo, TxPdo, DevReplacement, Startup
    };
};

}  // namespace ecApi

namespace simuApi {

class SimuErrorCode : public ErrorCode {
public:
    enum {
        SimuError = 0x1000
    };
};

class SimuAxisState {
public:
    enum T {
        Offline = 0, Normal
    };
};

}  // namespace simuApi
}  // namespace wmx3Api
