// A customer's program that uses every overload of the SDK's headers as a stand-in must have them.
// That it compiles and links is the point; it also makes the calls, none of which may find the
// engine gone.
#include <AdvancedMotionApi.h>
#include <CoreMotionApi.h>
#include <EcApi.h>
#include <IOApi.h>
#include <WMX3Api.h>

#include <cstdio>
#include <memory>

using namespace wmx3Api;

static int lost = 0;

// The result of a call of any type.
template <class Result>
void made(const char *call, Result result) {
    const int code = static_cast<int>(result);
    if (code != ErrorCode::APIChannelError && code != ErrorCode::DeviceIsNull) return;
    std::printf("%s: %d\n", call, code);
    lost++;
}
#define CALL(expression) made(#expression, expression)

static void engine(WMX3Api &lib) {
    unsigned int number = 0;
    int id = 0, version = 0;
    char text[256];
    wchar_t wide[256];
    EngineStatus status;
    auto devices = std::make_unique<DevicesInfoA>();
    ModuleSuspend suspend;
    CALL(lib.GetEngineStatus(&status)), CALL(lib.SetDeviceName("calls"));
    CALL(lib.GetDeviceName(text, sizeof text)), CALL(lib.GetDeviceID(&id));
    CALL(lib.GetAllDevices(devices.get())), CALL(lib.SetWatchdog(1000)), CALL(lib.SetWatchdog(id, 1000));
    CALL(lib.GetWatchdog(&number)), CALL(lib.GetWatchdog(&number, &number));
    CALL(lib.ResetWatchdogTimer()), CALL(lib.AutoQuitWithoutActiveDev(true));
    CALL(lib.SetInterruptId(0)), CALL(lib.GetInterruptId(&number));
    CALL(lib.GetModuleSuspend(&suspend)), CALL(lib.SetModuleSuspend(&suspend));
    CALL(lib.AbortModuleSuspend()), CALL(WMX3Api::ErrorToString(297, text, sizeof text));
    CALL(WMX3Api::ErrorToString(297, wide, 256)), CALL(WMX3Api::GetIMDllVersion(&version, &version));
}

static void axes(CoreMotion &core, AxisSelection &two) {
    double value = 0;
    AxisCommandMode::T mode;
    auto control = core.axisControl;
    CALL(control->ClearAmpAlarm(0)), CALL(control->ClearAmpAlarm(&two));
    CALL(control->ClearAxisAlarm(0)), CALL(control->ClearAxisAlarm(&two));
    CALL(control->SetAxisCommandMode(0, AxisCommandMode::T::Position));
    CALL(control->SetAxisCommandMode(&two, AxisCommandMode::Position));
    CALL(control->GetAxisCommandMode(0, &mode)), CALL(control->GetPosCommand(0, &value));
    CALL(control->GetPosFeedback(0, &value)), CALL(control->GetVelCommand(0, &value));
    CALL(control->GetVelFeedback(0, &value));
    CALL(core.ExecEStop(EStopLevel::Level1)), CALL(core.ReleaseEStop());
    CALL(core.TriggerFlightRecorder()), CALL(core.ResetFlightRecorder());
    auto home = core.home;
    CALL(home->StartHome(0)), CALL(home->StartHome(&two)), CALL(home->Continue(0));
    CALL(home->Continue(&two)), CALL(home->Cancel(0)), CALL(home->Cancel(&two));
    CALL(home->SetCommandPos(0, 0)), CALL(home->SetFeedbackPos(0, 0)), CALL(home->SetHomeDone(0, 1));
    CALL(home->SetCommandPosToFeedbackPos(0)), CALL(home->SetCommandPosToFeedbackPos(0, 0.1));
}

