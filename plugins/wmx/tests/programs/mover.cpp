// A customer's program: attaches to the engine, moves one axis, prints its position, detaches.
#include <AdvancedMotionApi.h>
#include <CoreMotionApi.h>
#include <IOApi.h>
#include <WMX3Api.h>

#include <cstdio>
#include <cstdlib>

using namespace wmx3Api;

int main(int count, char **words) {
    if (count != 4) return 2;
    const int axis = std::atoi(words[2]);
    WMX3Api lib;
    CoreMotion cm;
    AdvancedMotion am;
    Io io;
    int err = lib.CreateDevice(words[1], DeviceType::DeviceTypeNormal, 10000);
    if (err == ErrorCode::None) err = lib.SetDeviceName("mover");
    cm = CoreMotion(&lib);
    am = AdvancedMotion(&lib);
    io = Io(&lib);

    Motion::PosCommand pos = Motion::PosCommand();
    pos.profile.type = ProfileType::T::Trapezoidal;
    pos.axis = axis;
    pos.target = std::atof(words[3]);
    pos.profile.velocity = 2;
    pos.profile.acc = 20;
    pos.profile.dec = 20;
    if (err == ErrorCode::None) err = cm.motion->StartPos(&pos);
    if (err == ErrorCode::None) err = cm.motion->Wait(axis, INFINITE);
    if (err == ErrorCode::None) err = io.SetOutBit(3, 2, 1);

    CoreMotionStatus status;
    if (err == ErrorCode::None) err = cm.GetStatus(&status);
    char text[256];
    CoreMotion::ErrorToString(err, text, sizeof text);
    if (err != ErrorCode::None) std::fprintf(stderr, "%d %s\n", err, text);
    else std::printf("%.6f\n", status.axesStatus[axis].posCmd);
    lib.CloseDevice();
    return err != ErrorCode::None;
}
