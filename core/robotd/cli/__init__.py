"""The command line; the commands are in ``commands``."""

import signal
import threading

if threading.current_thread() is threading.main_thread():
    # Ctrl-C during the imports ends the process without a traceback.
    _before = signal.getsignal(signal.SIGINT)
    if _before is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    from robotd.cli.main import main

    signal.signal(signal.SIGINT, _before)
else:
    from robotd.cli.main import main

__all__ = ["main"]
