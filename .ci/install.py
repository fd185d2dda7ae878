"""Installs what its arguments name with pip, and says every few seconds how far that is."""

import subprocess
import sys
import threading
import time
from pathlib import Path

SILENCE_S = 3.0
BEGUN = time.monotonic()
# modules are compiled when they are first used: compiling all of them takes longer than the demo
PIP = [sys.executable, "-m", "pip", "install", "--disable-pip-version-check", "--progress-bar", "off", "--no-compile"]
CONSTRAINTS = ["-c", str(Path(__file__).parent.parent / "constraints.txt")]

said = BEGUN
doing = "starting"


def say(text: str) -> None:
    """A line with the time since the beginning."""
    global said
    said = time.monotonic()
    print(f"  {said - BEGUN:4.0f} s  {text}", flush=True)


def keep_saying() -> None:
    """What is being done, where pip says nothing for some seconds."""
    while True:
        time.sleep(0.5)
        if time.monotonic() - said > SILENCE_S:
            say(f"{doing} …")


say("starting pip")
threading.Thread(target=keep_saying, daemon=True).start()
pip = subprocess.Popen([*PIP, *CONSTRAINTS, *sys.argv[1:]], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
kept, packages = [], 0
for line in pip.stdout or ():
    kept.append(line)
    word, _, rest = line.strip().partition(" ")
    if word == "Collecting":
        packages += 1
        doing = f"fetching {rest.partition(' ')[0].partition('<')[0].partition('>')[0].partition('=')[0]}"
    elif line.startswith("Installing collected packages"):
        doing = f"unpacking {line.count(',') + 1} packages"
    elif word == "Successfully":
        doing = "done"
if pip.wait() != 0:
    sys.exit("".join(kept[-40:]))
say(f"installed {packages} packages")
