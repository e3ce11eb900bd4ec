"""Ends the process that has started it unless its input ends in time; a program, see `starting`."""

import os
import select
import signal
import sys


def watch(seconds: float, line: str) -> None:
    """Wait for the end of the input; after so long [s] print a line and kill the parent process."""
    parent = os.getppid()
    if not select.select([0], [], [], seconds)[0]:
        try:
            os.write(2, f"{line}\n".encode())
        finally:  # whatever became of the line, as where nobody reads it
            os.kill(parent, signal.SIGKILL)


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # launchers send it here, too; its parent ends its input
    watch(float(sys.argv[1]), sys.argv[2])
