// The slaves of the one EtherCAT master.
#pragma once

#include "client.hpp"

namespace standin {

constexpr int IO_BYTES = 8;  // of an I/O module, in and out

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
