// libioapi: two images of bytes.
#include <cstring>

#include "IOApi.h"
#include "client.hpp"

using namespace standin;

namespace {
template <class Command>
int with_range(const WMX3Api *api, int addr, int size, int bit, Command command) {
    return with_engine(api, [&](Block &block) -> int {
        if (addr < 0 || addr >= constants::maxIoInSize || bit < 0 || bit > 7)
            return ErrorCode::IOAddressOutOfRange;
        if (size < 1 || addr + size > constants::maxIoInSize) return ErrorCode::IOSizeOutOfRange;
        command(block);
        return ErrorCode::None;
    });
}

void set_bit(unsigned char &byte, int bit, unsigned char data) {
    byte = static_cast<unsigned char>(data ? byte | 1 << bit : byte & ~(1 << bit));
}

// Writes bits of an output byte, as far as the mask lets it.
void write(Block &block, int addr, unsigned char data, unsigned char bits = 0xFF) {
    if (block.masked) bits &= block.writable[addr];
    block.outputs[addr] = static_cast<unsigned char>((block.outputs[addr] & ~bits) | (data & bits));
}
}  // namespace

namespace wmx3Api {

Io::Io() : wmx3Api(nullptr) {}
Io::Io(WMX3Api *f) : wmx3Api(f) {}
bool Io::IsDeviceValid() { return wmx3Api && wmx3Api->IsDeviceValid(); }
WMX3APIFUNC Io::ErrorToString(int errCode, char *pString, unsigned int size) {
    return error_text(errCode, "ErrorCode IOErrorCode", pString, size);
}
WMX3APIFUNC Io::GetLibVersion(int *major, int *minor, int *revision, int *fix) {
    return version(major, minor, revision, fix);
}

#define READ(name, image)                                                              \
    WMX3APIFUNC Io::Get##name##Bit(int addr, int bit, unsigned char *pData) {          \
        return with_range(wmx3Api, addr, 1, bit,                                       \
                          [&](Block &block) { *pData = block.image[addr] >> bit & 1; }); \
    }                                                                                  \
    WMX3APIFUNC Io::Get##name##Byte(int addr, unsigned char *pData) {                  \
        return Get##name##Bytes(addr, 1, pData);                                       \
    }                                                                                  \
    WMX3APIFUNC Io::Get##name##Bytes(int addr, int size, unsigned char *pData) {       \
        return with_range(wmx3Api, addr, size, 0,                                      \
                          [&](Block &block) { std::memcpy(pData, block.image + addr, size); }); \
    }                                                                                  \
    WMX3APIFUNC Io::Get##name##BitEx(int addr, int bit, unsigned char *pData) {        \
        return Get##name##Bit(addr, bit, pData);                                       \
    }                                                                                  \
    WMX3APIFUNC Io::Get##name##ByteEx(int addr, unsigned char *pData) {                \
        return Get##name##Byte(addr, pData);                                           \
    }                                                                                  \
    WMX3APIFUNC Io::Get##name##BytesEx(int addr, int size, unsigned char *pData) {     \
        return Get##name##Bytes(addr, size, pData);                                    \
    }
READ(In, inputs)
READ(Out, outputs)

WMX3APIFUNC Io::SetOutBit(int addr, int bit, unsigned char data) {
    return with_range(wmx3Api, addr, 1, bit, [&](Block &block) {
        write(block, addr, data ? 0xFF : 0, static_cast<unsigned char>(1 << bit));
    });
}
WMX3APIFUNC Io::SetOutByte(int addr, unsigned char data) { return SetOutBytes(addr, 1, &data); }
WMX3APIFUNC Io::SetOutBytes(int addr, int size, unsigned char *pData) {
    return with_range(wmx3Api, addr, size, 0, [&](Block &block) {
        for (int index = 0; index < size; index++) write(block, addr + index, pData[index]);
    });
}
WMX3APIFUNC Io::SetOutBits(int *pAddr, int *pBit, unsigned char *pData, int count) {
    if (count < 1) return IOErrorCode::IOCountOutOfRange;
    for (int index = 0; index < count; index++)
        if (int code = SetOutBit(pAddr[index], pBit[index], pData[index])) return code;
    return ErrorCode::None;
}
WMX3APIFUNC Io::SetOutBitEx(int addr, int bit, unsigned char data) {
    return SetOutBit(addr, bit, data);
}
WMX3APIFUNC Io::SetOutByteEx(int addr, unsigned char data) { return SetOutByte(addr, data); }
WMX3APIFUNC Io::SetOutBytesEx(int addr, int size, unsigned char *pData) {
    return SetOutBytes(addr, size, pData);
}
WMX3APIFUNC Io::SetOutBitsEx(int *pAddr, int *pBit, unsigned char *pData, int count) {
    return SetOutBits(pAddr, pBit, pData, count);
}

