// The slaves of the one EtherCAT master.
#pragma once

#include "client.hpp"

namespace standin {

constexpr int IO_BYTES = 8;  // of an I/O module, in and out

struct Identity {
    unsigned int vendor, product, revision, serial;
};

// What the slave with this number answers in its information interface and in object 0x1018.
inline Identity identity_of(const Slave &slave, int number) {
    const bool drive = slave.axis >= 0;
    return {drive ? 0x57A4Du : 0x57A4Eu, drive ? 0xD1u : 0x10u, 1, 1000u + number};  // invented
}

// Runs `command(block, slave)` for a slave that answers.
template <class Command>
int with_slave(const WMX3Api *api, int master, int slave, Command command) {
    return with_engine(api, [&](Block &block) -> int {
        if (master != 0 || slave < 0 || slave >= block.slave_count) return ErrorCode::IDOutOfRange;
        if (block.slaves[slave].lost) return ecApi::EcErrorCode::SlaveStateBelowPreop;
        return command(block, block.slaves[slave]);
    });
}

}  // namespace standin
