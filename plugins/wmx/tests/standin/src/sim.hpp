// Commands of the engine. Every function expects the block's lock to be held.
#pragma once

#include "AdvancedMotionApi.h"
#include "block.hpp"

namespace standin {

constexpr double INSTANT = 1e12;  // a deceleration that takes less than a cycle

Path path_to(double position, double velocity, double target, double speed, double acc, double dec);
Path path_to_speed(double position, double velocity, double speed, double acc, double dec);

// Commands return an error code, 0 when they are accepted.
int check_axis(const Block &block, int axis);
int check_drive(const Block &block, int axis);
int check_motion(const Block &block, int axis, AxisCommandMode::T mode);
int set_servo(Block &block, int axis, bool on);
int set_mode(Block &block, int axis, AxisCommandMode::T mode);
int start_move(Block &block, int axis, double target, const Profile &profile);
int start_speed(Block &block, int axis, const Profile &profile, OperationState::T state,
                double run_ms = 0);
int pause_move(Block &block, int axis);
int resume_move(Block &block, int axis);
int start_torque(Block &block, int axis, double percent);
int start_line(Block &block, const Motion::LinearIntplCommand &command, bool relative);
int start_home(Block &block, int axis);
int stop_axis(Block &block, int axis, double dec = 0, bool quick = false);
int stop_within(Block &block, int axis, double seconds);
int create_buffer(Block &block, int channel, unsigned int points);
int start_spline(Block &block, int channel, int dimensions, const int *axes, unsigned int points,
                 const AdvMotion::SplinePoint *point, const double *times_ms);

void run_queue(Block &block, int axis);  // one cycle of the cyclic buffer
void end_queue(Block &block, int axis, QueueState state);  // at once; the axis stands
int brake_queue(Block &block, int axis, QueueState state);  // with QuickStopDec
void move_channel(Block &block, Channel &channel);
void end_channel(Block &block, Channel &channel, bool complete);
void interrupt(Block &block, int axis);  // the servo is off, the drive is gone, or the like
void set_home(Block &block, int axis, double position);
void rescale(Block &block, int axis);  // after the gear ratio or the polarity changed

void tick(Block &block);  // one cycle

}  // namespace standin
