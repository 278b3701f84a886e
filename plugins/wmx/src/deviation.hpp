// Deviation of an axis' commands from its setpoints after an underrun.
#pragma once

#include <algorithm>
#include <cmath>

namespace robotd {

// Limits of one axis, user units and seconds.
struct AxisLimits {
    double velocity, acceleration;
};

// Fades to zero as the core's StallRecovery does (decision 8), but gently, because the setpoints
// themselves recover meanwhile: with half of the acceleration limit while its rate is large, then with
// a tenth of it and 2 % of the velocity limit. Path and deviation together keep the limit, except for
// a tenth of it where the path needs all. It never reverses a moving path.
struct Deviation {
    double offset = 0, rate = 0, path = 0;  // path: velocity of the setpoints, in the cycle before

    // One cycle of the engine, while the setpoints move with `path_velocity`.
    void fade(double path_velocity, double cycle_s, const AxisLimits &limits) {
        if (offset == 0 && rate == 0) return;
        const double change = path_velocity - path;
        path = path_velocity;
        const double fastest = SHARE * limits.velocity, moving = MOVING * limits.velocity;
        const double speed = std::fabs(path_velocity);
        const double constant_s = std::max(TIME_CONSTANT_S, 2 * fastest / (GENTLE * limits.acceleration));
        double back = std::clamp(-offset / constant_s, -fastest, fastest);
        if (back * path_velocity < 0 && speed > moving) back = std::clamp(back, -speed, speed);
        const bool large = std::fabs(rate) > LARGE * limits.velocity;
        const double step = (large ? HARD : GENTLE) * limits.acceleration * cycle_s;
        const double least = GENTLE * limits.acceleration * cycle_s;
        const double most = limits.acceleration * cycle_s, before = rate;
        const double down = std::min(step, std::max(most + change, least));
        const double up = std::min(step, std::max(most - change, least));
        rate += std::clamp(back - rate, -down, up);
        offset += (before + rate) / 2 * cycle_s;
        if (std::fabs(offset) < NEGLIGIBLE * limits.velocity && std::fabs(rate) < moving)
            offset = rate = 0;
    }

private:
    static constexpr double SHARE = 0.02, LARGE = 0.02, MOVING = 1e-3;  // of the velocity limit
    static constexpr double HARD = 0.5, GENTLE = 0.1;                   // of the acceleration limit
    static constexpr double TIME_CONSTANT_S = 0.05;
    static constexpr double NEGLIGIBLE = 1e-6;  // s, at the velocity limit
};

}  // namespace robotd
