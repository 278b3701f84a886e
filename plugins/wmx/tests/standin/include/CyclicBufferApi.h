// STAND-IN for the vendor's header of this name, for tests. See tests/standin/README.md.
#pragma once

#include "WMX3Api.h"

namespace wmx3Api {

class CyclicBufferCommandType {
public:
    enum T { AbsolutePos, RelativePos };
};

class CyclicBufferState {
public:
    enum T {
        Stopped, ExecutingCommand, WaitingForCommand, MaxAccError,
#if STANDIN_CYCLIC_BUFFER == 1
        CommandModeMismatchError, Busy, ServoOff
#endif
    };
};

class CyclicBufferSingleAxisCommand {
public:
    CyclicBufferCommandType::T type = CyclicBufferCommandType::AbsolutePos;
    double command = 0;
    unsigned int intervalCycles = 1;
};

// These three are indexed by the number of the axis.
class CyclicBufferMultiAxisCommands {
public:
    CyclicBufferSingleAxisCommand cmd[constants::maxAxes];
};

class CyclicBufferSingleAxisOption {
public:
    double maxAcc = 0;  // 0: not watched
};

class CyclicBufferMultiAxisOption {
public:
    CyclicBufferSingleAxisOption option[constants::maxAxes];
};

class CyclicBufferSingleAxisStatus {
public:
    CyclicBufferState::T state = CyclicBufferState::Stopped;
    unsigned int remainCount = 0;
    unsigned int availableCount = 0;  // of the whole buffer
};

class CyclicBufferMultiAxisStatus {
public:
    CyclicBufferSingleAxisStatus status[constants::maxAxes];
};

class CyclicBuffer {
public:
    CyclicBuffer();
    explicit CyclicBuffer(WMX3Api *f);
    CyclicBuffer(const CyclicBuffer &other) = default;
    CyclicBuffer &operator=(const CyclicBuffer &other) = default;

    WMX3APIFUNC OpenCyclicBuffer(int axis, unsigned int numOfCycles);
    WMX3APIFUNC OpenCyclicBuffer(AxisSelection *pAxisSelection, unsigned int numOfCycles);
    WMX3APIFUNC CloseCyclicBuffer(int axis);
    WMX3APIFUNC CloseCyclicBuffer(AxisSelection *pAxisSelection);
    WMX3APIFUNC AddCommand(int axis, CyclicBufferSingleAxisCommand *pCmd);
    WMX3APIFUNC AddCommand(int axis, CyclicBufferSingleAxisCommand *pCmd, int count);
    WMX3APIFUNC AddCommand(AxisSelection *pAxisSelection, CyclicBufferMultiAxisCommands *pCmds);
    WMX3APIFUNC AddCommand(AxisSelection *pAxisSelection, CyclicBufferMultiAxisCommands *pCmds,
                           int count);
    WMX3APIFUNC Execute(int axis, CyclicBufferSingleAxisOption *pOption = nullptr);
    WMX3APIFUNC Execute(AxisSelection *pAxisSelection,
                        CyclicBufferMultiAxisOption *pOption = nullptr);
    WMX3APIFUNC Abort(int axis);
    WMX3APIFUNC Abort(AxisSelection *pAxisSelection);
#if STANDIN_CYCLIC_BUFFER == 1
    WMX3APIFUNC ExecQuickStop(int axis);
    WMX3APIFUNC ExecQuickStop(AxisSelection *pAxisSelection);
#endif
    WMX3APIFUNC GetStatus(int axis, CyclicBufferSingleAxisStatus *pStatus);
    WMX3APIFUNC GetStatus(AxisSelection *pAxisSelection, CyclicBufferMultiAxisStatus *pStatus);

    bool IsDeviceValid();
    static WMX3APIFUNC ErrorToString(int errCode, char *pString, unsigned int size);
    static WMX3APIFUNC GetLibVersion(int *major, int *minor, int *revision, int *fix);

private:
    WMX3Api *wmx3Api;
};

}  // namespace wmx3Api
