// libecapi: registers, objects and process data of single slaves.
#include "slaves.hpp"

#include <cstring>

using namespace standin;

namespace {
bool in_memory(int address, int length) {
    return address >= 0 && length >= 1 && address + length <= REGISTERS;
}

// Runs `command(first byte of the slave's part)` for bytes that it has.
template <class Command>
int with_bytes(const WMX3Api *api, int master, int slave, int byte, int size, Command command) {
    return with_slave(api, master, slave, [&](Block &block, Slave &mine) -> int {
        if (mine.axis >= 0 || byte < 0 || size < 1 || byte + size > IO_BYTES)
            return ErrorCode::IOAddressOutOfRange;
        command(block, (slave - block.faults.drives) * IO_BYTES + byte);
        return ErrorCode::None;
    });
}
// Abort codes of CiA 301.
constexpr unsigned int UNKNOWN = 0x06020000, READ_ONLY = 0x06010002, WRONG_LENGTH = 0x06070010;

struct Object {
    unsigned int value;
    int size;               // bytes; 0: there is no such object
    unsigned int *written;  // by a download; null: read only
};

// ETG.1000.6 requires all four entries of the identity, 0x1018.
Object object_of(Slave &slave, int number, int index, int subindex) {
    const bool drive = slave.axis >= 0;
    const Identity identity = identity_of(slave, number);
    const unsigned int entries[] = {identity.vendor, identity.product, identity.revision,
                                    identity.serial};
    if (index == 0x1000 && subindex == 0) return {drive ? 0x00020192u : 0x00030191u, 4, nullptr};
    if (index == 0x1018 && subindex == 0) return {4, 1, nullptr};
    if (index == 0x1018 && subindex >= 1 && subindex <= 4) return {entries[subindex - 1], 4, nullptr};
    if (index == 0x6065 && subindex == 0 && drive) return {slave.window, 4, &slave.window};
    return {0, 0, nullptr};
}
}  // namespace

