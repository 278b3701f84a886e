"""Sequences of the tool in the witness: segments are appended while it moves, and faults come."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress

import numpy as np
from tests.witness.bench import Bench
from tests.witness.draws import FAULTS, fault, tool_commands
from tests.witness.play import PATIENCE_S, WitnessPlay

from robotd.api import Payload
from robotd.errors import RobotdError
from robotd_tool_space import Line
from robotd_tool_space.sequences.sequence_run import SequenceRun
from robotd_tool_space.tool_groups import ToolGroups

BLEND_M = 0.02
PAUSE_S = 0.3
SLOW = 0.3
CENTER_M = (0.0, 0.0, 0.05)


class ToolPlay(WitnessPlay):
    """An arm on a bench, and clients that move its tool, too.

    Attributes:
        joined: number of appends that have joined a motion under way.
    """

    def __init__(self, bench: Bench, faults: Mapping[str, float] = FAULTS) -> None:
        super().__init__(bench, faults)
        self._draws = {**self._draws, **tool_commands(fault(len(bench.judges), faults))}
        self.joined = 0

    def _sequence(
        self, displacements: list[list[float]], part: float, end: str, struck: bool,
        drawn: tuple[str, list[int], int, str, int], s: float,
    ) -> None:  # fmt: skip
        """Move along lines with corners rounded; all but the first are appended on the way."""
        self._bring_back()
        self.release()
        self.robot.set_speed(1.0)
        tool = self.robot.feature(ToolGroups).only
        tool.execute(tool.plan_joints(np.array(self.bench.bent)))
        places = np.cumsum(displacements, axis=0).tolist()
        lines = [Line(tool.pose_relative(x=x, y=y, z=z), blend_m=BLEND_M) for x, y, z in places]
        run = tool.sequence(tool.plan_parts(lines[:1]), tool.arrive())
        further, ends = lines[1:], [self.bench.now_s + s] if end else []
        patience_s = self.bench.now_s + PATIENCE_S
        if struck:
            self._disturb(drawn, s)

        def tick() -> None:
            if further and run.progress().part > part:
                with suppress(RobotdError):
                    self.joined += run.append([further.pop(0)])
            if ends and self.bench.now_s >= ends[0]:
                ends.clear()
                self._end_sequence(run, end)
            if self.bench.now_s > patience_s:
                run.cancel()

        outcome, message = run.run(tick)
        self.log[-1] += f" -> {self.joined} joined so far, {outcome.name} {message[:60]}"

    def _end_sequence(self, run: SequenceRun, how: str) -> None:
        match how:
            case "stop":
                self._stop()
            case "cancel":
                run.cancel()
            case "pause":
                self.robot.pause()
                self.later(PAUSE_S, self.robot.resume)
            case "slow":
                self.robot.set_speed(SLOW)

    def _payload(self, mass_kg: float) -> None:
        """Let the arm compensate another mass; some switch their servos off and on for it."""
        payload = Payload(mass_kg, CENTER_M if mass_kg else (0.0, 0.0, 0.0))
        self.requested(lambda: self.robot.payload.set_payload(payload))
