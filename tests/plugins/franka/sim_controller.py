"""franky-sim with what it lacks: modes of the arm, rejected motions, silence, pushes, and parts.

Runs in the Python of the environment that has ``franky-sim``, which imports nothing of robotd:

    python sim_controller.py 127.0.0.1

Reads commands as lines of JSON and answers each by one:

    {"mode": "reflex", "errors": [31]}   the arm ends its motion and stays in the mode
    {"mode": "idle"}                     the person at the arm has released it
    {"silent_s": 0.2}                    no states are sent, and nothing is read, for so long
    {"push": [axis, torque]}             a person at one joint, N·m; 0: it lets go
    {"force": [x, y, z]}                 a force on the hand, at its centre of mass, base frame, N
    {"is_singular": true}                that force has no estimate, as near singularities
    {"homed": false}                     the hand has lost its stroke, as by a power cut
    {"part": 0.03}                       a part of this width between the fingers, m; 0: none
    {}                                   the state, as ``Truth`` of ``controller.py``

The state has the estimate of that force as libfranka documents it, which franky-sim leaves at zero.
A reflex is ended by the client's recovery; user stop and guiding are not. The hand answers a
command that is stopped with *aborted*, as libfranka documents it: franky-sim never answers it.
"""

from __future__ import annotations

import json
import queue
import sys
import threading
import time
from typing import Any

import franky_sim
import numpy as np
from franky_sim import franka_gripper_protocol, franka_robot_server
from franky_sim import franka_robot_protocol as protocol
from franky_sim.franka_gripper_server import FrankaGripperServer
from franky_sim.franka_robot_server import FrankaRobotServer
from franky_sim.mujoco_simulator import MujocoSimulator

MODES = {
    "other": 0,
    "idle": 1,
    "guiding": 3,
    "reflex": 4,
    "user_stopped": 5,
    "recovery": 6,
}
IDLE, REFLEX = MODES["idle"], MODES["reflex"]
HAND, LINK = "robot0_hand", "robot0_fr3_link7"
BIAS_N = 1e-3  # an estimate is not exactly zero, except near singular positions
ANSWER_S = (
    0.05  # for one period of the arm's time; far below the 1 s after which libfranka gives up
)


class Arm(FrankaRobotServer):
    """The server of one robot, whose mode can be set.

    Attributes:
        mode: the mode that is reported; None: that of franky-sim, idle or move.
        motions, recoveries: numbers of those that were begun.
        force: on the hand, base frame, N.
        is_singular: the arm has no estimate of it.
    """

    def __init__(self, *arguments: Any) -> None:
        self.force, self.is_singular = np.zeros(3), False
        self.mode: int | None = None
        self.errors = (False,) * 41
        self.motions = self.recoveries = 0
        self._sent_s = 0.0
        self._answered = True
        super().__init__(*arguments)

    @property
    def waits(self) -> bool:
        """The client has not answered the last state of a motion yet.

        Time waits for it: on a busy computer franky-sim would execute old torques meanwhile, and
        the arm swing. A real arm stops by a reflex.
        """
        late = time.monotonic() - self._sent_s > ANSWER_S
        return bool(self.current_motion_id) and not self._answered and not late

    def send_state(self) -> None:
        super().send_state()
        self._sent_s, self._answered = time.monotonic(), False

    def _handle_udp_command(self, command_data: bytes) -> None:
        self._answered = True
        super()._handle_udp_command(command_data)

    def enter(self, mode: int, errors: tuple[int, ...]) -> None:
        self.errors = tuple(number in errors for number in range(41))
        self.mode = None if mode == IDLE else mode
        if self.mode is not None and self.current_motion_id:
            motion = self.current_motion_id
            self.stop_motion(send_preemption_signal=False)
            status = protocol.MoveStatus.kReflexAborted
            if mode == MODES["user_stopped"]:
                status = protocol.MoveStatus.kPreemptedDueToActivatedSafetyFunctions
            protocol.BaseCommand.send_response(
                self._tcp_socket, protocol.RobotCommand.kMove, motion, status
            )
            self.reset_current_motion_id()

    def start_motion(self, *arguments: Any) -> None:
        if self.mode is not None:
            raise ValueError("the arm is in a mode that takes no motion")
        self.motions += 1
        self._answered = True  # the client waits for the first state of the motion
        super().start_motion(*arguments)

    def recover(self) -> bool:
        self.recoveries += 1
        if self.mode == REFLEX:
            self.mode, self.errors = None, (False,) * 41
        return self.mode is None

    @property
    def _tcp_socket(self) -> Any:
        return self._FrankaServer__tcp_socket

    @property
    def robot_state(self) -> Any:
        state = super().robot_state
        if not self.is_singular:
            state = state.replace(K_F_ext_hat_K=self._estimate(state))
        if self.mode is None:
            return state
        return state.replace(
            robot_mode=protocol.RobotMode(self.mode), errors=self.errors, reflex_reason=self.errors
        )

    def _estimate(self, state: Any) -> tuple[float, ...]:
        """Return the wrench of the arm on what pushes it: along the axes of K, about its origin."""
        pose, to_k = (
            np.reshape(columns, (4, 4), order="F") for columns in (state.O_T_EE, state.EE_T_K)
        )
        frame = pose @ to_k
        center = self.robot.data.xipos[self.robot.model.body(HAND).id]
        torque = np.cross(center - frame[:3, 3], self.force)
        on_arm = np.concatenate([frame[:3, :3].T @ self.force, frame[:3, :3].T @ torque])
        return tuple((BIAS_N - on_arm).tolist())


