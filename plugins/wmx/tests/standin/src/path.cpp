// Profiles made of pieces of constant acceleration.
#include <algorithm>
#include <cmath>

#include "sim.hpp"

namespace standin {

void Path::begin(double position, double velocity) {
    count = 1;
    duration_s = 0;
    target = position;
    pieces[0] = {0, position, velocity, 0};
}

void Path::accelerate(double acceleration, double seconds) {
    if (!(seconds > 0)) return;
    Segment &last = pieces[count - 1];
    last.acceleration = acceleration;
    const double velocity = last.velocity + acceleration * seconds;
    const double position = last.position + (last.velocity + velocity) / 2 * seconds;
    duration_s += seconds;
    pieces[count++] = {duration_s, position, velocity, 0};
}

void Path::at(double time_s, double &position, double &velocity) const {
    int piece = count - 1;
    while (piece > 0 && pieces[piece].start_s > time_s) piece--;
    const Segment &segment = pieces[piece];
    const double since = time_s - segment.start_s;
    velocity = segment.velocity + segment.acceleration * since;
    position = segment.position + (segment.velocity + velocity) / 2 * since;
}

static void brake(Path &path, double dec) {
    const double velocity = path.pieces[path.count - 1].velocity;
    path.accelerate(velocity > 0 ? -dec : dec, std::fabs(velocity) / dec);
    path.pieces[path.count - 1].velocity = 0;
}

Path path_to(double position, double velocity, double target, double speed, double acc,
             double dec) {
    Path path;
    path.begin(position, velocity);
    double way = target - position;
    const double stop_way = velocity * std::fabs(velocity) / (2 * dec);
    if (velocity * way < 0 || std::fabs(stop_way) > std::fabs(way) + 1e-12) {
        brake(path, dec);  // wrong way, or too late to stop there: come back from rest
        way = target - path.pieces[path.count - 1].position;
    }
    const double sign = way < 0 ? -1 : 1, length = std::fabs(way);
    const double start = std::fabs(path.pieces[path.count - 1].velocity);
    // v² = start² + 2·acc·x = 2·dec·(length - x): the speed that can be reached at all
    const double reach = std::sqrt((2 * acc * dec * length + dec * start * start) / (acc + dec));
    const double top = start > speed ? speed : std::min(speed, std::max(reach, start));
    const double ramp = start > top ? dec : acc;
    double rest = length - (top * top) / (2 * dec);
    rest -= std::fabs(top * top - start * start) / (2 * ramp);
    path.accelerate(sign * (top < start ? -ramp : ramp), std::fabs(top - start) / ramp);
    if (top > 0) path.accelerate(0, rest / top);
    path.accelerate(-sign * dec, top / dec);
    path.pieces[path.count - 1].position = path.target = target;
    path.pieces[path.count - 1].velocity = 0;
    return path;
}

Path path_to_speed(double position, double velocity, double speed, double acc, double dec) {
    Path path;
    path.begin(position, velocity);
    if (velocity * speed < 0) brake(path, dec);
    const double now = path.pieces[path.count - 1].velocity;
    const double ramp = std::fabs(speed) > std::fabs(now) ? acc : dec;
    path.accelerate(speed > now ? ramp : -ramp, std::fabs(speed - now) / ramp);
    path.pieces[path.count - 1].velocity = speed;
    path.target = path.pieces[path.count - 1].position;
    return path;
}

}  // namespace standin
