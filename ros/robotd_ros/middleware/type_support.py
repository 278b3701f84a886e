"""Type supports of messages without the generator of their Python code.

Works around: the package that loads the type support of every message, ``rosidl_generator_py``,
imports the generator of messages too, with a parser and its grammar (lark).
Measured: 39 modules, 10 ms of the start-up and 4 MiB of memory (x86_64, Python 3.11).
Upstream: none known; the package does without its generator where that cannot be imported.
Ends with: no version yet.
Shown by: tests/contract/test_imports_of_serving.py.
"""

from __future__ import annotations

from importlib import import_module

from robotd.optional_imports import missing

with missing("rosidl_generator_py.generate_py_impl"):
    import_module("rosidl_generator_py")  # before rclpy does
