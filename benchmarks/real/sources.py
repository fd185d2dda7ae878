"""Where the recordings of the bench are published, and which rigs are set apart."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from fnmatch import fnmatch
from typing import Literal

Licensed = Literal["free", "in place"]
"""A cut may be shipped; to be read in place only."""
Half = Literal[
    "development", "apart", "second", "third", "fourth", "fourth-apart", "fifth", "fifth-apart", "sixth", "sixth-apart",
    "seventh", "seventh-apart", "eighth", "eighth-apart",
]  # fmt: skip

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

_LAB = "ARTS-Laboratory"
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

THIRD: tuple[Source, ...] = (
    Source("throttle", "labcontrol-data/vehicleCAN", "42d5438", "MIT", "free", (
        "data/dataIdentificatinThrottle_*20-Feb-2016_15h[678]m.mat", "README.md", "LICENSE")),
    Source("open_arm", "YIZHIXIAOCANGSHU/Friction-Identification-for-Manipulators", "f915751", "none", "in place", (
        "results/real_uart_capture.npz", "results/real_uart_capture_collect_joint_[367].npz", "README.md")),
    Source("surgical_arm", "liamjosephnolan/thesis_matlab", "45553c7", "none", "in place", (
        "pitch_prbs_response/old/prbs_roll_0_pitch_0.csv", "pitch_prbs_response/prbs_roll_0_pitch_0.csv",
        "pitch_prbs_response/prbs_roll_20_pitch_0.csv", "prbs_pitch_V5.csv", "README.md")),
    Source("eccentric", "nicolazande/camber-control", "cb9a8f8", "none", "in place", (
        "actuators/EccA/data/load-square-wave-*.txt", "README.md")),
    Source("rotation_servo", "amantiwary10/Servo-Motor-System-Identification", "e66bd1f", "none", "in place", (
        "Data/Optical Probe/*Clock/T*/StepsTest_*.csv", "README.md")),
    Source("dipped_probe", "linnil1/2017_BIME_sensor", "2f0e4c1", "none", "in place", (
        "lab05/lab05log*.txt", "lab05/README.md")),
    Source("orbit_computer", "TiansuanConstellation/MobiCom24-SatelliteCOTS", "951b415", "none", "in place", (
        "Temperature-HeatingRate/Data/gnd_pi_stress_and_infer/*.csv", "Temperature-HeatingRate/README.md",
        "Temperature-HeatingRate/Data/sat_pi_stress_and_infer/PiA_Sun_[123]C_*.csv")),
    Source("printer_bed", "lahn92/voron2.4", "b08c5a0", "none", "in place", (
        "logs/klippy.log", "logs/klippy.log.2024-07-17")),
    Source("machine_growth", "ruoheng-du/thermal-expansion-error-prediction", "6dc3d29", "none", "in place", (
        "data/thermal expansion error original.csv", "README.md", "lr_minitab/README.md")),
    Source("cell", f"{_LAB}/dataset-electrothermal-deformation-characterization-for-samsung-30Q-cell", "4e9effd",
        "CC-BY-SA-4.0", "in place", ("data/S00[13]/Q30_*.csv", "README.md", "data/HPPC*/README.md")),
    Source("cycled_cell", f"{_LAB}/dataset-cycling-with-strain-monitoring-for-samsung-30Q-cell", "ddd7cf0",
        "CC-BY-SA-4.0", "in place", (
        "data/Dataset-2/cell1/discharge/discharge_1_6[0-9].lvm", "data/Dataset-2/README.md")),
    Source("steam_rod", "Electw/Thermal-expansion-lab-graphs", "cc55f91", "none", "in place", (
        "Lab 1 Pasco Data*.csv",)),
    Source("sensor_package",
        f"{_LAB}/Paper--ARTS-Laboratory-Paper-Non-linear-vibration-signal-compensation-technique", "28f1db6",
        "CC-BY-SA-4.0", "in place", (
        *(f"data/Benchtop Test V2/Train Sweep/{band}*.csv" for band in ("1-2", "5-6", "10-11", "0-20")), "README.md")),
    Source("shaken_board", "High-Rate-SHM-Working-Group/Dataset-7-forced-vibration-and-shock", "81e7be7",
        "CC-BY-SA-4.0", "in place", (
        *(f"data/testset-B/amplitude_{path}.lvm" for path in (
            "1/Impact_0.0/vibration_0.6", "3/Impact_0.5/vibration_0.3", "3/Impact_0.0/vibration_0.6",
            "3/Impact_0.0/vibration_1")), "data/testset-B/readme.md")),
    Source("driven_beam", "PujaChowdhury/Dataset-4-Univariate-signal-with-non-stationarity", "06a0d36",
        "CC-BY-SA-4.0", "in place", (
        "data/data_I/test_[123]/data_set_[123]_downsampled_by_32.lvm", "README.md", "modal_analysis/README.md")),
)  # fmt: skip
"""Rigs of a sixth exam: declared on 2026-11-28 by somebody who had not read the method, committed, then asked once."""

_SHIELD, _SHIELD_TERMS = "gergelytakacs/AutomationShield", "CC-BY-NC-ND-4.0"
_MATLAB = "matlab/examples"

FOURTH: tuple[Source, ...] = (
    Source("odrive_chirp", "labmrd/odrive-with-motor-characterization", "73efb9b", "MIT", "free", (
        "docs/motor_characterization_references/demo_data/*.csv", "LICENSE*")),
    Source("rack_pinion", "KonradMnich/friction-identification", "8b477df", "none", "in place", (
        "input/sample_workspace_4.mat", "README.md", "manual.md")),
    Source("balance_car", "dongdaming1966/mcar_simulate", "c0ab509", "none", "in place", (
        "data/10_22_[1234].dat", "data/readme.txt")),
    Source("micromouse", "opatiny/micromouse", "fb04095", "none", "in place", (
        "matlab/data/wheelSpeedCalibration[24].csv", "matlab/data/README.md")),
    Source("moto_shield", _SHIELD, "bc0778f", _SHIELD_TERMS, "in place", (
        f"{_MATLAB}/MotoShield/*.mat", "LICENSE*")),
    Source("thrust_stand", "noahcurtiss/Motor_Tests", "37c3f9d", "none", "in place", (
        "robbe/*.txt", "python_scripts/analysis.py", "README.md")),
    Source("link_shield", _SHIELD, "bc0778f", _SHIELD_TERMS, "in place", (
        f"{_MATLAB}/LinkShield/resultID.mat", "LICENSE*")),
    Source("aero_shield", _SHIELD, "bc0778f", _SHIELD_TERMS, "in place", (
        f"{_MATLAB}/AeroShield/*_Data.mat", "LICENSE*")),
    Source("bob_pendulum", "DavidW99/Damping_Oscillator", "5b8248c", "none", "in place", (
        "damping_angle.xlsx", "*.m", "README.md")),
    Source("rc_filter", "lorsi96/System-Identification-Control-for-RCRC-Circuit", "0a55e58", "MIT", "free", (
        "csvs/ls_output_data.csv", "README.md", "LICENSE*")),
    Source("heat_shield", _SHIELD, "bc0778f", _SHIELD_TERMS, "in place", (
        f"{_MATLAB}/HeatShield/resultID*.mat", "LICENSE*")),
    Source("heat_pad", "PubInv/moonrat", "fd118d0", "AGPL-3.0", "in place", (
        "moonratII/heat_data/ALUM_cont.txt", "README.md", "LICENSE*")),
    Source("fermenter", "joaopsl/CervejasNucleares_2017", "a83a1bf", "none", "in place", ("Modelos/*.csv",)),
    Source("cell_18650", "isaiasBessa97/ncr18650_identification", "915b47b", "none", "in place", (
        *(f"dataset-thermal/BID*_{programme}_*.txt" for programme in (
            "RSDch", "DPDch", "CDch050.0", "CDch100.0")),)),
)  # fmt: skip
"""Rigs of a seventh exam: declared and asked by halves on 2026-11-29, by somebody who had not read the method."""

FOURTH_SENTENCE = "the seventh exam is asked by halves: 2026-11-29"
_KINDS = (
    ("odrive_chirp", "rack_pinion", "balance_car", "micromouse", "moto_shield", "thrust_stand"),
    ("link_shield", "aero_shield", "bob_pendulum", "rc_filter"),
    ("heat_shield", "heat_pad", "fermenter", "cell_18650"),
)
"""Drives, vibration and heat: half of each is set apart by lot."""

_STEPS = "Scilab/virtual_old"

FIFTH: tuple[Source, ...] = (
    Source("soccer_robot", "vhsabino/MATLAB", "bc6d16a", "none", "in place", (
        "sysid/INPUT_[1-4]_28_07_19.csv", "sysid/M[1-4]_[1-4]_28_07_19.csv", "sysid/DATA_AIR_1ms_08_10_19.csv",
        "sysid/PWMtoRad.m")),
    Source("motor_kit", "thuxrife/FRA233_Lab1_G04", "437e24b", "none", "in place", (
        "PART2_studyV4/*_Raw.mat", "PART2_studyV3_12V/part2_Step_*_Raw.mat", "PART2_data_sync.m", "README.md")),
    Source("made_spring", "harrislab-brown/CyberDiver", "85fb9d6", "CC-BY-SA-4.0", "in place", (
        "data/validation/static_force_test_*n_threshold.csv", "data/README.md")),
    Source("tank_pair", "antoniocamposeo/LQI-and-PID-Control-for-Two-Tanks-Real-Plant-System", "c15aa5e", "none",
        "in place", ("System_identification/SYS_IDENT.csv", "README.md")),
    Source("ruler_robot", "ryanGT/systemid", "fbfab37", "none", "in place", ("example/2009-04-21/*.txt",)),
    Source("hung_payload", "turtler12/pendulum-seismic-isolation", "d2474b4", "none", "in place", (
        "Medha_sum_displacements*.csv", "README.md")),
    Source("heater_board", "rupakrokade/sbhs-manual", "5aad482", "none", "in place", (
        f"{_STEPS}/prbs_analysis/prbs.txt", f"{_STEPS}/Ramp_Analysis/29Apr2014_14_32_06.txt")),
    Source("discharged_cell", "LTrussardi/Electrothermal-Characterization-of-Li-ion-Battery-Cells", "13eee02",
        "GPL-3.0", "in place", (
        *(f"{test}/{name}_Profile.mat" for test in (
            "01 - Constant Current Discharge Test", "03 - Random Walk Test") for name in ("Current", "Temperature")),
        "README.md")),
    Source("infrared_cell", "Battery-Intelligence-Lab/battery-thermal-characterisation", "65bd501", "BSD-2-Clause",
        "free", ("Exp.mat", "Th.txt", "readme.md", "LICENSE*")),
    Source("water_cup", "myphysicslabathome/Water-Cooling-Curve", "e9d5ef9", "none", "in place", (
        "Water Cooling With*.dat", "README.md")),
    Source("two_rooms", "codesob/sml2010", "363f4a46", "none (UCI 274: CC BY 4.0)", "in place", (
        "data/NEW-DATA-1.T15.txt",)),
    Source("straw_house", "tylim2946/BCIT", "e99ea1c", "Apache-2.0; data of a course", "in place", (
        "ELEX4336-Feedback-Systems/Lab05/temps.mat", "ELEX4336-Feedback-Systems/Lab05/*.m", "LICENSE*")),
)  # fmt: skip
"""Rigs of an eighth exam: declared on 2026-11-29 by somebody who had not read the method, before they were asked."""

FIFTH_SENTENCE = "the eighth exam is asked by halves: 2026-11-29"
_FIFTH_KINDS = (
    ("soccer_robot", "motor_kit", "made_spring", "tank_pair"),
    ("ruler_robot", "hung_payload"),
    ("heater_board", "discharged_cell", "infrared_cell", "water_cup", "two_rooms", "straw_house"),
)

_CONTSID = "Atividade05/matlab/Contsid/Contsid7_3"
_PHONE = "Ann_Arbor_experiment/experiment1/5g_data_2"

SIXTH: tuple[Source, ...] = (
    Source("excavator", "mitchallain/BeagleBone-excavator", "331760d", "none", "in place", (
        "tests/data/manual_*110[12]*.csv", "README*")),
    Source("winder", "prj-phcp/SYSID_Atividades", "766c065", "none (CONTSID toolbox, DaISy)", "in place", (
        f"{_CONTSID}/contsid_winding.*",)),
    Source("load_cells", "mvsivaselvan/CIE324-Swing-Project", "18a8bc8", "MIT", "free", (
        "calibration/loadCellCal*", "calibration/*.txt", "README.md", "LICENSE*")),
    Source("speed_servo", "mohsenzahmatkesh/DC-motor-identification", "e0828fd", "none", "in place", (
        "python/velocity_feedback_comparison.csv", "README.md")),
    Source("buck_converter", "wilsonrljr/sysidentpy-data", "7271536", "MIT", "free", (
        "datasets/buck/*.csv", "LICENSE*")),
    Source("pilot_crane", "prj-phcp/SYSID_Atividades", "766c065", "none (CONTSID toolbox)", "in place", (
        f"{_CONTSID}/crane.mat", f"{_CONTSID}/contsid_crane.m")),
    Source("resonant_circuit", "nightlan1015297/Week_8_experiment", "4efcce7", "none", "in place", (
        "RLC_R_993.9/*.CSV", "README.md")),
    Source("toy_tower", "PiyushChoudhary-Git/Tuned-Mass-Damper", "fe6f6bb", "none (academic use)", "in place", (
        "CSV files/*.csv", "README.md")),
    Source("hot_phone", "KingsleyXW/Power-and-Thermal-Models-for-Optimal-Non-Throttling-Performance", "0b30fb4", "none",
        "in place", (*(f"{_PHONE}_{k}thread_*.txt" for k in (3, 4, 5, 6)), "README.md")),
    Source("random_cell", "Silencefrog9305/Digital-Twins-for-Battery-Using-CTA-MTL", "ec0fe7c", "MIT", "free", (
        "Exp25_R1.mat", "README.md", "LICENSE*")),
    Source("lecture_rooms", "rujia-L/grey-box-thermal-modeling-sde", "e0639de", "none", "in place", (
        "Dataset/AllDat.csv", "README.md")),
    Source("passive_house", "LuisM78/Reconstruction_of_indoor_temperatures", "81e0f93", "none", "in place", (
        "energy_weather_temp.zip", "README.md")),
)  # fmt: skip
"""Rigs of a ninth exam: declared on 2026-11-30 by somebody who had not read the method, before they were asked."""

SIXTH_SENTENCE = "the ninth exam is asked by halves: 2026-11-30"
_SIXTH_KINDS = (
    ("load_cells", "resonant_circuit", "toy_tower", "hot_phone"),
    ("excavator", "winder", "buck_converter", "speed_servo"),
    ("pilot_crane",),
    ("random_cell", "lecture_rooms", "passive_house"),
)
"""Rigs with controls; of the others drives, vibration and heat: half of each is set apart by lot."""

_DFKI = "dfki-ric-underactuated-lab"
_LABS = "anpar/autolin"
_SYSID = "Allen-wyson/epfl-sysid"

SEVENTH: tuple[Source, ...] = (
    Source("lab_motor", _LABS, "c1bbe1a", "none", "in place", ("labo2/src/data/*.txt", "README.md")),
    Source("driven_pendulum", f"{_DFKI}/torque_limited_simple_pendulum", "ed17ea2", "BSD-3-Clause", "free", (
        "results/control_method_sac/data_*.csv", "results/control_method_energy_shaping/data_*.csv",
        "results/control_method_gravity_compensation/data_*.csv", "LICENSE*", "README.md")),
    Source("double_pendulum", f"{_DFKI}/double_pendulum", "1e8544e", "BSD-3-Clause", "free", (
        "data/experiment_records/design_A.0/20220815/sys_id/trajectory_0[012].csv",
        "data/experiment_records/design_A.0/20220815/sys_id/trajectory_1[23].csv",
        "data/experiment_records/design_A.0/20220815/noise/velocity_measurement/*.csv", "LICENSE*", "README.md")),
    Source("direct_drive", "jorgevchin/Friction-Identification", "d455ff8", "none", "in place", (
        "Test 2/cin_*_exp_gan.t", "README.md")),
    Source("office_tower", "eunchurn/system-identification-unison-tower-matlab", "a0655e6", "none", "in place", (
        "wn_*.dat", "README.md")),
    Source("laser_beam", _SYSID, "48ac1c1", "none", "in place", ("matlab/ce2/laserbeamdataN.mat", "README*")),
    Source("active_suspension", _SYSID, "48ac1c1", "none", "in place", ("matlab/ce2/CE2.mat", "README*")),
    Source("two_capacitors", _LABS, "c1bbe1a", "none", "in place", ("labo3/src/data/*.txt", "README.md")),
    Source("roaster", "scottjames/coffee-roasting", "f797287", "MIT", "free", (
        "logs/roast_25-10-11*.alog", "logs/roast_26*.alog", "LICENSE*", "README.md")),
    Source("hot_water", "Tang1001/Heat_pump", "0777f6c", "none", "in place", ("Data/week 13*.csv",)),
    Source("solar_plant", "pvlib/pvanalytics", "06fd596", "MIT", "free", (
        "pvanalytics/data/nrel_RSF_II.csv", "LICENSE*", "README*")),
)  # fmt: skip
"""Rigs of a tenth exam: declared on 2026-11-30 by somebody who had not read the method, before they were asked."""

SEVENTH_SENTENCE = "the tenth exam is asked by halves: 2026-11-30"
_SEVENTH_KINDS = (
    ("driven_pendulum", "double_pendulum"),
    ("laser_beam", "active_suspension", "two_capacitors"),
    ("lab_motor", "direct_drive"),
    ("office_tower", "roaster", "hot_water", "solar_plant"),
)
"""Drives with controls, and what else has some; of the others drives, and vibration with heat: half of each is set
apart by lot."""

_DAISY = "robotsorcerer/FARNN"
_COURSE = "chewy441014/mae277_assign2"

EIGHTH: tuple[Source, ...] = (
    Source("current_heater", "Himsh1216/python-heater", "83a4a2f", "none", "in place", (
        "temperature_log.csv", "app.py")),
    Source("three_thermometers", "jad507/OGRE_lab", "89794b5", "none", "in place", (
        "temperature/temperature_log2.csv", "temperature/temperature_logger2.py", "README.md")),
    Source("loaded_oven", "Wontfallo/oven-temp-visual", "29a02b6", "none", "in place", ("ovenData.csv",)),
    Source("heated_box", "dhill2522/ChE436-project", "7ebdc16", "MIT", "free", (
        "step_test.csv", "no_deriv.csv", "first_run_data.csv", "final_real_run.csv", "LICENSE*", "README.md")),
    Source("brick_wall", _DAISY, "9cfb82f", "none (DaISy)", "in place", (
        "data/thermic_res_wall.dat", "data/datasets.m")),
    Source("glass_furnace", _DAISY, "9cfb82f", "none (DaISy)", "in place", (
        "data/glassfurnace.dat", "data/datasets.m")),
    Source("shaking_table", "labcontrol-data/randomized_LPV_shakingTable", "2bedde8", "MIT", "free", (
        "data/Sine*.mat", "data/Square*.mat", "LICENSE*", "README.md")),
    Source("chirped_motor", _COURSE, "fb27d3f", "none", "in place", (
        "data/id_data/[123].txt", "README.md", "system_id.m")),
    Source("hung_pendulum", _COURSE, "fb27d3f", "none", "in place", (
        "data/stb_pend_id/0.1_2_0.1_10_[12].csv", "data/stb_pend_id/sine_*.csv", "README.md", "system_id.m")),
    Source("twisted_string", "hop9999/antagonist_setup", "a4a3e5c", "none", "in place", (
        "data/chirp5.csv", "scripts/*.py", "README.md")),
    Source("shuttle_car", "tonykhkim/System-Identification", "5546c8a", "none", "in place", (
        "gt[134]_forPython.mat", "README.md")),
    Source("magnet", "labcontrol-data/MagLev", "bf6431f", "MIT", "free", (
        "data/Proposed_PID.mat", "LICENSE*", "README.md")),
)  # fmt: skip
"""Rigs of an eleventh exam: declared on 2026-11-30 by somebody who had not read the method, before they were asked."""

EIGHTH_SENTENCE = "the eleventh exam is asked by halves: 2026-11-30"
_EIGHTH_KINDS = (
    ("shaking_table", "shuttle_car"),
    ("loaded_oven", "glass_furnace", "chirped_motor", "magnet"),
    ("twisted_string", "hung_pendulum"),
    ("current_heater", "heated_box", "three_thermometers", "brick_wall"),
)
"""Drives with controls, and what else has some; of the others drives with vibration, and heat: half of each is set
apart by lot."""

_PARTED: tuple[tuple[Half, Half, str, tuple[tuple[str, ...], ...]], ...] = (
    ("fourth", "fourth-apart", FOURTH_SENTENCE, _KINDS),
    ("fifth", "fifth-apart", FIFTH_SENTENCE, _FIFTH_KINDS),
    ("sixth", "sixth-apart", SIXTH_SENTENCE, _SIXTH_KINDS),
    ("seventh", "seventh-apart", SEVENTH_SENTENCE, _SEVENTH_KINDS),
    ("eighth", "eighth-apart", EIGHTH_SENTENCE, _EIGHTH_KINDS),
)
"""Sets of which half of each kind is set apart, by SHA-256 of a sentence and a rig's name."""

EVERY: tuple[Source, ...] = (*SOURCES, *SECOND, *THIRD, *FOURTH, *FIFTH, *SIXTH, *SEVENTH, *EIGHTH)

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
    found |= dict.fromkeys((one.rig for one in THIRD), "third")
    for first_half, apart, sentence, kinds in _PARTED:
        for kind in kinds:
            rigs = sorted(kind, key=lambda rig: _lot(rig, sentence))
            found |= {rig: first_half if 2 * k < len(rigs) else apart for k, rig in enumerate(rigs)}
    return found


def _lot(rig: str, sentence: str = SENTENCE) -> str:
    return hashlib.sha256(f"{sentence}: {rig}".encode()).hexdigest()
