// EtherCAT diagnostics. States are mapped by name to the numbers of the ROS service, which differ
// from those on the wire and in the SDK (there Boot is 3, Safeop 4, Op 8).
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <cstring>
#include <vector>

#include "native.hpp"

namespace robotd {

namespace {
using namespace wmx3Api::ecApi;

constexpr size_t MAX_OBJECT_BYTES = 4096;

// None 0, Init 1, Preop 2, Boot 4, Safeop 8, Op 16.
int service_state(EcStateMachine::T state) {
    switch (state) {
        case EcStateMachine::Init: return 1;
        case EcStateMachine::Preop: return 2;
        case EcStateMachine::Boot: return 4;
        case EcStateMachine::Safeop: return 8;
        case EcStateMachine::Op: return 16;
        default: return 0;
    }
}

const char *hot_connect(EcHotconnectState::T state) {
    switch (state) {
        case EcHotconnectState::Idle: return "idle";
        case EcHotconnectState::Running: return "running";
        case EcHotconnectState::Abort: return "aborted";
        default: return "unknown";
    }
}

const char *hot_connect_failure(EcHotconnectAbortCode::T code) {
    switch (code) {
        case EcHotconnectAbortCode::None: return "";
        case EcHotconnectAbortCode::PortOpenError: return "a port could not be opened";
        case EcHotconnectAbortCode::Timeout: return "timeout";
        case EcHotconnectAbortCode::ScanNetworkFailed: return "the scan of the network failed";
        case EcHotconnectAbortCode::ApplyNewTopologyError: return "the new topology was rejected";
        case EcHotconnectAbortCode::InitNewSlavesError: return "a new slave did not start";
        case EcHotconnectAbortCode::RecalculateDcError: return "distributed clocks did not settle";
        case EcHotconnectAbortCode::ClearDLEventError: return "a DL event could not be cleared";
        default: return "unknown";
    }
}

int wire_mode(EcMasterMode::T mode) {
    switch (mode) {
        case EcMasterMode::PPMode: return 1;
        case EcMasterMode::MonitorMode: return 2;
        default: return 0;
    }
}

// A copy of a master's state; half a megabyte, therefore on the heap.
class Master {
public:
    Master(Device &device, int id) : info(std::make_unique<EcMasterInfo>()) {
        check("GetMasterInfo", Api::Ecat, device.ecat.GetMasterInfo(id, info.get()));
    }
    std::vector<EcSlaveInfo *> slaves() const {
        std::vector<EcSlaveInfo *> list;
        for (unsigned int index = 0; index < info->numOfSlaves; index++)
            list.push_back(&info->slaves[index]);
        return list;
    }
    std::unique_ptr<EcMasterInfo> info;
};

#define SLAVE(name, expression)                                                      \
    .def_prop_ro(name, [](const EcSlaveInfo &self) -> long long {                    \
        return static_cast<long long>(self.expression);                              \
    })
#define STATISTIC(name, member)                                                      \
    .def_prop_ro(name, [](const Master &self) -> long long {                         \
        return static_cast<long long>(self.info->statisticsInfo.member);             \
    })

void bind_slave(nb::module_ &module) {
    nb::class_<EcSlaveInfo>(module, "Slave")
        .def_prop_ro("state", [](const EcSlaveInfo &self) { return service_state(self.state); })
        // clang-format off
        SLAVE("id", id)
        SLAVE("al_code", alStatusCode)
        SLAVE("position", position)
        SLAVE("address", address)
        SLAVE("offline", offline)
        SLAVE("inaccessible", inaccessible)
        SLAVE("new", newSlave)
        SLAVE("reverse", reverseSlave)
        SLAVE("vendor_id", vendorId)
        SLAVE("product_code", productCode)
        SLAVE("revision", revisionNo)
        SLAVE("serial", serialNo)
        SLAVE("alias", alias)
        SLAVE("input_address", inputAddr)
        SLAVE("input_size", inputSize)
        SLAVE("output_address", outputAddr)
        SLAVE("output_size", outputSize)
        SLAVE("axes", numOfAxes);
    // clang-format on
}

nb::bytes register_read(Device &device, int master, int slave, int address, int length) {
    std::vector<unsigned char> data(length > 0 ? length : 0);
    {
        nb::gil_scoped_release unlocked;
        check("RegisterRead", Api::Ecat,
              device.ecat.RegisterRead(master, slave, address, length, data.data()));
    }
    return nb::bytes(reinterpret_cast<char *>(data.data()), data.size());
}
// The value, and the abort code of the slave: 0 without one.
nb::tuple sdo_upload(Device &device, int master, int slave, int index, int subindex) {
    std::vector<unsigned char> data(MAX_OBJECT_BYTES);
    unsigned int size = 0, abort = 0;
    int error = 0;
    {
        nb::gil_scoped_release unlocked;
        error = device.ecat.SdoUpload(master, slave, index, subindex, EcSdoType::Normal,
                                      static_cast<int>(data.size()), data.data(), &size, &abort);
    }
    if (abort == 0) check("SdoUpload", Api::Ecat, error);
    const size_t length = error ? 0 : std::min<size_t>(size, data.size());
    return nb::make_tuple(nb::bytes(reinterpret_cast<char *>(data.data()), length), abort);
}

// The abort code of the slave; 0 without one.
unsigned int sdo_download(Device &device, int master, int slave, int index, int subindex,
                          nb::bytes data) {
    std::vector<unsigned char> copy(data.size());
    std::memcpy(copy.data(), data.c_str(), data.size());
    const bool expedited = copy.size() == 1 || copy.size() == 2 || copy.size() == 4;
    unsigned int abort = 0;
    int error = 0;
    {
        nb::gil_scoped_release unlocked;
        error = device.ecat.SdoDownload(master, slave, index, subindex,
                                        expedited ? EcSdoType::Expedited : EcSdoType::Normal,
                                        static_cast<int>(copy.size()), copy.data(), &abort);
    }
    if (abort == 0) check("SdoDownload", Api::Ecat, error);
    return abort;
}
}  // namespace

void bind_ecat(nb::class_<Device> &device, nb::module_ &module) {
    bind_slave(module);
    nb::class_<Master>(module, "Master")
        .def(nb::init<Device &, int>(), Unlocked())
        .def_prop_ro("state", [](const Master &self) { return service_state(self.info->state); })
        .def_prop_ro("mode", [](const Master &self) { return wire_mode(self.info->mode); })
        .def_prop_ro("hot_connect", [](const Master &self) {
            return hot_connect(self.info->statisticsInfo.hcState);
        })
        .def_prop_ro("hot_connect_failure", [](const Master &self) {
            return hot_connect_failure(self.info->statisticsInfo.hcAbortCode);
        })
        .def_prop_ro("slaves", &Master::slaves, nb::rv_policy::reference_internal)
        // clang-format off
        STATISTIC("comm_period", commPeriod)
        STATISTIC("total_axes", totalAxesNum)
        STATISTIC("input_size", totalInputSize)
        STATISTIC("output_size", totalOutputSize)
        STATISTIC("rings", ringNum)
        STATISTIC("rx_pdo_size", totalRxPdoSize)
        STATISTIC("tx_pdo_size", totalTxPdoSize)
        STATISTIC("tx_delay", txDelay)
        STATISTIC("min_tx_delay", minTxDelay)
        STATISTIC("max_tx_delay", maxTxDelay)
        STATISTIC("packet_loss", packetLoss)
        STATISTIC("packet_timeout", packetTimeout)
        STATISTIC("over_cycle", overCycle)
        STATISTIC("cycles", cycleCounter)
        STATISTIC("cyclic_frames", numOfCyclicFrames)
        STATISTIC("min_clock_interval", minRefClockInterval)
        STATISTIC("max_clock_interval", maxRefClockInterval)
        STATISTIC("average_clock_interval", avgRefClockInterval)
        STATISTIC("min_clock_difference", minDiffFromNextDcClock)
        STATISTIC("max_clock_difference", maxDiffFromNextDcClock);
    // clang-format on
    device
        .def("scan_network", [](Device &self, int master) {
            check("ScanNetwork", Api::Ecat, self.ecat.ScanNetwork(master));
        }, Unlocked())
        .def("register_read", &register_read)
        .def("sdo_upload", &sdo_upload)
        .def("sdo_download", &sdo_download)
        .def("reset_reference_clock", [](Device &self, int master) {
            check("ResetRefClockInfo", Api::Ecat, self.ecat.ResetRefClockInfo(master));
        }, Unlocked())
        .def("reset_transmit_statistics", [](Device &self, int master) {
            check("ResetTransmitStatisticsInfo", Api::Ecat,
                  self.ecat.ResetTransmitStatisticsInfo(master));
        }, Unlocked())
        .def("start_hot_connect", [](Device &self, int master) {
            check("StartHotconnect", Api::Ecat, self.ecat.StartHotconnect(master));
        }, Unlocked());
}

}  // namespace robotd
