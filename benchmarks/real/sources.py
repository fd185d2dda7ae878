"""Where the recordings of the bench are published, and which rigs are set apart."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from fnmatch import fnmatch
from typing import Literal

Licensed = Literal["free", "in place"]
"""A cut may be shipped; to be read in place only."""
Half = Literal["development", "apart", "second"]

SENTENCE = "the apart half is not looked at before the method stands: 2026-11-23"
"""Decides by lot, together with a rig's name, which rigs are set apart."""


@dataclass(frozen=True)
class Source:
    """The files of one rig: a public repository at a commit, and patterns of the paths that are read."""

    rig: str
    repository: str
    commit: str
    licence: str
    licensed: Licensed
    patterns: tuple[str, ...]

    def holds(self, path: str) -> bool:
        """Whether a path of the repository is one of those that are read."""
        return any(fnmatch(path, pattern) for pattern in self.patterns)

    @property
    def published(self) -> str:
        """Where the files are found, in words."""
        return f"repository {self.repository}, commit {self.commit}"


_FRICTION = "results_pneumatic-actuator/data"
_AIR = "Sensor_Test/Temperatur_and_Humidity"
_BOX = "software/incubator/datasets"

SOURCES: tuple[Source, ...] = (
    Source("odrive", "gchenfc/ODrive", "54611550", "MIT", "free", (
        "analysis/cogging_torque/slow2/*.npy", "analysis/cogging_torque/slow2_slower/*.npy",
        "analysis/cogging_torque/coggingmap_0/*.npy", "analysis/cogging_torque/notes.md", "LICENSE*")),
    Source("rosa", "mrl-anomaly/RoSA-data-archive-for-fault-anomaly-detection", "1a46e4a", "BSD-3-Clause", "free", (
        "*.csv", "*README.md", "LICENSE*")),
    Source("pneumatic", "EvaZillen/3D-printed-pneumatic-actuator", "6e0bcb4", "CC0-1.0", "free", (
        f"{_FRICTION}/friction/*.csv", f"{_FRICTION}/repeatability/*/friction/*.csv", "*README.md", "LICENSE*")),
    Source("probe_drift", "grumat/voron-trident-250_config", "93523e9", "MIT", "free", (
        "z-probe_benchmark/data/*.json", "z-probe_benchmark/ReadMe.md", "LICENSE*")),
    Source("cart_pendulum", "dynamicslab/MultiArm-Pendulum", "e99a7e1", "MIT", "free", (
        "ParameterEstimation/SinglePendulum/*ForParameterEstimation.mat", "LICENSE*")),
    Source("anti_cogging", "heitor-andrade/laas_anti_cogging", "eb0391d", "BSD-3-Clause", "free", (
        "codes/Testing/speed_data/speed_test*.txt", "codes/Mapping/stopped_data/*.txt", "README.md", "LICENSE*")),
    Source("f16", "wilsonrljr/sysidentpy-data", "7271536", "MIT", "free", (
        "datasets/f_16_vibration_test/*.txt", "LICENSE*")),
    Source("quarter_drone", "helonayala/sysid", "3802c64", "Unlicense", "free", (
        "data/quarter_drone/*.csv", "data/README.md", "LICENSE*")),
    Source("ball_hoop", "helonayala/sysid", "3802c64", "Unlicense", "free", (
        "data/ball_and_hoop/*.mat", "data/README.md", "LICENSE*")),
    Source("bridge", "imcs-compsim/munich-bridge-data", "f1057c1", "MIT", "free", (
        "ReferenceState/*.zip", "Settlements/*.zip", "README.md", "LICENSE*")),
    Source("incubator", "INTO-CPS-Association/example_digital-twin_incubator", "2f08c4f", "none", "in place", (
        f"{_BOX}/*.csv", f"{_BOX}/*.md", f"{_BOX}/*.yaml")),
    Source("station", "markus1203/MoBiMet", "2c43d72", "none", "in place", (
        f"{_AIR}/Data/*.csv", f"{_AIR}/readme.md", f"{_AIR}/ClimateChamber/readme.md")),
    Source("bath", "QuentinRauschenbach/Temperature_Logger", "aee1916", "none", "in place", (
        "data/*", "README.md")),
    Source("two_pendulums", "Prof-Carter/book_ip", "7d5e476", "none", "in place", (
        "mfiles/p1c3/*_pend_data.mat",)),
    Source("telescope", "metalglove/astro-guiding-performance", "28c5ba4", "none", "in place", (
        "web/agp/public/data/PHD2_GuideLog*.txt",)),
    Source("cart_rail", "nielsSkov/masterThesisMatlab", "0e2c725", "none", "in place", (
        "parameterEstimation/data/cartTest2/*.csv", "parameterEstimation/data/pend1test/*.csv")),
    Source("water_loop", "waico/SKAB", "b2c0d46", "GPL-3.0", "in place", (
        "data/*.csv", "data/README.md")),
    Source("friction_damper", "ARTS-Laboratory/Dataset-Friction-Damper-with-Backlash", "0e09aa9", "CC-BY-SA-4.0",
        "in place", ("data/*.json", "README.md")),
    Source("ball_beam", "helonayala/bab_datasets", "584399a", "none", "in place", ("data/*.mat", "README.md")),
    Source("bottle_tank", "SimonEnsemble/tank_inverse_problem", "d6aca89", "none", "in place", (
        "data/*.csv", "README.md")),
    Source("servo_play", "roboninecom/Measuring-Backlash-in-Popular-UART-Servos", "5273b56",
        "CC-BY-4.0 (documents), GPL-3.0 (software); logs not named", "in place", (
        "logs/*.csv", "README.md")),
    Source("heated_rod", "KeenanMcConkey/ENPH257-lab-heattransport", "24ea0df", "none", "in place", (
        "Data/*.csv", "README.md")),
    Source("heated_bar", "KaiTaiTong/AlBarHeatingSimulation", "42fdd51", "none", "in place", ("*Data*", "README.md")),
)  # fmt: skip

