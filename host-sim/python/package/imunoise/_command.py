"""The command `imunoise`."""

from __future__ import annotations

import signal
import sys

from . import _native


def main() -> None:
    """Runs the command with the words of this process, and exits with its code."""
    # The command takes signals itself.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    sys.exit(_native.command(sys.argv))
