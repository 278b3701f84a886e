// The cyclic buffers of the axes, as the engine runs them.
#include <cmath>

#include "sim.hpp"

namespace standin {

void run_queue(Block &block, int index) {
    Axis &axis = block.axes[index];
    CyclicQueue &queue = axis.queue;
    if (queue.done == queue.cycles) {
        if (queue.count == 0) {
            queue.state = WAITING;
            axis.velocity = 0;
            return;
        }
        const CyclicQueue::Command &next = queue.commands[queue.first];
        queue.first = (queue.first + 1) % CYCLIC_COMMANDS;
        queue.count--;
        queue.from = axis.command;
        queue.to = next.relative ? axis.command + next.position : next.position;
        queue.cycles = next.cycles;
        queue.done = 0;
        queue.age = block.cycle - next.added;
    }
    queue.state = EXECUTING;
    queue.done++;
    const double command = queue.from + (queue.to - queue.from) * queue.done / queue.cycles;
    const double velocity = (command - axis.command) / CYCLE_S;
    if (queue.max_acc > 0 && std::fabs(velocity - axis.velocity) / CYCLE_S > queue.max_acc) {
        brake_queue(block, index, MAX_ACC_ERROR);
        return;
    }
    axis.command = command;
    axis.velocity = velocity;
}

void end_queue(Block &block, int axis, QueueState state) {
    Axis &mine = block.axes[axis];
    CoreMotionAxisStatus &status = block.status.axesStatus[axis];
    mine.queue.first = mine.queue.count = mine.queue.done = mine.queue.cycles = 0;
    mine.queue.state = state;
    if (!mine.queue.executing) return;
    mine.queue.executing = false;
    mine.velocity = 0;
    status.opState = OperationState::Idle;
    status.detailOpState = DetailOperationState::Idle;
}

int brake_queue(Block &block, int axis, QueueState state) {
    Axis &mine = block.axes[axis];
    const double velocity = mine.velocity;
    end_queue(block, axis, state);
    mine.velocity = velocity;
    block.status.axesStatus[axis].opState = OperationState::DirectControl;  // anything but idle
    return stop_axis(block, axis, 0, true);
}

}  // namespace standin