static void motion(CoreMotion &core, AxisSelection &two) {
    auto move = core.motion;
    Motion::PosCommand pos(0, 1, Profile::SetupTrapezoidal(100, 1000, 1000));
    Motion::JogCommand jog(0, pos.profile);
    Motion::TimedJogCommand timed;
    timed.profile = pos.profile, timed.runTimeMilliseconds = 5;
    Motion::StopCommand stop;
    stop.dec = 1000;
    Motion::TimeCommand time;
    time.timeMilliseconds = 5;
    Motion::WaitCondition condition;
    Motion::LinearIntplCommand line;
    line.axisCount = 2, line.axis[1] = 1, line.profile = pos.profile;
    CALL(move->StartPos(&pos)), CALL(move->StartPos(1, &pos)), CALL(move->StartMov(&pos));
    CALL(move->StartMov(1, &pos)), CALL(move->Pause(0)), CALL(move->Pause(&two));
    CALL(move->Resume(0)), CALL(move->Resume(&two));
    CALL(move->OverridePos(&pos)), CALL(move->OverrideMov(&pos)), CALL(move->OverrideVel(&pos));
    CALL(move->OverrideAcc(&pos)), CALL(move->OverrideDec(&pos)), CALL(move->OverrideJerkAcc(&pos));
    CALL(move->OverrideJerkDec(&pos)), CALL(move->OverrideProfile(&pos));
    CALL(move->OverridePos(1, &pos)), CALL(move->OverrideVel(1, &pos));
    CALL(move->StartJog(&jog)), CALL(move->StartJog(1, &jog)), CALL(move->StartJog(&timed));
    CALL(move->StartJog(1, &timed)), CALL(move->Stop(0)), CALL(move->Stop(0, 1000.0));
    CALL(move->Stop(&two)), CALL(move->Stop(1, &stop)), CALL(move->ExecQuickStop(0));
    CALL(move->ExecQuickStop(&two)), CALL(move->ExecTimedStop(0, 5.0));
    CALL(move->ExecTimedStop(&two, 5)), CALL(move->ExecTimedStop(1, &time));
    CALL(move->Wait(0)), CALL(move->Wait(&two)), CALL(move->Wait(&condition));
    CALL(move->Wait(0, 100)), CALL(move->Wait(&two, 100)), CALL(move->Wait(&condition, INFINITE));
    CALL(move->StartLinearIntplPos(&line)), CALL(move->Wait(&two, 1000));
    CALL(move->StartLinearIntplMov(&line)), CALL(move->Wait(&two, 1000));
}

static void velocity_and_torque(CoreMotion &core, AxisSelection &two) {
    double value = 0;
    auto speed = core.velocity;
    Velocity::VelCommand vel(0, Profile::SetupTimeAccTrapezoidal(1, 1, 1));
    Velocity::TimedVelCommand timed;
    timed.profile = vel.profile, timed.runTimeMilliseconds = 5;
    Velocity::TimeCommand time;
    CALL(core.axisControl->SetAxisCommandMode(0, AxisCommandMode::Velocity));
    CALL(speed->StartVel(&vel)), CALL(speed->StartVel(1, &vel)), CALL(speed->StartVel(&vel, 100.0));
    CALL(speed->StartVel(&timed)), CALL(speed->StartVel(1, &timed)), CALL(speed->OverrideVel(&vel));
    CALL(speed->OverrideVel(1, &vel)), CALL(speed->Stop(0)), CALL(speed->Stop(&two));
    CALL(speed->ExecQuickStop(0)), CALL(speed->ExecQuickStop(&two)), CALL(speed->ExecTimedStop(0, 5));
    CALL(speed->ExecTimedStop(&two, 5)), CALL(speed->ExecTimedStop(1, &time));
    CALL(speed->SetMaxMotorSpeed(0, 3000)), CALL(speed->GetMaxMotorSpeed(0, &value));
    CALL(core.motion->Wait(0, 1000)), CALL(core.axisControl->SetAxisCommandMode(0, AxisCommandMode::Torque));
    Torque::TrqCommand torque;
    torque.torque = 10;
    CALL(core.torque->StartTrq(&torque)), CALL(core.torque->StopTrq(0));
    CALL(core.torque->SetMaxTrqLimit(0, 300)), CALL(core.torque->GetMaxTrqLimit(0, &value));
    CALL(core.torque->SetPositiveTrqLimit(0, 300)), CALL(core.torque->SetNegativeTrqLimit(0, 300));
}

