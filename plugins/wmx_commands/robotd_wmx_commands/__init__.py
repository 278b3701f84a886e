"""Commands ``robotd wmx`` for machines with the WMX3 SDK.

They belong to no backend, because they are most useful before SDK and backend are installed. The
backend, where it is installed, brings its part of each by an entry point.
"""

INSTALL = "pip install ./plugins/wmx, on the machine that has the WMX3 SDK"
"""Command that installs the backend."""