_JOINTS = "longshike/NNFM-A-Novel-Neural-Network-Modeling-Approach-for-Robot-Flexible-Joints-Friction"

SECOND: tuple[Source, ...] = (
    Source("magnetic_damper", "labcontrol-data/mr-damper", "e42439f", "MIT", "free", (
        "data/ensaio*.mat", "README.md", "LICENSE")),
    Source("electric", "labcontrol-data/rlc-oscillator", "5afe23f", "MIT", "free", (
        "data/20221130-0001_0[1-6].mat", "README.md", "LICENSE")),
    Source("rotary_pendulum", "jensen-benard/rotary-inverted-pendulum", "1f3bb80", "MIT", "free", (
        "software/modelling/experiment/damping_coefficient/*.txt", "*README.md", "LICENSE")),
    Source("franka", _JOINTS, "a343d3a", "none", "in place", (
        "Comparative data/Franka Robot/case[34]_*.csv", "README.md")),
    Source("fairino", _JOINTS, "a343d3a", "none", "in place", ("Comparative data/FAIRINO Robot/*.csv", "README.md")),
    Source("temperature_lab", "FNR13/TCLab-Predictive-Control", "87a1c44", "none", "in place", (
        "Code/P3/matfiles/openloop_data_*.mat", "README.md")),
    Source("two_motors", "malik-robert/HSM150-data", "35c3b1b", "none", "in place", (
        "Data/Identification/*.mat", "README.md")),
    Source("lab_pendulum", "y-fysiks/PHY180-Pendulum-datafit", "607a0fa", "none", "in place", ("data3[123].csv",)),
    Source("hydraulic", "luishpinto/cm-hydraulic-data-set", "91199ae", "none (UCI 447: CC BY 4.0)", "in place", (
        "TS[12].txt", "profile.txt", "README.md")),
    Source("cooled_water", "mpc-physical-science/projects", "5165d22", "none", "in place", ("labs-testing/cooling/*",)),
    Source("exchanger", "Rafa7046/Non_Linear_Identification", "e5c9b00", "none (DaISy)", "in place", (
        "src/data/exchanger.csv", "README.md")),
    Source("flexible_arm", "Rafa7046/Non_Linear_Identification", "e5c9b00", "none (DaISy)", "in place", (
        "src/data/robot-arm.csv", "README.md")),
    Source("servo", "mauicv/servo-sysid", "e4a4840", "none", "in place", ("src/sysid/dataset/*.json", "README.md")),
    Source("hobby_servo", "spfrommer/servo-experiment", "8d48684", "none", "in place", (
        "processed/*.txt", "README.md")),
    Source("weather_loggers", "orestispanago/Hobo-cal", "30aa6b6", "none", "in place", ("raw/*.csv", "README.md")),
)  # fmt: skip
"""Rigs of a second exam: declared and asked once on 2026-11-27, by somebody who had not seen the method made."""

KNOWN: tuple[str, ...] = ("emps", "silverbox", "cascaded_tanks", "ace_thermal", "spindle46")
"""Rigs that were looked at while the program was made: never apart."""
SHIPPED = ("emps",)
"""Recordings that come with the package."""


def halves() -> dict[str, Half]:
    """Rig → half, by lot: of the rigs with and without a licence to ship, each time the first half by SHA-256."""
    found: dict[str, Half] = dict.fromkeys(KNOWN, "development")
    for licensed in ("free", "in place"):
        rigs = sorted((one.rig for one in SOURCES if one.licensed == licensed), key=_lot)
        first = (len(rigs) + 1) // 2
        found |= {rig: "development" if k < first else "apart" for k, rig in enumerate(rigs)}
    found |= dict.fromkeys((one.rig for one in SECOND), "second")
    return found


def _lot(rig: str) -> str:
    return hashlib.sha256(f"{SENTENCE}: {rig}".encode()).hexdigest()