// Numbers stand in the images with their low byte first.
#define ANALOG(Name, Type)                                                             \
    WMX3APIFUNC Io::GetInAnalogData##Name(int addr, Type *pData) {                     \
        return GetInBytes(addr, sizeof(Type), reinterpret_cast<unsigned char *>(pData)); \
    }                                                                                  \
    WMX3APIFUNC Io::GetOutAnalogData##Name(int addr, Type *pData) {                    \
        return GetOutBytes(addr, sizeof(Type), reinterpret_cast<unsigned char *>(pData)); \
    }                                                                                  \
    WMX3APIFUNC Io::SetOutAnalogData##Name(int addr, Type data) {                      \
        return SetOutBytes(addr, sizeof(Type), reinterpret_cast<unsigned char *>(&data)); \
    }                                                                                  \
    WMX3APIFUNC Io::GetInAnalogData##Name##Ex(int addr, Type *pData) {                 \
        return GetInAnalogData##Name(addr, pData);                                     \
    }                                                                                  \
    WMX3APIFUNC Io::GetOutAnalogData##Name##Ex(int addr, Type *pData) {                \
        return GetOutAnalogData##Name(addr, pData);                                    \
    }                                                                                  \
    WMX3APIFUNC Io::SetOutAnalogData##Name##Ex(int addr, Type data) {                  \
        return SetOutAnalogData##Name(addr, data);                                     \
    }
ANALOG(Char, char)
ANALOG(UChar, unsigned char)
ANALOG(Short, short)
ANALOG(UShort, unsigned short)
ANALOG(Int, int)
ANALOG(UInt, unsigned int)

WMX3APIFUNC Io::SetOutBitMaskMode(bool enable) {
    return with_engine(wmx3Api, [&](Block &block) {
        block.masked = enable;
        return 0;
    });
}
WMX3APIFUNC Io::SetOutBitMaskBit(int addr, int bit, unsigned char data) {
    return with_range(wmx3Api, addr, 1, bit,
                      [&](Block &block) { set_bit(block.writable[addr], bit, data); });
}
WMX3APIFUNC Io::SetOutBitMaskByte(int addr, unsigned char data) {
    return SetOutBitMaskBytes(addr, 1, &data);
}
WMX3APIFUNC Io::SetOutBitMaskBytes(int addr, int size, unsigned char *pData) {
    return with_range(wmx3Api, addr, size, 0,
                      [&](Block &block) { std::memcpy(block.writable + addr, pData, size); });
}
WMX3APIFUNC Io::SetOutBitMaskBits(int *pAddr, int *pBit, unsigned char *pData, int count) {
    if (count < 1) return IOErrorCode::IOCountOutOfRange;
    for (int index = 0; index < count; index++)
        if (int code = SetOutBitMaskBit(pAddr[index], pBit[index], pData[index])) return code;
    return ErrorCode::None;
}
WMX3APIFUNC Io::GetOutBitMaskBit(int addr, int bit, unsigned char *pData) {
    return with_range(wmx3Api, addr, 1, bit,
                      [&](Block &block) { *pData = block.writable[addr] >> bit & 1; });
}
WMX3APIFUNC Io::GetOutBitMaskByte(int addr, unsigned char *pData) {
    return GetOutBitMaskBytes(addr, 1, pData);
}
WMX3APIFUNC Io::GetOutBitMaskBytes(int addr, int size, unsigned char *pData) {
    return with_range(wmx3Api, addr, size, 0,
                      [&](Block &block) { std::memcpy(pData, block.writable + addr, size); });
}

WMX3APIFUNC Io::SetInitialOutByte(int addr, unsigned char data, unsigned char enable) {
    return SetInitialOutBytes(addr, 1, &data, &enable);
}
WMX3APIFUNC Io::SetInitialOutBytes(int addr, int size, unsigned char *pData,
                                   unsigned char *pEnable) {
    return with_range(wmx3Api, addr, size, 0, [&](Block &block) {
        std::memcpy(block.initial + addr, pData, size);
        std::memcpy(block.has_initial + addr, pEnable, size);
    });
}
WMX3APIFUNC Io::GetInitialOutByte(int addr, unsigned char *pData, unsigned char *pEnable) {
    return GetInitialOutBytes(addr, 1, pData, pEnable);
}
WMX3APIFUNC Io::GetInitialOutBytes(int addr, int size, unsigned char *pData,
                                   unsigned char *pEnable) {
    return with_range(wmx3Api, addr, size, 0, [&](Block &block) {
        std::memcpy(pData, block.initial + addr, size);
        std::memcpy(pEnable, block.has_initial + addr, size);
    });
}

}  // namespace wmx3Api