class Hand(FrankaGripperServer):
    """The server of the hand.

    Attributes:
        part_m: width of the part between the fingers.
        commands: names of those that were begun.
        force: of the last grasp, N.
    """

    def __init__(self, robot: Any, hostname: str) -> None:
        self.part_m = 0.0
        self.commands: list[str] = []
        self.force = self._looked_s = 0.0
        super().__init__(robot, hostname)

    def _check_motion_state(self) -> None:
        """Look once a step, not while time waits: franky-sim counts looks without motion."""
        if self._robot.data.time != self._looked_s:
            self._looked_s = self._robot.data.time
            super()._check_motion_state()

    def start_move(self, width: float, *rest: Any) -> None:
        self.commands.append("move")
        super().start_move(max(width, self.part_m), *rest)

    def start_grasp(self, width: float, speed: float, force: float, *rest: Any) -> None:
        self.commands.append("grasp")
        self.force = force
        super().start_grasp(max(width, self.part_m), speed, force, *rest)

    def start_homing(self, *rest: Any) -> None:
        self.commands.append("homing")
        super().start_homing(*rest)

    def stop(self, command_id: int, tcp_socket: Any) -> None:
        self.commands.append("stop")
        if self._pending_command_id is not None:
            protocol.BaseCommand.send_response(
                self._pending_tcp_socket,
                self._pending_command_type,
                self._pending_command_id,
                franka_gripper_protocol.GripperCommandStatus.kAborted,
                command_type_struct="H",
                status_type_struct="H",
            )
        super().stop(command_id, tcp_socket)


def recover(command: Any, server: Arm) -> None:
    """Answer ``AutomaticErrorRecovery``."""
    status = protocol.AutomaticErrorRecoveryStatus
    command.reply(status.kSuccess if server.recover() else status.kCommandNotPossibleRejected)


def main() -> None:
    protocol.AutomaticErrorRecoveryCommand.handle = recover
    franky_sim.simulation_server.FrankaRobotServer = Arm
    franka_robot_server.FrankaGripperServer = Hand
    commands: queue.Queue[dict[str, Any]] = queue.Queue()

    def listen() -> None:
        for line in sys.stdin:
            commands.put(json.loads(line))
        commands.put({"end": True})

    with MujocoSimulator() as simulator:
        robot = simulator.add_robot()
        with franky_sim.SimulationServer(simulator, [sys.argv[1]]) as server:
            arm = server.robot_servers[0]
            threading.Thread(target=listen, daemon=True).start()
            answer({})
            serve(server, arm, robot, commands)


def answer(content: dict[str, Any]) -> None:
    sys.stdout.write(json.dumps(content) + "\n")
    sys.stdout.flush()


def serve(server: Any, arm: Arm, robot: Any, commands: queue.Queue[dict[str, Any]]) -> None:
    """Run periods of 1 ms, a late one at once, as a controller does."""
    speaks_s, push = 0.0, (0, 0.0)
    due_s = time.monotonic()
    while True:
        while not commands.empty():
            command = commands.get()
            if command.get("end"):
                return
            if "mode" in command:
                arm.enter(MODES[command["mode"]], tuple(command.get("errors", ())))
            if "silent_s" in command:
                speaks_s = time.monotonic() + command["silent_s"]
            push = tuple(command.get("push", push))
            arm.force = np.array(command.get("force", arm.force))
            arm.is_singular = command.get("is_singular", arm.is_singular)
            hand = arm.gripper_server
            hand.part_m = command.get("part", hand.part_m)
            if not command.get("homed", True):
                hand._max_width = 0.0
            state = {
                "position": list(robot.inner_state.q),
                "torque": list(robot.inner_state.tau_j),
                "motions": arm.motions,
                "recoveries": arm.recoveries,
                "width": robot.hand_width,
                "hand_commands": hand.commands,
                "hand_force": hand.force,
                "wrench": wrench_on_link(arm, robot),
            }
            answer(state)
        if time.monotonic() > speaks_s:
            arm.process_commands()
            if arm.waits:
                time.sleep(0.0001)
                continue
            period(server, arm, robot, push)
        due_s = max(due_s + 0.001, time.monotonic() - 0.005)
        time.sleep(max(0.0, due_s - time.monotonic()))


def wrench_on_link(arm: Arm, robot: Any) -> list[float]:
    """Return force and torque of the push on the last link, by the frames of MuJoCo."""
    hand, link = robot.model.body(HAND).id, robot.model.body(LINK).id
    turned = robot.data.xmat[link].reshape(3, 3).T
    torque = np.cross(robot.data.xipos[hand] - robot.data.xpos[link], arm.force)
    return [*(turned @ arm.force), *(turned @ torque)]


def period(server: Any, arm: Arm, robot: Any, push: tuple[int, float]) -> None:
    """Step by 1 ms, with the hand's torque on top of the motor's, and send the state."""
    axis, torque = push
    robot.data.xfrc_applied[robot.model.body(HAND).id, :3] = arm.force
    if torque:
        robot.data.qfrc_applied[robot._dof_addrs[axis]] += torque
    server.sim.step()
    arm.send_state()


if __name__ == "__main__":
    main()
