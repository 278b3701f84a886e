// STAND-IN for the vendor's header of this name, for tests. See tests/standin/README.md.
#pragma once

#include "WMX3Api.h"
#include "standin/ec_enums.h"

#define ECAPIFUNC STANDIN_RESULT

namespace wmx3Api {
namespace ecApi {

class EcSlavePdo {
public:
    bool enable;
    unsigned char size;
    unsigned short offset;
};

class EcSlavePdoInfo {
public:
    EcSlavePdo statusWord, modesOfOperationDisplay, positionActualValue, velocityActualValue;
    EcSlavePdo torqueActualValue, errorCode, touchProbeStatus, touchProbePositionPos1;
    EcSlavePdo touchProbePositionPos2, followingError, digitalInput, controlWord;
    EcSlavePdo modesOfOperation, targetPosition, targetVelocity, targetTorque, maxTorque;
    EcSlavePdo positiveTorqueLimit, negativeTorqueLimit, touchProbeFunction, velocityOffset;
    EcSlavePdo torqueOffset, maxMotorSpeed, digitalOutput;
};

class EcSlaveAxisInfo {
public:
    int axisIndex;
    short digitalInputAddr;
    unsigned short digitalInputSize;
    short digitalOutputAddr;
    unsigned short digitalOutputSize;
    EcSlavePdoInfo pdoInfo;
    EcOperationMode::T operationMode;
    unsigned char targetReached, followingError, homingError, homingAttained, halt;
};

class EcSlaveInfo {
public:
    int id;
    short position, address;
    unsigned int vendorId, productCode, revisionNo, serialNo, alias;
    unsigned int numOfAxes;
    EcSlaveAxisInfo axisInfo[constants::maxSlaveAxes];
    EcStateMachine::T state;
    unsigned short alStatusCode;
    unsigned char offline, inaccessible, newSlave, reverseSlave;
    unsigned char dcSupport, dcWidth;
    unsigned char portState[4];
    int neighbor[4];
    unsigned int propagaDelay;
    unsigned long long systemTime, systemTimeOffset, startTime;
    unsigned short inputAddr, inputSize, outputAddr, outputSize;
    unsigned int rxLogicAddr, rxPhyAddr, rxSize, txLogicAddr, txPhyAddr, txSize;
};

class EcMasterStatisticsInfo {
public:
    long commPeriod;
    long long cycleCounter;
#if STANDIN_STATISTICS_COUNTS
    long long interruptIntervalCount[9];
    long long cycleProcessTimeCount[6], processTimeCount[6], commandProcessTimeCount[6];
    long long feedbackProcessTimeCount[6], communicateProcessTimeCount[6];
    long long dcDiffCount[12];
#else
    double interruptIntervalRatio[9];
    double cycleProcessTimeRatio[6], processTimeRatio[6], commandProcessTimeRatio[6];
    double feedbackProcessTimeRatio[6], communicateProcessTimeRatio[6];
#endif
    unsigned int txDelay, minTxDelay, maxTxDelay;
    unsigned int packetLoss, packetTimeout;
    unsigned int packetLossMode[4], packetTimeoutMode[4];
#if STANDIN_STATISTICS_COUNTS
    unsigned int dlEventCount;
#endif
    unsigned long long minRefClockInterval, maxRefClockInterval, avgRefClockInterval;
    unsigned long long curRefClock, nextDcClock;
    int diffFromNextDcClock, minDiffFromNextDcClock, maxDiffFromNextDcClock;
    unsigned int totalAxesNum, totalRxPdoSize, totalTxPdoSize, totalInputSize, totalOutputSize;
    unsigned int overCycle, ringNum, numOfCyclicFrames;
    EcHotconnectState::T hcState;
    EcHotconnectAbortCode::T hcAbortCode;
    long hcErrorCode;
#if STANDIN_STATISTICS_COUNTS
    EcDiagnosisScanState::T diagnosisScanState;
#endif
};

class EcMasterInfo {
public:
    int id;
    EcStateMachine::T state;
    EcMasterMode::T mode;
    unsigned int numOfSlaves;
    EcSlaveInfo slaves[constants::maxSlaves];
    EcMasterStatisticsInfo statisticsInfo;
    EcMasterInfo();
    int GetOnlineSlaveCount();
    int GetOfflineSlaveCount();
    int GetInaccessibleSlaveCount();
};

class EcMasterInfoList {
public:
    unsigned int numOfMasters = 0;
    EcMasterInfo masters[constants::maxMasters];
};

class Ecat {
public:
    Ecat();
    explicit Ecat(WMX3Api *f);
    explicit Ecat(DeviceType::T type);
    Ecat(const Ecat &other) = default;
    Ecat &operator=(const Ecat &other) = default;

