"""Benches by name, and how a seed is run on one."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

from tests.witness.bench import Bench
from tests.witness.canopen_bench import CanopenBench
from tests.witness.dobot_bench import DobotBench
from tests.witness.draws import FAULTS
from tests.witness.ethercat_bench import EthercatBench
from tests.witness.franka_bench import FrankaBench
from tests.witness.model_bench import ArmBench, MujocoBench, SimBench
from tests.witness.one_by_one import one_by_one
from tests.witness.play import WitnessPlay
from tests.witness.servo_bench import ServoBench
from tests.witness.tool_play import ToolPlay
from tests.witness.wmx_bench import WmxBench

RATE_HZ = 100.0


def with_tool(make: Callable[..., Bench], **options: float) -> Bench:
    """Return a bench of an arm whose tool moves in the sequences, too."""
    made = make(**options)
    made.bent = made.bent_joints
    return made


BENCHES: dict[str, Callable[..., Bench]] = {
    "sim": SimBench,
    "mujoco": MujocoBench,
    "arm": ArmBench,
    "canopen": CanopenBench,
    "keeping": partial(CanopenBench, keeps=True),
    "mode-by-sdo": partial(CanopenBench, mode_by_sdo=True),
    "ethercat": EthercatBench,
    "dobot": DobotBench,
    "franka": FrankaBench,
    "feetech": partial(ServoBench, "feetech"),
    "dynamixel": partial(ServoBench, "dynamixel"),
    "wmx": WmxBench,
    "sim-base": partial(SimBench, axes=1, base=True),
    "canopen-base": partial(CanopenBench, axes=1, base=True),
    "keeping-base": partial(CanopenBench, axes=1, base=True, keeps=True),
    "ethercat-base": partial(EthercatBench, axes=1, base=True),
    "wmx-base": partial(WmxBench, axes=1, base=True),
    "mujoco-tool": partial(with_tool, MujocoBench),
    "dobot-tool": partial(with_tool, DobotBench),
    "franka-tool": partial(with_tool, FrankaBench),
}
SHOWN_COMMANDS, SHOWN_FINDINGS = 6, 6


def run_seed(
    name: str, seed: int, faults: Mapping[str, float] = FAULTS, log: list[str] | None = None
) -> str:
    """Run a sequence; return what was found, with the commands before it: "" if nothing.

    ``log``: takes all commands.
    """
    with one_by_one():
        bench = BENCHES[name](rate_hz=RATE_HZ)
        play = (ToolPlay if bench.bent else WitnessPlay)(bench, faults)
        findings = play.play(seed)
    if log is not None:
        log += play.log
    if not findings:
        return ""
    shown = [f"    {line}" for line in play.log[-SHOWN_COMMANDS:]]
    shown += [f"  * {line}" for line in findings[:SHOWN_FINDINGS]]
    return "\n".join([f"{name}, seed {seed}, after {len(play.log)} commands:", *shown])