static void parameters(CoreMotion &core, char *path) {
    auto config = core.config;
    auto system = std::make_unique<Config::SystemParam>();
    auto axis = std::make_unique<Config::AxisParam>();
    AxisSelection copies;
    double one = 1, other = 1;
    bool flag = false;
    int low = 0, high = 0;
    Config::HomeParam home;
    CALL(config->GetParam(system.get())), CALL(config->GetParam(0, system.get()));
    CALL(config->SetParam(system.get())), CALL(config->SetParam(0, system.get(), system.get()));
    CALL(config->GetAxisParam(axis.get())), CALL(config->GetAxisParam(0, axis.get()));
    CALL(config->SetAxisParam(axis.get())), CALL(config->SetAxisParam(0, axis.get()));
    CALL(config->GetGearRatio(0, &one, &other)), CALL(config->SetGearRatio(0, one, other));
    CALL(config->SetEncoderRange(0, false, 0, 0)), CALL(config->GetEncoderRange(0, &flag, &low, &high));
    CALL(config->SetMovingAverageProfileTime(0, 0)), CALL(config->GetMovingAverageProfileTime(0, &one));
    CALL(config->SetVelocityFeedforwardGain(0, 0)), CALL(config->GetVelocityFeedforwardGain(0, &one));
    CALL(config->GetHomeParam(0, &home)), CALL(config->SetHomeParam(0, &home, &home));
    CALL(config->Export(path, system.get())), CALL(config->Export(path, axis.get()));
    CALL(config->Export(path, axis.get(), 0)), CALL(config->Export(path, system.get(), 0));
    CALL(config->Export(path, system.get(), axis.get(), 0)), CALL(config->GetAndExportAll(path));
    CALL(config->Import(path, system.get())), CALL(config->Import(path, axis.get()));
    CALL(config->Import(path, system.get(), axis.get())), CALL(config->Import(path, axis.get(), 0));
    CALL(config->Import(path, system.get(), 0, &copies));
    CALL(config->Import(path, system.get(), axis.get(), 0));
    CALL(config->ImportAndSetAll(path)), CALL(config->ImportAndSetAll(path, system.get(), axis.get()));
}

static void splines(AdvancedMotion &advanced, CoreMotion &core) {
    auto move = advanced.advMotion;
    unsigned int number = 0;
    AdvMotion::SplinePoint points[2];
    points[0].pos[0] = 0.5, points[1].pos[0] = 1.5;
    double times[] = {10, 20};
    AdvMotion::PointTimeSplineCommand timed;
    AdvMotion::TotalTimeSplineCommand total;
    AdvMotion::ProfileSplineCommand profiled;
    AdvMotion::VelAccLimitedSplineCommand limited;
    timed.dimensionCount = total.dimensionCount = profiled.dimensionCount = 1;
    timed.axis[0] = total.axis[0] = profiled.axis[0] = limited.axis[0] = 1;
    limited.dimensionCount = 1, limited.velLimit[0] = 100, limited.accLimit[0] = 10000;
    total.totalTimeMilliseconds = 20, profiled.profile = Profile::SetupTrapezoidal(100, 1e4, 1e4);
    CALL(move->CreateSplineBuffer(0, 2)), CALL(move->GetSplineBufferPoints(0, &number));
    CALL(move->GetSplineBytesPerPoint(&number));
#define SPLINES(name)                                                                       \
    CALL(move->name(0, &timed, 2, points, times)), CALL(core.motion->Wait(1, 1000));         \
    CALL(move->name(0, &total, 2, points)), CALL(core.motion->Wait(1, 1000));                \
    CALL(move->name(0, &profiled, 2, points)), CALL(core.motion->Wait(1, 1000));             \
    CALL(move->name(0, &limited, 2, points)), CALL(core.motion->Wait(1, 1000));
    SPLINES(StartCSplinePos)
    SPLINES(StartCSplineMov)
    SPLINES(StartCBSplinePos)
    SPLINES(StartCBSplineMov)
    CALL(move->FreeSplineBuffer(0));
}

