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
    }                                                                                  \
    WMX3APIFUNC Io::Get##name##AnalogDataShort(int addr, short *pData) {               \
        return Get##name##Bytes(addr, 2, reinterpret_cast<unsigned char *>(pData));    \
    }
READ(In, inputs)
READ(Out, outputs)

WMX3APIFUNC Io::SetOutBit(int addr, int bit, unsigned char data) {
    return with_range(wmx3Api, addr, 1, bit,
                      [&](Block &block) { set_bit(block.outputs[addr], bit, data); });
}
WMX3APIFUNC Io::SetOutByte(int addr, unsigned char data) { return SetOutBytes(addr, 1, &data); }
WMX3APIFUNC Io::SetOutBytes(int addr, int size, unsigned char *pData) {
    return with_range(wmx3Api, addr, size, 0,
                      [&](Block &block) { std::memcpy(block.outputs + addr, pData, size); });
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
WMX3APIFUNC Io::SetOutAnalogDataShort(int addr, short data) {
    return SetOutBytes(addr, 2, reinterpret_cast<unsigned char *>(&data));
}

}  // namespace wmx3Api
