"""Stands in for the program and fails once, as a node that dies: fails_once.py MARKER COMMAND NAME PROGRAM ARGUMENTS...

The first time that COMMAND is asked for a path with the folder NAME in it, the file MARKER is made and the attempt ends with
an error. Everything else is the program itself.
"""

import os
import sys
from pathlib import Path


def main():
    marker, command, name, program, *arguments = sys.argv[1:]
    concerns = command in arguments and any(name in Path(argument).parts for argument in arguments)
    if concerns and not Path(marker).exists():
        Path(marker).write_text("failed once\n")
        print('{"event": "error", "message": "failed once, as asked", "remedy": "try again"}')
        return 1
    os.execv(program, [program, *arguments])


if __name__ == "__main__":
    sys.exit(main())
