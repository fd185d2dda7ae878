"""The recipe that makes a recording of Klipper's log."""

from __future__ import annotations

import io
import re
from pathlib import Path

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "how-to" / "correct-a-printer.md").read_text(encoding="utf-8")
# as klippy/klippy.py, extras/statistics.py, heaters.py, temperature_sensor.py and probe.py of Klipper write them
LOG = """\
Configured MCU 'mcu' (1024 moves)
Stats 100.2: gcodein=0  mcu: mcu_awake=0.001 bytes_write=5 heater_bed: target=60 temp=25.0 pwm=1.000 frame: temp=20.1 x
Stats 101.2: gcodein=0  heater_bed: target=60 temp=25.4 pwm=1.000 frame: temp=20.1 extruder: target=0 temp=-3.1
probe: at 100.000,100.000 bed will contact at z=0.500000
Stats 102.2: gcodein=0  heater_bed: target=60 temp=25.9 pwm=1.000
probe at 100.000,100.000 is z=0.530000
Result is z=0.530000
Stats 103.2: gcodein=0  heater_bed: target=60 temp=26.3 pwm=1.000 frame: temp=20.2
probe: at 20.000,20.000 bed will contact at z=0.712500
probe: at 180.000,20.000 bed will contact at z=0.287500
Stats 104.2: gcodein=0  heater_bed: target=60 temp=26.6 pwm=1.000 frame: temp=20.2
probe: at 100.006,100.000 bed will contact at z=0.541000
Result: at 100.006,100.000 estimate contact at z=0.540000
probe: at 100.000,180.000 bed will contact at z=0.900000
Stats 105.2: gcodein=0  heater_bed: target=60 temp=26.8 pwm=1.000 frame: temp=20.3
"""


def test_the_recipe_reads_what_klipper_writes():
    (recipe,) = re.findall(r"```python test\n(.*?)```", PAGE, re.DOTALL)
    names = {}
    exec(compile(recipe, "recipe", "exec"), names)
    out = io.StringIO()
    names["csv_of_klippy_log"](io.StringIO(LOG), ["frame", "heater_bed", "extruder"], out)
    assert out.getvalue().splitlines() == [
        "time_s,frame [°C],heater_bed [°C],extruder [°C],Z [µm]",
        "100.2,20.1,25.0,,",
        "101.2,20.1,25.4,-3.1,",
        "102.2,,25.9,,0.0",
        "103.2,20.2,26.3,,-30.0",
        "104.2,20.2,26.6,,",  # a mesh
        "105.2,20.3,26.8,,-40.0",
    ]
