"""Names for authors of commands of the command line.

A command is a click command in the entry-point group ``robotd.commands``; its entry
``acme = "acme.cli:acme"`` makes ``robotd acme``. It returns an ``ExitCode``; an error of robotd
that leaves it becomes a message and the exit code of its kind. ``robotd_service.health_command`` is
a short example.

Here are options that all commands have alike (``log_options``, ``robot_options``, ``as_json``),
types of values (``NumberRange``, ``FILE``), layout of text, and ``import_ros`` for commands that
need ROS.
"""

from typing import TYPE_CHECKING

from robotd.lazy_names import lazy_names

if TYPE_CHECKING:
    from robotd.cli.check_command import check_robot
    from robotd.cli.check_report import CheckReport
    from robotd.cli.exit_codes import ExitCode
    from robotd.cli.installed import check_backend_overrides, load_installed, load_robot
    from robotd.cli.layout import columns, field, heading, warn, warning
    from robotd.cli.options import (
        FILE,
        FOLDER,
        PORT,
        apply_log_options,
        as_json,
        check_namespace,
        log_options,
        parse_names,
        robot_options,
        which_robot,
    )
    from robotd.cli.preflight import HAS_ROS_WHEELS, import_ros, realtime_permitted, sourced_ros
    from robotd.cli.ros_variables import DEFAULT_MIDDLEWARE, domain_problem, middleware_problem
    from robotd.cli.time_scale import time_scale
    from robotd.entry_points import (
        KINDS,
        PluginOrigin,
        installed_names,
        load_entry,
        plugin_errors,
        unreadable,
    )
    from robotd.log import escaped
    from robotd.number_argument import IntegerRange, NumberRange, parse_integer, parse_number
    from robotd.open_files import MAX_OPEN_FILES
    from robotd.plugin.code_table import load_code_tables
    from robotd.stop_signals import Interrupt, stop_signals
else:
    __getattr__, __dir__ = lazy_names(__name__)

__all__ = [
    "DEFAULT_MIDDLEWARE",
    "FILE",
    "FOLDER",
    "HAS_ROS_WHEELS",
    "KINDS",
    "MAX_OPEN_FILES",
    "PORT",
    "CheckReport",
    "ExitCode",
    "IntegerRange",
    "Interrupt",
    "NumberRange",
    "PluginOrigin",
    "apply_log_options",
    "as_json",
    "check_backend_overrides",
    "check_namespace",
    "check_robot",
    "columns",
    "domain_problem",
    "escaped",
    "field",
    "heading",
    "import_ros",
    "installed_names",
    "load_code_tables",
    "load_entry",
    "load_installed",
    "load_robot",
    "log_options",
    "middleware_problem",
    "parse_integer",
    "parse_names",
    "parse_number",
    "plugin_errors",
    "realtime_permitted",
    "robot_options",
    "sourced_ros",
    "stop_signals",
    "time_scale",
    "unreadable",
    "warn",
    "warning",
    "which_robot",
]
