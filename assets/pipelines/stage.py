"""Runs one stage of one capture and writes down how it ended, as JSON.

The program says one event a line (`--json`). What the stage is known by is kept: the check, the scores, the files written.
A stage whose stage before failed is not run. A failure ends this attempt; the last attempt writes it down instead, so that
the other captures and the table go on.
"""

import argparse
import json
import subprocess
import sys
import time
from pathlib import Path


def events(log):
    """The events in a log; lines that are none are passed over."""
    found = []
    for line in log.read_text(errors="replace").splitlines():
        if line.startswith("{"):
            try:
                found.append(json.loads(line))
            except ValueError:
                pass
    return found


def of_kind(found, kind):
    return [event for event in found if event.get("event") == kind]


def result_of(stage, found):
    """What the table and the next stages need of a stage."""
    if stage == "check":
        checks = of_kind(found, "check")
        check = checks[-1] if checks else {}
        return {key: check.get(key) for key in ("understood", "ask", "agreement", "light", "findings")}
    if stage == "fit":
        ended = of_kind(found, "finished")
        return {"aggregates": ended[-1].get("aggregates"), "timings": ended[-1].get("timings")} if ended else {}
    if stage == "relight":
        return {"pictures": [event["path"] for event in of_kind(found, "written") if "path" in event]}
    return {"aggregates": of_kind(found, "aggregate")}


def told(error):
    """The message of an error, with its place in front."""
    place, message = error.get("place", ""), error.get("message", "")
    return f"{place}: {message}" if place and place not in message else message


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("stage", choices=["check", "fit", "relight", "score"])
    parser.add_argument("--capture")
    parser.add_argument("--output", type=Path, required=True)
    parser.add_argument("--log", type=Path, required=True)
    parser.add_argument("--run", type=Path)
    parser.add_argument("--check", type=Path, help="the result of the stage before")
    parser.add_argument("--attempt", type=int, default=1)
    parser.add_argument("--attempts", type=int, default=1)
    # What stands behind `--` is the program with its arguments.
    cut = sys.argv.index("--") if "--" in sys.argv else len(sys.argv)
    options, command = parser.parse_args(sys.argv[1:cut]), sys.argv[cut + 1 :]

    def write(result):
        options.output.parent.mkdir(parents=True, exist_ok=True)
        part = options.output.with_suffix(".part")
        part.write_text(json.dumps(result, indent=1))
        part.replace(options.output)

    if options.check is not None:
        before = json.loads(options.check.read_text())
        if before.get("status") != "done":
            write({"status": "skipped", "message": f"the stage before {before.get('status')}"})
            return 0
    if options.stage == "fit" and (options.run / "checkpoint").exists():
        # Killed on the way: the same bits as without.
        start = command.index("fit")
        command = command[:start] + ["resume", str(options.run), "--scene", options.capture]
    options.log.parent.mkdir(parents=True, exist_ok=True)
    began = time.monotonic()
    with options.log.open("w") as log:
        ended = subprocess.run(command, stdout=log, stderr=subprocess.STDOUT, check=False)
    found = events(options.log)
    result = {"seconds": round(time.monotonic() - began, 1), "attempt": options.attempt, **result_of(options.stage, found)}
    if ended.returncode == 0:
        write({"status": "done", **result})
        return 0
    errors = of_kind(found, "error") or of_kind(found, "failed")
    message = told(errors[-1]) if errors else f"ended with code {ended.returncode}, see {options.log}"
    remedy = errors[-1].get("remedy", "") if errors else ""
    print(f"{options.stage} of {options.capture or options.run}: {message} ({remedy})", file=sys.stderr)
    if options.attempt < options.attempts:
        return 1
    write({"status": "failed", "message": message, "remedy": remedy, **result})
    return 0


if __name__ == "__main__":
    sys.exit(main())