    ECAPIFUNC ScanNetwork();
    ECAPIFUNC ScanNetwork(int masterId);
    ECAPIFUNC GetMasterInfo(EcMasterInfo *pMaster);
    ECAPIFUNC GetMasterInfo(int masterId, EcMasterInfo *pMaster);
    ECAPIFUNC GetMasterInfoList(EcMasterInfoList *pMasters);
    ECAPIFUNC SetUpdatePeriod(unsigned int period);
    // Without a master it is master 0.
    ECAPIFUNC ChangeSlaveState(int slaveId, EcStateMachine::T state, int *errorCode);
    ECAPIFUNC ChangeSlaveState(int masterId, int slaveId, EcStateMachine::T state, int *errorCode);
    ECAPIFUNC StartHotconnect();
    ECAPIFUNC StartHotconnect(int masterId);
    ECAPIFUNC ResetRefClockInfo();
    ECAPIFUNC ResetRefClockInfo(int masterId);
    ECAPIFUNC ResetTransmitStatisticsInfo();
    ECAPIFUNC ResetTransmitStatisticsInfo(int masterId);
#if STANDIN_STATISTICS_COUNTS
    ECAPIFUNC DiagnosisScan(int masterId);
#endif
    ECAPIFUNC RegisterRead(int slaveId, int regAddr, int len, unsigned char *buff);
    ECAPIFUNC RegisterRead(int masterId, int slaveId, int regAddr, int len, unsigned char *buff);
    ECAPIFUNC RegisterWrite(int slaveId, int regAddr, int len, unsigned char *data);
    ECAPIFUNC RegisterWrite(int masterId, int slaveId, int regAddr, int len, unsigned char *data);
    ECAPIFUNC RegisterBroadcastRead(int masterId, int regAddr, int len, unsigned char *buff,
                                    unsigned short *wkc);
    ECAPIFUNC RegisterBroadcastWrite(int masterId, int regAddr, int len, unsigned char *data,
                                     unsigned short *wkc);
    ECAPIFUNC SdoUpload(int masterId, int slaveId, int index, int subindex, int sdoBuffSize,
                        unsigned char *sdoBuff, unsigned int *actualSize, unsigned int *errCode,
                        unsigned int waitTime = 0);
    ECAPIFUNC SdoUpload(int masterId, int slaveId, int index, int subindex, EcSdoType::T sdoType,
                        int sdoBuffSize, unsigned char *sdoBuff, unsigned int *actualSize,
                        unsigned int *errCode, unsigned int waitTime = 0, BOOL complete = FALSE);
    ECAPIFUNC SdoUpload(int slaveId, int index, int subindex, int sdoBuffSize,
                        unsigned char *sdoBuff, unsigned int *actualSize, unsigned int *errCode,
                        unsigned int waitTime = 0);
    ECAPIFUNC SdoDownload(int masterId, int slaveId, int index, int subindex, int sdoDataSize,
                          unsigned char *sdoData, unsigned int *errCode, unsigned int waitTime = 0);
    ECAPIFUNC SdoDownload(int masterId, int slaveId, int index, int subindex,
                          EcSdoType::T sdoType, int sdoDataSize, unsigned char *sdoData,
                          unsigned int *errCode, unsigned int waitTime = 0, BOOL complete = FALSE);
    ECAPIFUNC SdoDownload(int slaveId, int index, int subindex, int sdoDataSize,
                          unsigned char *sdoData, unsigned int *errCode, unsigned int waitTime = 0);
    ECAPIFUNC PdoRead(int masterId, int slaveId, int index, int subindex, int pdoBuffSize,
                      unsigned char *pdoBuff, unsigned int *actualSize);
    ECAPIFUNC TxPdoWrite(int masterId, int slaveId, int index, int subindex, int pdoDataSize,
                         unsigned char *pdoData, unsigned int mask = 0);

    // A slave's part of the I/O images.
    ECAPIFUNC GetInputBit(int masterId, int slaveId, int byte, int bit, unsigned char *pData);
    ECAPIFUNC GetInputByte(int masterId, int slaveId, int byte, unsigned char *pData);
    ECAPIFUNC GetInputBytes(int masterId, int slaveId, int byte, int size, unsigned char *pData);
    ECAPIFUNC GetOutputBit(int masterId, int slaveId, int byte, int bit, unsigned char *pData);
    ECAPIFUNC GetOutputByte(int masterId, int slaveId, int byte, unsigned char *pData);
    ECAPIFUNC GetOutputBytes(int masterId, int slaveId, int byte, int size, unsigned char *pData);
    ECAPIFUNC SetOutputBit(int masterId, int slaveId, int byte, int bit, unsigned char data);
    ECAPIFUNC SetOutputByte(int masterId, int slaveId, int byte, unsigned char data);
    ECAPIFUNC SetOutputBytes(int masterId, int slaveId, int byte, int size, unsigned char *pData);
    static ECAPIFUNC ErrorToString(int errCode, char *pString, unsigned int size);
    static ECAPIFUNC GetLibVersion(int *major, int *minor, int *revision, int *fix);
    bool IsDeviceValid();

    WMX3Api *wmx3Api;
};

}  // namespace ecApi
}  // namespace wmx3Api
