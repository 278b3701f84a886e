// Cubic splines through points in time, for up to DIMENSIONS axes.
#include <algorithm>
#include <cmath>
#include <vector>

#include "sim.hpp"

namespace standin {

using Core = CoreMotionErrorCode;
using Advanced = AdvancedMotionErrorCode;

namespace {
// Second derivatives of a cubic spline that starts and ends at rest (tridiagonal system).
void solve(int knots, const double *times, const double *values, double *curvature) {
    std::vector<double> upper(knots), right(knots);
    auto slope = [&](int k) { return (values[k + 1] - values[k]) / (times[k + 1] - times[k]); };
    const int last = knots - 1;
    for (int k = 0; k <= last; k++) {
        const double before = k > 0 ? times[k] - times[k - 1] : 0;
        const double after = k < last ? times[k + 1] - times[k] : 0;
        const double jump = (k < last ? slope(k) : 0) - (k > 0 ? slope(k - 1) : 0);
        const double pivot = 2 * (before + after) - (k > 0 ? before * upper[k - 1] : 0);
        upper[k] = after / pivot;
        right[k] = (6 * jump - (k > 0 ? before * right[k - 1] : 0)) / pivot;
    }
    curvature[last] = right[last];
    for (int k = last - 1; k >= 0; k--) curvature[k] = right[k] - upper[k] * curvature[k + 1];
}

void evaluate(const Channel &channel, int dimension, int k, double &position, double &velocity) {
    const double *t = channel.times_s, *p = channel.position[dimension];
    const double *m = channel.curvature[dimension];
    const double h = t[k + 1] - t[k], a = t[k + 1] - channel.time_s, b = channel.time_s - t[k];
    position = (m[k] * a * a * a + m[k + 1] * b * b * b) / (6 * h) +
               (p[k] / h - m[k] * h / 6) * a + (p[k + 1] / h - m[k + 1] * h / 6) * b;
    velocity = (m[k + 1] * b * b - m[k] * a * a) / (2 * h) + (p[k + 1] - p[k]) / h -
               (m[k + 1] - m[k]) * h / 6;
}
}  // namespace

int create_buffer(Block &block, int channel, unsigned int points) {
    if (channel < 0 || channel >= CHANNELS) return ErrorCode::ChannelOutOfRange;
    if (points > SPLINE_POINTS) return ErrorCode::RequestedBufferTooLarge;
    if (block.channels[channel].points) return Core::ChannelBufferMemoryAlreadyAllocated;
    block.channels[channel].points = points;
    return ErrorCode::None;
}

int start_spline(Block &block, int channel, int dimensions, const int *axes, unsigned int points,
                 const AdvMotion::SplinePoint *point, const double *times_ms) {
    if (channel < 0 || channel >= CHANNELS) return ErrorCode::ChannelOutOfRange;
    if (dimensions < 1 || dimensions > DIMENSIONS) return Advanced::DimensionOutOfRange;
    for (int index = 0; index < dimensions; index++) {
        if (int code = check_motion(block, axes[index], AxisCommandMode::Position)) return code;
        if (std::count(axes, axes + dimensions, axes[index]) > 1) return ErrorCode::DuplicateAxis;
        if (block.status.axesStatus[axes[index]].opState != OperationState::Idle)
            return Core::NotIdleOrIntplState;
    }
    Channel &mine = block.channels[channel];
    if (!mine.points) return Core::ChannelBufferMemoryNotAllocated;
    if (mine.running) return Core::ChannelExecutingCommands;
    if (points > mine.points) return Core::ChannelNotEnoughSpace;
    if (points < 2) return Advanced::PointCountBelowMinimum;
    int knots = 0;
    auto add = [&](double time_s, auto value) {
        mine.times_s[knots] = time_s;
        for (int index = 0; index < dimensions; index++) mine.position[index][knots] = value(index);
        knots++;
    };
    add(0, [&](int index) { return block.axes[axes[index]].command; });
    for (unsigned int k = 0; k < points; k++) {
        if (!std::isfinite(times_ms[k]) || times_ms[k] < 0) return Advanced::PointTimeOutOfRange;
        if (k > 0 && times_ms[k] <= times_ms[k - 1]) return Advanced::PointTimeNotIncreasing;
        if (k == 0 && times_ms[k] == 0) continue;
        if (times_ms[k] / 1000 - mine.times_s[knots - 1] < 1e-6)
            return Advanced::TimeBetweenPointsTooClose;
        double square = 0;
        for (int index = 0; index < dimensions; index++)
            square += std::pow(point[k].pos[index] - mine.position[index][knots - 1], 2);
        if (std::sqrt(square) < 1e-6) continue;  // dropped, as documented
        add(times_ms[k] / 1000, [&](int index) { return point[k].pos[index]; });
    }
    if (block.faults.half_spline) knots = std::max(3, (knots + 1) / 2);
    if (block.faults.fast_spline)
        for (int k = 0; k < knots; k++) mine.times_s[k] *= 0.6;
    if (block.faults.swapped_spline && dimensions > 1)
        for (int k = 1; k < knots; k++) std::swap(mine.position[0][k], mine.position[1][k]);
    if (knots < 3) return Advanced::PointCountBelowMinimum;  // two besides the start
    mine.knots = knots;
    mine.dimensions = dimensions;
    mine.acceleration = 0;
    for (int index = 0; index < dimensions; index++) {
        mine.axes[index] = axes[index];
        solve(knots, mine.times_s, mine.position[index], mine.curvature[index]);
    }
    for (int k = 0; k < knots; k++) {
        double square = 0;
        for (int index = 0; index < dimensions; index++)
            square += mine.curvature[index][k] * mine.curvature[index][k];
        mine.acceleration = std::max(mine.acceleration, std::sqrt(square));
    }
    mine.running = true;
    mine.stopping = mine.timed = false;
    mine.time_s = 0;
    mine.rate = 1;
    for (int index = 0; index < dimensions; index++) {
        CoreMotionAxisStatus &status = block.status.axesStatus[axes[index]];
        block.axes[axes[index]].channel = channel;
        status.opState = OperationState::Intpl;
        status.detailOpState = DetailOperationState::Intpl_Spline;
        status.motionComplete = false;
        status.profileTargetPos = mine.position[index][knots - 1];
        status.profileTotalMilliseconds = mine.times_s[knots - 1] * 1000;
    }
    return ErrorCode::None;
}

void move_channel(Block &block, Channel &channel) {
    if (channel.stopping) {
        double square = 0;
        for (int index = 0; index < channel.dimensions; index++)
            square += std::pow(block.axes[channel.axes[index]].velocity, 2);
        // The path's own speed falls with its largest composite acceleration.
        if (channel.rate == 1 && !channel.timed) {
            const double speed = std::sqrt(square);
            channel.rate_slope =
                speed > 1e-9 ? std::max(channel.acceleration, 1e-3) / speed : INSTANT;
        }
        channel.rate = std::max(0.0, channel.rate - channel.rate_slope * CYCLE_S);
    }
    channel.time_s += channel.rate * CYCLE_S;
    const double end_s = channel.times_s[channel.knots - 1];
    const bool arrived = channel.time_s >= end_s - 1e-9;
    if (arrived) channel.time_s = end_s;
    const double *first = channel.times_s, *last = channel.times_s + channel.knots;
    int k = static_cast<int>(std::upper_bound(first, last, channel.time_s) - first) - 1;
    k = std::clamp(k, 0, channel.knots - 2);
    for (int index = 0; index < channel.dimensions; index++) {
        Axis &axis = block.axes[channel.axes[index]];
        CoreMotionAxisStatus &status = block.status.axesStatus[channel.axes[index]];
        if (axis.channel != &channel - block.channels) continue;  // out of it: servo off
        evaluate(channel, index, k, axis.command, axis.velocity);
        axis.velocity *= channel.rate;
        status.intplSegment = k;
        status.profileCompletedMilliseconds = channel.time_s * 1000;
        status.profileRemainingMilliseconds = (end_s - channel.time_s) * 1000;
        if (channel.stopping) status.opState = OperationState::Stop;
    }
    if (arrived || channel.rate <= 0) end_channel(block, channel, arrived && !channel.stopping);
}

void end_channel(Block &block, Channel &channel, bool complete) {
    channel.running = false;
    for (int index = 0; index < channel.dimensions; index++) {
        Axis &axis = block.axes[channel.axes[index]];
        CoreMotionAxisStatus &status = block.status.axesStatus[channel.axes[index]];
        if (axis.channel != &channel - block.channels) continue;
        axis.channel = -1;
        axis.velocity = 0;
        status.opState = OperationState::Idle;
        status.detailOpState = DetailOperationState::Idle;
        status.motionComplete = complete;
    }
}

}  // namespace standin