static void io_and_slaves(Io &io, ecApi::Ecat &ecat) {
    unsigned char bytes[8] = {};
    unsigned int size = 0, abort = 0;
    unsigned short answers = 0;
    int address = 0, bit = 0, al = 0;
    short number = 0;
    unsigned int wide = 0;
    auto master = std::make_unique<ecApi::EcMasterInfo>();
    auto masters = std::make_unique<ecApi::EcMasterInfoList>();
    CALL(io.GetInBit(0, 0, bytes)), CALL(io.GetInByteEx(0, bytes)), CALL(io.GetInBytesEx(0, 8, bytes));
    CALL(io.GetOutBitEx(0, 0, bytes)), CALL(io.GetOutBytesEx(0, 8, bytes)), CALL(io.SetOutBitEx(0, 0, 1));
    CALL(io.SetOutBytesEx(0, 8, bytes)), CALL(io.SetOutBitsEx(&address, &bit, bytes, 1));
    CALL(io.GetInAnalogDataShort(0, &number)), CALL(io.SetOutAnalogDataUIntEx(0, wide));
    CALL(io.SetOutBitMaskMode(false)), CALL(io.SetOutBitMaskBits(&address, &bit, bytes, 1));
    CALL(io.GetOutBitMaskBytes(0, 8, bytes)), CALL(io.SetInitialOutByte(0, 1, 0));
    CALL(io.GetInitialOutBytes(0, 8, bytes, bytes));
    CALL(ecat.ScanNetwork()), CALL(ecat.ScanNetwork(0)), CALL(ecat.GetMasterInfo(master.get()));
    CALL(ecat.GetMasterInfo(0, master.get())), CALL(ecat.GetMasterInfoList(masters.get()));
    CALL(ecat.ChangeSlaveState(0, 0, ecApi::EcStateMachine::Op, &al));
    CALL(ecat.ResetRefClockInfo()), CALL(ecat.ResetTransmitStatisticsInfo(0));
    CALL(ecat.RegisterRead(0, 0x130, 2, bytes)), CALL(ecat.RegisterRead(0, 0, 0x130, 2, bytes));
    CALL(ecat.RegisterWrite(0, 0, 0x100, 1, bytes));
    CALL(ecat.RegisterBroadcastRead(0, 0x130, 2, bytes, &answers));
    CALL(ecat.SdoUpload(0, 0, 0x1000, 0, 4, bytes, &size, &abort));
    CALL(ecat.SdoUpload(0, 0, 0x1000, 0, ecApi::EcSdoType::Normal, 4, bytes, &size, &abort, 100, TRUE));
    CALL(ecat.SdoDownload(0, 0, 0x6060, 0, ecApi::EcSdoType::Expedited, 1, bytes, &abort));
    CALL(ecat.PdoRead(0, 0, 0x6064, 0, 4, bytes, &size)), CALL(ecat.TxPdoWrite(0, 0, 0x6040, 0, 2, bytes));
    CALL(ecat.SetOutputByte(0, 6, 0, 1)), CALL(ecat.GetOutputBytes(0, 6, 0, 8, bytes));
    CALL(ecat.GetInputBit(0, 6, 0, 0, bytes)), CALL(ecat.StartHotconnect(0));
}

int main(int count, char **words) {
    if (count != 3) return 2;
    WMX3Api lib;
    CoreMotion core;
    AdvancedMotion advanced;
    Io io;
    ecApi::Ecat ecat;
    CALL(lib.CreateDevice(words[1], DeviceType::DeviceTypeNormal, 10000));
    core = CoreMotion(&lib), advanced = AdvancedMotion(&lib);
    io = Io(&lib), ecat = ecApi::Ecat(&lib);
    CALL(lib.StartCommunication(10000));
    const int numbers[] = {0, 1};
    AxisSelection two(2, numbers);
#if STANDIN_SERVO_ON == 3
    CALL(core.axisControl->SetServoOn(&two, 1, 1000));
#else
    CALL(core.axisControl->SetServoOn(0, 1)), CALL(core.axisControl->SetServoOn(&two, 1));
#endif
    engine(lib), axes(core, two), motion(core, two);
    velocity_and_torque(core, two), splines(advanced, core);
    io_and_slaves(io, ecat), parameters(core, words[2]);
    CALL(lib.StopCommunication(10000)), CALL(lib.StopEngine(10000)), lib.CloseDevice();
    if (!lost) std::puts("all calls are there");
    return lost != 0;
}
