// libecapi: one EtherCAT master with drives first and I/O modules after them.
#include <cstring>

#include "client.hpp"
#include "slaves.hpp"

using namespace standin;

namespace {
constexpr int DRIVE_PDO = 16;

void describe(const Block &block, int index, ecApi::EcSlaveInfo &info) {
    using ecApi::EcStateMachine;
    const Slave &slave = block.slaves[index];
    const bool drive = slave.axis >= 0;
    info.id = index;
    info.position = static_cast<short>(index);
    info.address = static_cast<short>(0x1001 + index);
    const Identity identity = identity_of(slave, index);
    info.vendorId = identity.vendor;
    info.productCode = identity.product;
    info.revisionNo = identity.revision;
    info.serialNo = identity.serial;
    info.numOfAxes = drive;
    info.axisInfo[0].axisIndex = slave.axis;
    info.offline = slave.lost;
    info.inaccessible = slave.lost;
    info.state = slave.lost ? EcStateMachine::None
                 : communicating(block) ? EcStateMachine::Op : EcStateMachine::Preop;
    info.alStatusCode = slave.lost ? 0x001B : 0;  // sync manager watchdog
    const int module = index - block.faults.drives;
    if (!drive) {
        info.inputAddr = info.outputAddr = static_cast<unsigned short>(module * IO_BYTES);
        info.inputSize = info.outputSize = IO_BYTES;
    }
    info.rxSize = info.txSize = drive ? DRIVE_PDO : IO_BYTES;
}

void describe(const Block &block, ecApi::EcMasterStatisticsInfo &info) {
    info.commPeriod = 1000;
    info.cycleCounter = block.cycle;
    info.packetLoss = block.packet_loss;
    info.overCycle = block.over_cycle;
    info.numOfCyclicFrames = 1;
    info.minRefClockInterval = info.maxRefClockInterval = info.avgRefClockInterval = 1'000'000;
    info.hcState = block.hot_connect;
    if (info.hcState == ecApi::EcHotconnectState::Abort)
        info.hcAbortCode = static_cast<ecApi::EcHotconnectAbortCode::T>(block.faults.hot_connect_abort);
    info.txDelay = info.minTxDelay = 9000;
    info.maxTxDelay = block.max_delay;
    info.ringNum = 1;
    info.totalAxesNum = block.faults.drives;
    info.totalInputSize = info.totalOutputSize = block.faults.io_modules * IO_BYTES;
    info.totalRxPdoSize = info.totalTxPdoSize =
        block.faults.drives * DRIVE_PDO + block.faults.io_modules * IO_BYTES;
}
}  // namespace

namespace wmx3Api {
namespace ecApi {

Ecat::Ecat() : wmx3Api(nullptr) {}
Ecat::Ecat(WMX3Api *f) : wmx3Api(f) {}
Ecat::Ecat(DeviceType::T) : wmx3Api(nullptr) {}
bool Ecat::IsDeviceValid() { return wmx3Api && wmx3Api->IsDeviceValid(); }
ECAPIFUNC Ecat::ErrorToString(int errCode, char *pString, unsigned int size) {
    return error_text(errCode, "ErrorCode EcErrorCode", pString, size);
}
ECAPIFUNC Ecat::GetLibVersion(int *major, int *minor, int *revision, int *fix) {
    return version(major, minor, revision, fix);
}

ECAPIFUNC Ecat::ScanNetwork() { return ScanNetwork(0); }
ECAPIFUNC Ecat::ScanNetwork(int masterId) {
    return with_engine(wmx3Api, [&](Block &block) -> int {
        if (masterId != 0) return ErrorCode::IDOutOfRange;
        const int count = block.faults.drives + block.faults.io_modules;
        for (int index = block.slave_count; index < count; index++)
            block.slaves[index].axis = index < block.faults.drives ? index : -1;
        block.slave_count = count;
        return ErrorCode::None;
    });
}

ECAPIFUNC Ecat::GetMasterInfo(EcMasterInfo *pMaster) { return GetMasterInfo(0, pMaster); }
ECAPIFUNC Ecat::GetMasterInfo(int masterId, EcMasterInfo *pMaster) {
    if (!pMaster) return ErrorCode::ArgumentIsNull;
    return with_engine(wmx3Api, [&](Block &block) -> int {
        if (masterId != 0) return ErrorCode::IDOutOfRange;
        std::memset(static_cast<void *>(pMaster), 0, sizeof *pMaster);
        pMaster->state = communicating(block) ? EcStateMachine::Op : EcStateMachine::Preop;
        pMaster->mode = EcMasterMode::CyclicMode;
        pMaster->numOfSlaves = block.slave_count;
        for (int index = 0; index < block.slave_count; index++)
            describe(block, index, pMaster->slaves[index]);
        describe(block, pMaster->statisticsInfo);
        return ErrorCode::None;
    });
}
ECAPIFUNC Ecat::GetMasterInfoList(EcMasterInfoList *pMasters) {
    pMasters->numOfMasters = 1;
    return GetMasterInfo(0, &pMasters->masters[0]);
}

ECAPIFUNC Ecat::SetUpdatePeriod(unsigned int period) {
    return period ? ErrorCode::None : ErrorCode::ArgumentOutOfRange;
}
ECAPIFUNC Ecat::ChangeSlaveState(int slaveId, EcStateMachine::T state, int *errorCode) {
    return ChangeSlaveState(0, slaveId, state, errorCode);
}
ECAPIFUNC Ecat::ChangeSlaveState(int masterId, int slaveId, EcStateMachine::T, int *errorCode) {
    if (errorCode) *errorCode = 0;
    return with_slave(wmx3Api, masterId, slaveId, [](Block &, Slave &) { return 0; });
}
ECAPIFUNC Ecat::StartHotconnect() { return StartHotconnect(0); }
ECAPIFUNC Ecat::StartHotconnect(int masterId) {
    return with_engine(wmx3Api, [&](Block &block) -> int {
        if (masterId != 0) return ErrorCode::IDOutOfRange;
        if (!communicating(block)) return ErrorCode::CommNotStarted;
        if (block.hot_connect == EcHotconnectState::Running)
            return EcErrorCode::OtherOperationIsRunning;
        block.hot_connect = EcHotconnectState::Running;
        block.hot_connect_ns = now_ns() + block.faults.hot_connect_ms * 1'000'000ll;
        return ErrorCode::None;
    });
}
ECAPIFUNC Ecat::ResetRefClockInfo() { return ResetRefClockInfo(0); }
ECAPIFUNC Ecat::ResetRefClockInfo(int masterId) {
    return with_engine(wmx3Api, [&](Block &) -> int {
        return masterId == 0 ? ErrorCode::None : ErrorCode::IDOutOfRange;
    });
}
ECAPIFUNC Ecat::ResetTransmitStatisticsInfo() { return ResetTransmitStatisticsInfo(0); }
ECAPIFUNC Ecat::ResetTransmitStatisticsInfo(int masterId) {
    return with_engine(wmx3Api, [&](Block &block) -> int {
        if (masterId != 0) return ErrorCode::IDOutOfRange;
        block.packet_loss = block.max_delay = 0;
        return ErrorCode::None;
    });
}

#if STANDIN_STATISTICS_COUNTS
ECAPIFUNC Ecat::DiagnosisScan(int masterId) { return ScanNetwork(masterId); }
#endif

}  // namespace ecApi
}  // namespace wmx3Api
