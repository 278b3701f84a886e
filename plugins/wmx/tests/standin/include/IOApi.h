// STAND-IN for the vendor's header of this name, for tests. See tests/standin/README.md.
#pragma once

#include "WMX3Api.h"

namespace wmx3Api {

class Io {
public:
    Io();
    explicit Io(WMX3Api *f);
    Io(const Io &other) = default;
    Io &operator=(const Io &other) = default;

    WMX3APIFUNC GetInBit(int addr, int bit, unsigned char *pData);
    WMX3APIFUNC GetInByte(int addr, unsigned char *pData);
    WMX3APIFUNC GetInBytes(int addr, int size, unsigned char *pData);
    WMX3APIFUNC GetOutBit(int addr, int bit, unsigned char *pData);
    WMX3APIFUNC GetOutByte(int addr, unsigned char *pData);
    WMX3APIFUNC GetOutBytes(int addr, int size, unsigned char *pData);
    WMX3APIFUNC SetOutBit(int addr, int bit, unsigned char data);
    WMX3APIFUNC SetOutByte(int addr, unsigned char data);
    WMX3APIFUNC SetOutBytes(int addr, int size, unsigned char *pData);
    WMX3APIFUNC SetOutBits(int *pAddr, int *pBit, unsigned char *pData, int count);
    WMX3APIFUNC GetInBitEx(int addr, int bit, unsigned char *pData);
    WMX3APIFUNC GetInByteEx(int addr, unsigned char *pData);
    WMX3APIFUNC GetInBytesEx(int addr, int size, unsigned char *pData);
    WMX3APIFUNC GetOutBitEx(int addr, int bit, unsigned char *pData);
    WMX3APIFUNC GetOutByteEx(int addr, unsigned char *pData);
    WMX3APIFUNC GetOutBytesEx(int addr, int size, unsigned char *pData);
    WMX3APIFUNC SetOutBitEx(int addr, int bit, unsigned char data);
    WMX3APIFUNC SetOutByteEx(int addr, unsigned char data);
    WMX3APIFUNC SetOutBytesEx(int addr, int size, unsigned char *pData);
    WMX3APIFUNC SetOutBitsEx(int *pAddr, int *pBit, unsigned char *pData, int count);
#define STANDIN_ANALOG_CALLS(Name, Type)                              \
    WMX3APIFUNC GetInAnalogData##Name(int addr, Type *pData);         \
    WMX3APIFUNC GetOutAnalogData##Name(int addr, Type *pData);        \
    WMX3APIFUNC SetOutAnalogData##Name(int addr, Type data);          \
    WMX3APIFUNC GetInAnalogData##Name##Ex(int addr, Type *pData);     \
    WMX3APIFUNC GetOutAnalogData##Name##Ex(int addr, Type *pData);    \
    WMX3APIFUNC SetOutAnalogData##Name##Ex(int addr, Type data);
    STANDIN_ANALOG_CALLS(Char, char)
    STANDIN_ANALOG_CALLS(UChar, unsigned char)
    STANDIN_ANALOG_CALLS(Short, short)
    STANDIN_ANALOG_CALLS(UShort, unsigned short)
    STANDIN_ANALOG_CALLS(Int, int)
    STANDIN_ANALOG_CALLS(UInt, unsigned int)
#undef STANDIN_ANALOG_CALLS
    WMX3APIFUNC SetOutBitMaskMode(bool enable);
    WMX3APIFUNC SetOutBitMaskBit(int addr, int bit, unsigned char data);
    WMX3APIFUNC SetOutBitMaskByte(int addr, unsigned char data);
    WMX3APIFUNC SetOutBitMaskBytes(int addr, int size, unsigned char *pData);
    WMX3APIFUNC SetOutBitMaskBits(int *pAddr, int *pBit, unsigned char *pData, int count);
    WMX3APIFUNC GetOutBitMaskBit(int addr, int bit, unsigned char *pData);
    WMX3APIFUNC GetOutBitMaskByte(int addr, unsigned char *pData);
    WMX3APIFUNC GetOutBitMaskBytes(int addr, int size, unsigned char *pData);
    WMX3APIFUNC SetInitialOutByte(int addr, unsigned char data, unsigned char enable);
    WMX3APIFUNC SetInitialOutBytes(int addr, int size, unsigned char *pData,
                                   unsigned char *pEnable);
    WMX3APIFUNC GetInitialOutByte(int addr, unsigned char *pData, unsigned char *pEnable);
    WMX3APIFUNC GetInitialOutBytes(int addr, int size, unsigned char *pData,
                                   unsigned char *pEnable);
    static WMX3APIFUNC ErrorToString(int errCode, char *pString, unsigned int size);
    static WMX3APIFUNC GetLibVersion(int *major, int *minor, int *revision, int *fix);
    bool IsDeviceValid();

    WMX3Api *wmx3Api;
};

}  // namespace wmx3Api
