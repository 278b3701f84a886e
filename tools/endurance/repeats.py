"""A short program that is repeated many times on the simulation, in its own time: does it leak?"""

from __future__ import annotations

import os

import click
from tools.endurance.vitals import Vitals, vitals

from robotd import open_robot
from robotd.api.robots import SteppedClock
from robotd_teach.program_code import Program
from robotd_teach.programs import Programs

IN_A_RUN = 10  # times that the steps are repeated in one run of the program
LOOKS = 10
PROGRAM = Program.parse(f"""
speed: 1.0
steps:
  - move: {{joints: {{joint2: 0.3, joint3: 1.4, joint5: 1.2}}}}
  - line: {{by: {{z: 0.001}}}}
  - repeat:
      times: {IN_A_RUN}
      steps:
        - move: {{joints: {{joint1: 0.001}}}}
        - output: {{name: 0.1, on: true}}
        - wait: {{time_s: 0.01}}
        - move: {{joints: {{joint1: 0.0}}}}
        - output: {{name: 0.1, on: false}}
        - if: {{input: 0.3, steps: [{{message: on}}], else: [{{message: off}}]}}
""")


def repeat(times: int) -> list[Vitals]:
    """Return looks at this process at even distances; the last one at the end.

    ``times``: that the steps are executed, a multiple of ``IN_A_RUN`` times ``LOOKS``.
    """
    looks = []
    with open_robot("cr3a", "sim", clock=SteppedClock()) as robot:
        programs = robot.feature(Programs)
        for _ in range(LOOKS):
            for _ in range(times // IN_A_RUN // LOOKS):
                programs.run(PROGRAM)
            looks.append(vitals(os.getpid()))
    return looks


@click.command()
@click.option("--times", default=10_000, show_default=True, help="How often.")
def main(times: int) -> None:
    """Repeat a short program on the simulation, and print what the process holds."""
    for number, look in enumerate(repeat(times), 1):
        click.echo(
            f"{times * number // LOOKS:6d} times: {look.rss_mib:7.2f} MiB, {look.threads} threads,"
            f" {look.fds} files, {look.cpu_s:.0f} s of CPU"
        )


if __name__ == "__main__":
    main()