namespace wmx3Api {
namespace ecApi {

ECAPIFUNC Ecat::RegisterRead(int slaveId, int regAddr, int len, unsigned char *buff) {
    return RegisterRead(0, slaveId, regAddr, len, buff);
}
ECAPIFUNC Ecat::RegisterRead(int masterId, int slaveId, int regAddr, int len, unsigned char *buff) {
    return with_slave(wmx3Api, masterId, slaveId, [&](Block &block, Slave &slave) -> int {
        if (!in_memory(regAddr, len)) return ErrorCode::ArgumentOutOfRange;
        slave.registers[0x130] = communicating(block) ? 0x08 : 0x02;  // AL status: Op, or PreOp
        std::memcpy(buff, slave.registers + regAddr, len);
        return ErrorCode::None;
    });
}
ECAPIFUNC Ecat::RegisterWrite(int slaveId, int regAddr, int len, unsigned char *data) {
    return RegisterWrite(0, slaveId, regAddr, len, data);
}
ECAPIFUNC Ecat::RegisterWrite(int masterId, int slaveId, int regAddr, int len,
                              unsigned char *data) {
    return with_slave(wmx3Api, masterId, slaveId, [&](Block &, Slave &slave) -> int {
        if (!in_memory(regAddr, len)) return ErrorCode::ArgumentOutOfRange;
        std::memcpy(slave.registers + regAddr, data, len);
        return ErrorCode::None;
    });
}

ECAPIFUNC Ecat::SdoUpload(int masterId, int slaveId, int index, int subindex, int size,
                          unsigned char *buffer, unsigned int *actual, unsigned int *errCode,
                          unsigned int) {
    return with_slave(wmx3Api, masterId, slaveId, [&](Block &, Slave &slave) -> int {
        const Object object = object_of(slave, slaveId, index, subindex);
        *errCode = !object.size ? UNKNOWN : size < object.size ? WRONG_LENGTH : 0;
        if (*errCode) return EcErrorCode::SlaveSdoUploadError;
        std::memcpy(buffer, &object.value, object.size);
        *actual = object.size;
        return ErrorCode::None;
    });
}
ECAPIFUNC Ecat::SdoDownload(int masterId, int slaveId, int index, int subindex, int size,
                            unsigned char *data, unsigned int *errCode, unsigned int) {
    return with_slave(wmx3Api, masterId, slaveId, [&](Block &, Slave &slave) -> int {
        const Object object = object_of(slave, slaveId, index, subindex);
        *errCode = !object.size             ? UNKNOWN
                   : !object.written        ? READ_ONLY
                   : size != object.size    ? WRONG_LENGTH
                                            : 0;
        if (*errCode) return EcErrorCode::SlaveSdoDownloadError;
        std::memcpy(object.written, data, size);
        return ErrorCode::None;
    });
}

ECAPIFUNC Ecat::RegisterBroadcastRead(int masterId, int regAddr, int len, unsigned char *buff,
                                      unsigned short *wkc) {
    return with_engine(wmx3Api, [&](Block &block) -> int {
        if (masterId != 0) return ErrorCode::IDOutOfRange;
        if (!in_memory(regAddr, len)) return ErrorCode::ArgumentOutOfRange;
        std::memset(buff, 0, len);
        *wkc = 0;
        for (int index = 0; index < block.slave_count; index++) {
            if (block.slaves[index].lost) continue;
            ++*wkc;
            for (int byte = 0; byte < len; byte++)
                buff[byte] |= block.slaves[index].registers[regAddr + byte];
        }
        return ErrorCode::None;
    });
}
ECAPIFUNC Ecat::RegisterBroadcastWrite(int masterId, int regAddr, int len, unsigned char *data,
                                       unsigned short *wkc) {
    return with_engine(wmx3Api, [&](Block &block) -> int {
        if (masterId != 0) return ErrorCode::IDOutOfRange;
        if (!in_memory(regAddr, len)) return ErrorCode::ArgumentOutOfRange;
        *wkc = 0;
        for (int index = 0; index < block.slave_count; index++) {
            if (block.slaves[index].lost) continue;
            ++*wkc;
            std::memcpy(block.slaves[index].registers + regAddr, data, len);
        }
        return ErrorCode::None;
    });
}

ECAPIFUNC Ecat::SdoUpload(int masterId, int slaveId, int index, int subindex, EcSdoType::T,
                          int size, unsigned char *buffer, unsigned int *actual,
                          unsigned int *errCode, unsigned int waitTime, BOOL) {
    return SdoUpload(masterId, slaveId, index, subindex, size, buffer, actual, errCode, waitTime);
}
ECAPIFUNC Ecat::SdoUpload(int slaveId, int index, int subindex, int size, unsigned char *buffer,
                          unsigned int *actual, unsigned int *errCode, unsigned int waitTime) {
    return SdoUpload(0, slaveId, index, subindex, size, buffer, actual, errCode, waitTime);
}
ECAPIFUNC Ecat::SdoDownload(int masterId, int slaveId, int index, int subindex, EcSdoType::T,
                            int size, unsigned char *data, unsigned int *errCode,
                            unsigned int waitTime, BOOL) {
    return SdoDownload(masterId, slaveId, index, subindex, size, data, errCode, waitTime);
}
ECAPIFUNC Ecat::SdoDownload(int slaveId, int index, int subindex, int size, unsigned char *data,
                            unsigned int *errCode, unsigned int waitTime) {
    return SdoDownload(0, slaveId, index, subindex, size, data, errCode, waitTime);
}

// No slave maps objects that can be read or written one by one.
ECAPIFUNC Ecat::PdoRead(int masterId, int slaveId, int, int, int, unsigned char *,
                        unsigned int *actualSize) {
    *actualSize = 0;
    return with_slave(wmx3Api, masterId, slaveId,
                      [](Block &, Slave &) -> int { return EcErrorCode::SlavePdoNotMapped; });
}
ECAPIFUNC Ecat::TxPdoWrite(int masterId, int slaveId, int, int, int, unsigned char *,
                           unsigned int) {
    return with_slave(wmx3Api, masterId, slaveId, [](Block &, Slave &) -> int {
        return EcErrorCode::SlavePdoReadWriteNotAllowed;
    });
}

#define SLAVE_READ(name, image)                                                                 \
    ECAPIFUNC Ecat::Get##name##Bit(int masterId, int slaveId, int byte, int bit,                \
                                   unsigned char *pData) {                                      \
        return with_bytes(wmx3Api, masterId, slaveId, byte, 1, [&](Block &block, int at) {      \
            *pData = block.image[at] >> (bit & 7) & 1;                                          \
        });                                                                                     \
    }                                                                                           \
    ECAPIFUNC Ecat::Get##name##Byte(int masterId, int slaveId, int byte, unsigned char *pData) { \
        return Get##name##Bytes(masterId, slaveId, byte, 1, pData);                             \
    }                                                                                           \
    ECAPIFUNC Ecat::Get##name##Bytes(int masterId, int slaveId, int byte, int size,             \
                                     unsigned char *pData) {                                    \
        return with_bytes(wmx3Api, masterId, slaveId, byte, size, [&](Block &block, int at) {   \
            std::memcpy(pData, block.image + at, size);                                         \
        });                                                                                     \
    }
SLAVE_READ(Input, inputs)
SLAVE_READ(Output, outputs)

ECAPIFUNC Ecat::SetOutputBit(int masterId, int slaveId, int byte, int bit, unsigned char data) {
    return with_bytes(wmx3Api, masterId, slaveId, byte, 1, [&](Block &block, int at) {
        const int mask = 1 << (bit & 7);
        block.outputs[at] =
            static_cast<unsigned char>(data ? block.outputs[at] | mask : block.outputs[at] & ~mask);
    });
}
ECAPIFUNC Ecat::SetOutputByte(int masterId, int slaveId, int byte, unsigned char data) {
    return SetOutputBytes(masterId, slaveId, byte, 1, &data);
}
ECAPIFUNC Ecat::SetOutputBytes(int masterId, int slaveId, int byte, int size,
                               unsigned char *pData) {
    return with_bytes(wmx3Api, masterId, slaveId, byte, size, [&](Block &block, int at) {
        std::memcpy(block.outputs + at, pData, size);
    });
}

}  // namespace ecApi
}  // namespace wmx3Api
