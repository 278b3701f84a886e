// STAND-IN for the vendor's header of this name, for tests: written from published facts, own
// words and own code, source compatible only. What it invents is listed in tests/standin/README.md.
#pragma once

#include "standin/constants.h"
#include "standin/enums.h"
#include "standin/platform.h"

#define WMX3APIFUNC STANDIN_RESULT

namespace wmx3Api {

class Profile {
public:
    ProfileType::T type;
    double velocity;
    double acc;
    double dec;
    double jerkAcc;
    double jerkDec;
    double jerkAccRatio;
    double jerkDecRatio;
    double accTimeMilliseconds;
    double decTimeMilliseconds;
    double startingVelocity;
    double endVelocity;
    double secondVelocity;
    double movingAverageTimeMilliseconds;

    Profile();
    static Profile SetupTrapezoidal(double velocity, double acc, double dec,
                                    double startingVelocity = 0, double endVelocity = 0);
    static Profile SetupTimeAccTrapezoidal(double velocity, double accTimeMilliseconds,
                                           double decTimeMilliseconds,
                                           double startingVelocity = 0, double endVelocity = 0);
};

class AxisSelection {
public:
    int axisCount;
    int axis[constants::maxAxes];
    AxisSelection();
    AxisSelection(int count, const int *axes);
};

class InterruptData {
public:
    int numOfAxes = 0;
    int cycleTimeMicroseconds = 0;
    long long cycleCounter = 0;
};

class EngineStatus {
public:
    EngineState::T state = EngineState::Idle;
    unsigned int error = 0;
    int numOfInterrupts = 0;
    InterruptData interrupts[constants::maxInterrupts];
};

class DeviceInfoA {
public:
    unsigned int id = 0;
    DeviceType::T type = DeviceType::DeviceTypeNormal;
    unsigned int watchdog = 0;
    unsigned int watchdogCount = 0;
    char name[constants::maxDeviceName] = {};
};

class DevicesInfoA {
public:
    unsigned int count = 0;
    DeviceInfoA devices[constants::maxDevices];
};

class ModuleSuspend {
public:
    unsigned char module[constants::moduleLen] = {};
};

class WMX3Api {
public:
    HANDLE dev;

    WMX3Api();
    ~WMX3Api();
    WMX3Api(const WMX3Api &) = delete;
    WMX3Api &operator=(const WMX3Api &) = delete;

    WMX3APIFUNC CreateDevice(const char *path,
                             DeviceType::T type = DeviceType::T::DeviceTypeNormal,
                             unsigned int waitTimeMilliseconds = 0, int core = -1,
                             DWORD_PTR affinityMask = 0);
    WMX3APIFUNC CreateDevice(const wchar_t *path,
                             DeviceType::T type = DeviceType::T::DeviceTypeNormal,
                             unsigned int waitTimeMilliseconds = 0, int core = -1,
                             DWORD_PTR affinityMask = 0);
#if STANDIN_CLOSE_DEVICE_FLAG
    WMX3APIFUNC CloseDevice(bool exitNoDev = true);
#else
    WMX3APIFUNC CloseDevice();
#endif
    WMX3APIFUNC StartEngine(const char *path, unsigned int waitTimeMilliseconds = 0, int core = -1,
                            DWORD_PTR affinityMask = 0);
    WMX3APIFUNC RestartEngine(const char *path, unsigned int waitTimeMilliseconds = 0,
                              int core = -1, DWORD_PTR affinityMask = 0);
    WMX3APIFUNC StopEngine(unsigned int waitTimeMilliseconds = 0);
    WMX3APIFUNC StartCommunication(unsigned int waitTimeMilliseconds = 0);
    WMX3APIFUNC StopCommunication(unsigned int waitTimeMilliseconds = 0);
    WMX3APIFUNC GetEngineStatus(EngineStatus *status);
    WMX3APIFUNC SetDeviceName(const char *name);
    WMX3APIFUNC GetDeviceName(char *nameBuf, unsigned int bufSize);
    WMX3APIFUNC GetDeviceID(int *id);
    bool IsDeviceValid();
    WMX3APIFUNC GetAllDevices(DevicesInfoA *devices);
    WMX3APIFUNC SetWatchdog(unsigned int watchdog);
    WMX3APIFUNC SetWatchdog(int deviceId, unsigned int watchdog);
    WMX3APIFUNC GetWatchdog(unsigned int *watchdog, unsigned int *watchdogCount = nullptr);
    WMX3APIFUNC ResetWatchdogTimer();
    WMX3APIFUNC AutoQuitWithoutActiveDev(bool quit);
    WMX3APIFUNC SetInterruptId(unsigned int interruptId);
    WMX3APIFUNC GetInterruptId(unsigned int *interruptId);
    WMX3APIFUNC SetModuleSuspend(ModuleSuspend *suspend);
    WMX3APIFUNC GetModuleSuspend(ModuleSuspend *suspend);
    WMX3APIFUNC AbortModuleSuspend();
    static WMX3APIFUNC ErrorToString(int errCode, char *pString, unsigned int size);
    static WMX3APIFUNC ErrorToString(int errCode, wchar_t *pString, unsigned int size);
    static WMX3APIFUNC GetLibVersion(int *major, int *minor, int *revision, int *fix);
    static WMX3APIFUNC GetIMDllVersion(int *version, int *revision);
};

}  // namespace wmx3Api
