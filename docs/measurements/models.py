"""Processor time and memory of default pictures, and the memory that `lumbre info` predicts.

python3 docs/measurements/models.py [--lumbre PROGRAM] [--pictures FOLDER] MODEL...

Prints a table in Markdown. Each model is rendered as `lumbre render MODEL` does, with two threads.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path


def measured(command: list[str]) -> tuple[float, float, float]:
    """Seconds by the clock, processor seconds, and the peak of memory in MiB."""
    start = time.monotonic()
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    if status != 0:
        sys.exit(f"{' '.join(command)} failed")
    return time.monotonic() - start, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024


def predicted(lumbre: str, model: Path) -> float:
    """The memory that `lumbre info` predicts, in MiB."""
    told = subprocess.run([lumbre, "info", "--json", model], capture_output=True, check=True, text=True)
    return json.loads(told.stdout)["picture"]["memory_bytes"] / 2**20


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--lumbre", default="lumbre", help="the program")
    parser.add_argument("--pictures", type=Path, help="keep the pictures in this folder")
    parser.add_argument("models", nargs="+", type=Path, metavar="MODEL")
    options = parser.parse_args()
    print("| model | seconds | processor seconds | memory, MiB | predicted, MiB |")
    print("|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as scratch:
        for model in options.models:
            picture = (options.pictures or Path(scratch)) / f"{model.stem}.png"
            command = [options.lumbre, "render", str(model), "-o", str(picture), "-q", "--threads", "2"]
            clock, processor, memory = measured(command)
            expected = predicted(options.lumbre, model)
            print(f"| {model.name} | {clock:.1f} | {processor:.1f} | {memory:.0f} | {expected:.0f} |", flush=True)


if __name__ == "__main__":
    main()
