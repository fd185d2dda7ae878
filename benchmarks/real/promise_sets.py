"""Published recordings of slow quantities, cut into runs, for `benchmarks/bench_real_promises.py`.

python -m benchmarks.real.promise_sets FOLDER CLONES

Writes a folder for every set: a CSV for each run, and a machine file. CLONES is that of `benchmarks.real.collect`; what
is not there is left out. Every input is declared as a temperature, the response as a displacement of ten micrometres a
unit: `select` asks for no other physics than that one follows the others. Inputs that are no temperatures are moved and
scaled to 20 ± 5 °C, by median and quartiles of all runs.
"""

from __future__ import annotations

import argparse
import hashlib
import io
import subprocess
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.bench_days import recording_of
from benchmarks.real.collect import clone_of
from benchmarks.real.sources import Source

FEWEST_ROWS = 12
MOST_RUNS, FIRST_RUNS = 70, 12
Table = pd.DataFrame
Runs = dict[str, Table]
Files = Callable[[str], bytes]
SENTENCE = "ten sets are not looked at before the method stands: 2026-11-30"
"""Decides by lot, together with a set's name, which of the new ones are set apart."""


@dataclass(frozen=True)
class Set:
    """A recording that was cut into runs."""

    name: str
    repository: str
    response: str
    runs: Callable[[Files, Callable[[], list[str]]], Runs]
    temperatures: tuple[str, ...] = ()  #: Beginnings of the names of inputs that are temperatures
    is_new: bool = True  #: Whether nobody had looked at it for this program

    @property
    def lot(self) -> str:
        """The smallest ten of the new ones are set apart."""
        return hashlib.sha256(f"{SENTENCE} {self.name}".encode()).hexdigest()


def csv(content: bytes, **options: object) -> Table:
    return pd.read_csv(io.BytesIO(content), **options)


def by_day(table: Table, every: str, days: int = 1) -> Runs:
    """Means over a period, cut at midnight, of a table with dates as index."""
    table = table.sort_index().resample(every).mean()
    number = (table.index.normalize() - table.index[0].normalize()).days // days
    return {f"{part.index[0]:%y%m%d}": part for _, part in table.groupby(number)}


def by_rows(table: Table, rows: int, period_s: float) -> Runs:
    """Pieces of a table without a clock."""
    pieces = [table.iloc[i : i + rows] for i in range(0, len(table) - rows + 1, rows)]
    return {f"p{k + 1:03d}": piece.set_index(np.arange(rows) * period_s) for k, piece in enumerate(pieces)}


def dated(table: Table, column: str, form: str | None = None, *, dayfirst: bool = False) -> Table:
    table.index = pd.to_datetime(table[column], format=form, dayfirst=dayfirst, errors="coerce")
    table = table.drop(columns=column).loc[table.index.notna()].apply(pd.to_numeric, errors="coerce")
    return table[~table.index.duplicated()]


def occupancy(read: Files, _: object) -> Runs:
    table = csv(read("Occupancy_Estimation.csv"))
    table["when"] = table.Date + " " + table.Time
    keep = ["when", *(f"S{k}_Temp" for k in (1, 2, 3, 4)), *(f"S{k}_Light" for k in (1, 2, 3, 4)), "S5_CO2"]
    table = dated(table[keep].copy(), "when", "%d-%m-%Y %H:%M:%S").resample("5min").mean()
    return {f"{part.index[0]:%m%dT%H}": part for _, part in table.groupby(table.index.floor("8h"))}


def transformer(which: int) -> Callable[..., Runs]:
    def runs(read: Files, _: object) -> Runs:
        return by_day(dated(csv(read(f"ETT-small/ETTh{which}.csv")), "date"), "1h", 7)

    return runs


def air_quality(read: Files, _: object) -> Runs:
    table = csv(read("AirQualityUCI.csv")).replace(-200, np.nan)
    table["when"] = table.Date + " " + table.Time
    keep = ["when", *(name for name in table.columns if name.startswith("PT08")), "T", "RH", "AH", "CO_GT"]
    return by_day(dated(table[keep].copy(), "when", "%d/%m/%Y %H:%M:%S"), "1h", 4)


def gas_turbine(read: Files, _: object) -> Runs:
    table = csv(read("gt_2011.csv"))
    table.columns = ["".join(word[0].upper() + word[1:] for word in name.split()) for name in table.columns]
    return by_rows(table.drop(columns=["CarbonMonoxide", "TurbineEnergyYield"]), 96, 3600.0)


def stations(read: Files, names: Callable[[], list[str]]) -> Runs:
    found = {}
    for path in names():
        if path.startswith("PRSA"):
            one = csv(read(path))
            when = pd.to_datetime(one[["year", "month", "day", "hour"]])
            found[path.split("_")[2]] = pd.Series(one.TEMP.to_numpy(), index=when)
    return by_day(pd.DataFrame(found).loc["2014-03-01":], "1h", 3)


def solar_plants(read: Files, _: object) -> Runs:
    parts = []
    for plant in (1, 2):
        one = csv(read(f"Plant_{plant}_Weather_Sensor_Data.csv"), skipinitialspace=True)
        one.columns = [name.strip() for name in one.columns]
        one = dated(one[["DATE_TIME", "AMBIENT_TEMPERATURE", "MODULE_TEMPERATURE", "IRRADIATION"]].copy(), "DATE_TIME")
        parts.append(one.set_axis([f"{name}{plant}" for name in ("Tair", "Tmodule", "Light")], axis=1))
    return by_day(pd.concat(parts, axis=1), "15min")


def hives(read: Files, names: Callable[[], list[str]]) -> Runs:
    tables = []
    for path in names():
        if "Hives/" in path and path.endswith(".csv"):
            one = dated(csv(read(path)).drop(columns=["Date", "Time"]), "DateTime", dayfirst=True)
            tables.append(one[[name for name in one.columns if name.startswith("Temp")]])
    table = pd.concat(tables, axis=1)
    table = table.loc[:, ~table.columns.duplicated()]
    table = table[[name for name in table.columns if "Box" in name or "Easy" in name or name == "Temp_260"]]
    return by_day(table, "1h", 3)


def room_climate(place: str) -> Callable[..., Runs]:
    def runs(read: Files, names: Callable[[], list[str]]) -> Runs:
        found = {}
        heads = ["entry", "ms", "s", "node", "T", "RH", "light1", "light2", "people", "activity", "door", "window"]
        for path in sorted(names()):
            if f"location_{place}-measurement" in path and path.endswith(".csv"):
                one = csv(read(path), header=None, names=heads, usecols=range(12)).apply(pd.to_numeric, errors="coerce")
                one = one[one.s.notna() & one.node.notna()]
                wide = one.pivot_table(index=(one.s // 20) * 20.0, columns="node", values=["T", "RH"])
                wide.columns = [f"{what}{int(node)}" for what, node in wide.columns]
                found[path[-6:-4]] = wide.interpolate(limit=3)
        return found

    return runs


def driven_car(read: Files, names: Callable[[], list[str]]) -> Runs:
    found, keep = {}, {
        "Battery Temperature": "Tbattery", "Ambient": "Tambient", "Coolant Temperature Heatercore": "Tcore",
        "Coolant Temperature Inlet": "Tinlet", "Heat Exchanger": "Texchanger", "Cabin Temperature Sensor": "Tcabin",
        "Velocity": "Speed", "Heating Power CAN": "Heating", "AirCon Power": "Cooling", "Battery Current": "Current",
    }  # fmt: skip
    for path in sorted(names()):
        if not path.startswith("dataset/Trip"):
            continue
        try:
            one = csv(read(path), sep=";", encoding="latin1")
        except subprocess.CalledProcessError:  # too large for the copy at hand
            continue
        said = {new: next((name for name in one.columns if name.startswith(old)), None) for old, new in keep.items()}
        if None in said.values():
            continue
        table = pd.DataFrame({new: pd.to_numeric(one[old], errors="coerce") for new, old in said.items()})
        found[path[-7:-4]] = table.groupby((one["Time [s]"] // 10) * 10.0).mean()
    return found


def town_power(read: Files, _: object) -> Runs:
    table = csv(read("Tetuan City power consumption.csv")).dropna(how="all")
    table.columns = ["when", "T", "RH", "Wind", "Zone1", "Zone2", "Zone3"]
    return by_day(dated(table, "when"), "30min", 4)


def building_1298(read: Files, _: object) -> Runs:
    table = dated(csv(read("data/building_1298.csv")), "datetime")
    return by_day(table.drop(columns=["precip_depth_1_hr", "cloud_coverage", "wind_direction", "m0"]), "1h", 7)


def lake(path: str, every: str, days: int) -> Callable[..., Runs]:
    def runs(read: Files, _: object) -> Runs:
        table = csv(read(path), sep="\t")
        return by_day(dated(table, table.columns[0]), every, days)

    return runs


def low_energy_house(read: Files, _: object) -> Runs:
    table = dated(csv(read("energydata_complete.csv")), "date", dayfirst=True)
    keep = [name for name in table.columns if name[0] == "T" and name != "Tdewpoint"]
    return by_day(table[[*keep, "Appliances", "RH_out", "Windspeed"]], "30min", 2)


def factory(read: Files, _: object) -> Runs:
    path = "heat_exchanger_control/scenarios/ETAFactory_HNHT_ScenarioData_LiveScenario.csv"
    table = dated(csv(read(path), sep=";", decimal=","), "Time (UTC)")
    table = table.loc[:, table.nunique() > 20]
    table.columns = ["".join(c if c.isalnum() else "_" for c in name) for name in table.columns]
    table = table.resample("10min").mean()
    return {f"{part.index[0]:%dT%H}": part for _, part in table.groupby(table.index.floor("6h"))}


def greenhouse(which: int) -> Callable[..., Runs]:
    def runs(read: Files, _: object) -> Runs:
        parts = []
        for name, short in (("Temp_4ch_1", "A"), ("Temp_4ch_2", "B"), ("Micro_1", "C"), ("TRH_1", "D"), ("TRH_2", "E")):
            one = dated(csv(read(f"Greenhouse_{which}/{name}.csv")).drop(columns="Read_NO"), "Timestamp", dayfirst=True)
            one = one[[column for column in one.columns if "Temperature" in column]]
            parts.append(
                one.set_axis([f"T{short}{k + 1}" for k in range(one.shape[1])], axis=1).resample("15min").mean()
            )
        table = pd.concat(parts, axis=1)
        table = table.where((table > -20.0) & (table < 70.0))
        return by_day(table.dropna(thresh=8), "15min", 2)

    return runs


def car_engine(read: Files, names: Callable[[], list[str]]) -> Runs:
    found, keep = {}, {
        "ENGINE_RPM": "Speed", "VEHICLE_SPEED": "Way", "ENGINE_LOAD": "Load", "COOLANT_TEMPERATURE": "Tcoolant",
        "INTAKE_MANIFOLD_PRESSURE": "Pressure", "INTAKE_AIR_TEMP": "Tintake",
        "CATALYST_TEMPERATURE_BANK1_SENSOR1": "Tcat1", "CATALYST_TEMPERATURE_BANK1_SENSOR2": "Tcat2",
        "CONTROL_MODULE_VOLTAGE": "Voltage",
    }  # fmt: skip
    for path in sorted(names()):
        if not any(path.startswith(f"obdiidata/{kind}") for kind in ("drive", "live", "long")):
            continue
        one = csv(read(path), index_col=False)
        one.columns = [name.split(" (")[0].strip() for name in one.columns]
        if set(keep) <= set(one.columns):
            table = one[list(keep)].apply(pd.to_numeric, errors="coerce").rename(columns=keep)
            table = table.groupby(np.arange(len(table)) // 10 * 10.0).mean()
            found[path.split("/")[1][:-4]] = table
    return found


def lathe(_: Files, __: object) -> Runs:
    shared = Path(__file__).resolve().parents[3] / "shared" / "data" / "ace_thermal"
    recording = recording_of(shared / "ACE_X.xlsx", shared / "ACE_Y.xlsx")
    return {run: recording.frame.loc[run].assign(Z=lambda table: table.Z / 10.0) for run in recording.runs}


def machine_growth(read: Files, _: object) -> Runs:
    table = csv(read("data/thermal expansion error original.csv"), encoding="utf-8-sig").rename(
        columns={"delta L": "dL"}
    )
    return by_rows(table.groupby(np.arange(len(table)) // 5).mean(), 60, 5.0)


def two_rooms(read: Files, _: object) -> Runs:
    heads = read("data/NEW-DATA-1.T15.txt").decode("latin1").splitlines()[0].replace("#", "").split()
    table = csv(read("data/NEW-DATA-1.T15.txt"), sep=r"\s+", skiprows=1, header=None)
    table.columns = [name.split(":", 1)[-1] for name in heads][: table.shape[1]]
    table["when"] = table.Date + " " + table.Time
    keep = [name for name in table.columns if name.startswith(("Temp", "CO2", "Hum", "Light", "Meteo", "when"))]
    table = dated(table[keep].copy(), "when", "%d/%m/%Y %H:%M")
    return by_day(table.loc[:, table.nunique() > 5], "15min")


def lecture_rooms(read: Files, _: object) -> Runs:
    return by_day(dated(csv(read("Dataset/AllDat.csv")).drop(columns="t"), "date"), "1h", 3)


def passive_house(read: Files, _: object) -> Runs:
    import zipfile

    with zipfile.ZipFile(io.BytesIO(read("energy_weather_temp.zip"))) as archive:
        table = dated(csv(archive.read("energy_weather_temp.csv"), skipinitialspace=True), "date")
    keep = [name for name in table.columns if name[0] == "T" and name != "Tdewpoint"]
    return by_day(table[[*keep, "Appliances", "RH_out"]], "30min", 2)


def loggers(read: Files, names: Callable[[], list[str]]) -> Runs:
    found = {}
    for path in sorted(names()):
        if path.startswith("raw/"):
            one = csv(read(path), encoding="utf-8-sig", usecols=[0, 1])
            one = dated(one, one.columns[0], "%d/%m/%Y %H:%M:%S")
            found[f"T{path[5:7]}"] = one.iloc[:, 0].resample("10min").mean()
    return by_day(pd.DataFrame(found), "10min")


def water_loop(read: Files, names: Callable[[], list[str]]) -> Runs:
    found = {}
    for path in sorted(names()):
        if path.endswith(".csv") and path.split("/")[1] in ("valve1", "valve2", "other"):
            one = dated(csv(read(path), sep=";"), "datetime")
            one = one[[name for name in one.columns if name not in ("anomaly", "changepoint")]]
            one.columns = [name.replace(" ", "") for name in one.columns]
            one = one.rename(columns={"Temperature": "Tengine"}).resample("10s").mean().interpolate(limit=2)
            found[f"{one.index[0]:%y%m%dT%H%M}"] = one
    return dict(sorted(found.items()))


def heated_rod(read: Files, names: Callable[[], list[str]]) -> Runs:
    found = {}
    for path in sorted(names()):
        if path.startswith("Data/HeatTransport"):
            one = csv(read(path), index_col=False)
            table = one[[f"temp{k}" for k in range(1, 7)]].apply(pd.to_numeric, errors="coerce")
            clock = pd.to_numeric(one.hour) * 3600 + pd.to_numeric(one.minute) * 60 + pd.to_numeric(one.second)
            found[path[-9:-4].replace("_", "m")] = table.groupby((clock - clock[0]) // 20 * 20.0).mean()
    return found


def hydraulic(read: Files, _: object) -> Runs:
    table = pd.DataFrame(
        {f"TS{k}": csv(read(f"TS{k}.txt"), sep=r"\s+", header=None).mean(axis=1) for k in (1, 2, 3, 4)}
    )
    return by_rows(table, 45, 60.0)


def station(read: Files, names: Callable[[], list[str]]) -> Runs:
    tables = []
    for path in sorted(names()):
        if path.startswith("Sensor_Test/Temperatur_and_Humidity/Data/Ta_RH_Test"):
            one = dated(csv(read(path), on_bad_lines="skip"), "Time")
            tables.append(one[[name for name in one.columns if "Ta" in name or "MCP" in name]])
    table = pd.concat(tables).sort_index().resample("2min").mean()
    pieces = {f"{part.index[0]:%dT%H}": part for _, part in table.groupby(table.index.floor("4h"))}
    return pieces


T = ("T",)
SETS: tuple[Set, ...] = (
    Set("lathe", "", "Z", lathe, ("T", "A"), is_new=False),
    Set("machine_growth", "ruoheng-du/thermal-expansion-error-prediction", "dL", machine_growth, T, is_new=False),
    Set("two_rooms", "codesob/sml2010", "Temperature_Habitacion_Sensor", two_rooms, T, is_new=False),
    Set("lecture_rooms", "rujia-L/grey-box-thermal-modeling-sde", "yTi1", lecture_rooms, ("yT", "Ta"), is_new=False),
    Set("passive_house", "LuisM78/Reconstruction_of_indoor_temperatures", "T1", passive_house, T, is_new=False),
    Set("loggers", "orestispanago/Hobo-cal", "T53", loggers, T, is_new=False),
    Set("water_loop", "waico/SKAB", "Thermocouple", water_loop, T, is_new=False),
    Set("heated_rod", "KeenanMcConkey/ENPH257-lab-heattransport", "temp3", heated_rod, ("temp",), is_new=False),
    Set("hydraulic", "luishpinto/cm-hydraulic-data-set", "TS4", hydraulic, T, is_new=False),
    Set("station", "markus1203/MoBiMet", "AM2320_Ta", station, ("1", "2", "A"), is_new=False),
    Set("occupancy", "deba033/3-ML-Industry-Project", "S4_Temp", occupancy, ("S1_T", "S2_T", "S3_T")),
    Set("transformer1", "zhouhaoyi/ETDataset", "OT", transformer(1)),
    Set("transformer2", "zhouhaoyi/ETDataset", "OT", transformer(2)),
    Set("air_quality", "ahmetmenevse/UCI_airquality", "CO_GT", air_quality, T),
    Set("gas_turbine", "mhclk20/gas-turbine-energy-analysis", "NitrogenOxides", gas_turbine),
    Set("stations", "Peiris94-dev/Beijing-Multi-Site-Air-Quality-Analysis", "Dingling", stations, tuple("ACDGHNSTWX")),
    Set("solar_plants", "AAYUSH1612/Solar-Power-Generation-Prediction", "Tmodule1", solar_plants, T),
    Set("hives", "rtenlab/EBeeVet", "Temp_260", hives, T),
    Set("climate_a", "IoTsec/Room-Climate-Datasets", "T1", room_climate("A"), T),
    Set("climate_b", "IoTsec/Room-Climate-Datasets", "T1", room_climate("B"), T),
    Set("climate_c", "IoTsec/Room-Climate-Datasets", "T1", room_climate("C"), T),
    Set("driven_car", "HardikJain98/ML_Project", "Tcabin", driven_car, T),
    Set("town_power", "TechJay7/power-consumption-prediction", "Zone3", town_power, T),
    Set("building_1298", "srouchier/buildingenergygeeks", "m1", building_1298, ("air_t", "dew_t")),
    Set("sparkling", "GLEON/rLakeAnalyzer", "wtr_4.0", lake("inst/extdata/Sparkling.wtr", "30min", 2), ("w",)),
    Set("mendota", "GLEON/LakeMetabolizer", "wtr_9", lake("inst/extdata/mendota.wtr", "15min", 1), ("w",)),
    Set("troutbog", "GLEON/LakeMetabolizer", "wtr_1", lake("inst/extdata/troutbog.wtr", "20min", 1), ("w",)),
    Set("low_energy_house", "Manusinh-Thakor/Predicting-Household-Energy-Usage-with-Regression-Models", "T1",
        low_energy_house, T),
    Set("factory", "PTW-TUDa/heat-exchanger-control", "ThSp_VC_100E_395_ThHy_T_ob", factory, ("t_amb",)),
    Set("greenhouse1", "brentelia/Microclimatic-Data-for-two-Tunnel-Greenhouses-in-northern-east-Italy", "TA1",
        greenhouse(1), T),
    Set("greenhouse2", "brentelia/Microclimatic-Data-for-two-Tunnel-Greenhouses-in-northern-east-Italy", "TA1",
        greenhouse(2), T),
    Set("car_engine", "eron93br/carOBD", "Tcat1", car_engine, T),
)  # fmt: skip


def usable(runs: Runs, response: str) -> Runs:
    """Runs in which enough samples are complete; of very many, an even choice. Channels that are seldom there go."""
    runs = {run: table for run, table in runs.items() if table[response].notna().mean() > 0.5}
    whole = pd.concat(runs.values())
    names = [name for name in whole.columns if name == response or whole[name].isna().mean() < 0.3]
    names = [name for name in names if whole[name].nunique() > 3]
    kept = {run: table[names] for run, table in runs.items()}
    kept = {run: table for run, table in kept.items() if len(table.dropna()) >= max(FEWEST_ROWS, len(table) // 2)}
    longest = np.median([len(table) for table in kept.values()])
    kept = {run: table for run, table in kept.items() if len(table) >= longest / 2}
    if len(kept) > MOST_RUNS:
        # the first ones as they were recorded, and an even choice of the others
        later = np.linspace(FIRST_RUNS, len(kept) - 1, MOST_RUNS - FIRST_RUNS).round()
        chosen = {*range(FIRST_RUNS), *later.astype(int).tolist()}
        kept = {run: table for k, (run, table) in enumerate(kept.items()) if k in chosen}
    return kept


def written(one: Set, runs: Runs, folder: Path) -> None:
    """The runs as CSV, with a machine file."""
    folder.mkdir(parents=True, exist_ok=True)
    whole = pd.concat(runs.values())
    names = ["".join(c if c.isalnum() or c == "_" else "_" for c in str(name)) for name in whole.columns]
    names = [name if name[0].isalpha() else f"s{name}" for name in names]
    level, scale = {}, {}
    for name in whole.columns:
        low, level[name], high = whole[name].quantile([0.25, 0.5, 0.75])
        spread = (high - low) / 1.35 or whole[name].std()
        scale[name] = 5.0 / spread
        if name == one.response:
            level[name], scale[name] = 0.0, 10.0
        elif name.startswith(one.temperatures or ("°",)):
            level[name], scale[name] = 20.0, 1.0
    has_dates = isinstance(next(iter(runs.values())).index, pd.DatetimeIndex)
    for run, table in runs.items():
        moved = pd.DataFrame(
            {
                new: (table[name] - level[name]) * scale[name] + (0.0 if name == one.response else 20.0)
                for name, new in zip(table.columns, names, strict=True)
            }
        ).round(5)
        moved.insert(0, "t", table.index)
        moved.to_csv(folder / f"{run}.csv", index=False)
    lines = [
        "[machine]",
        f'name = "{one.name}"',
        "[time]",
        'column = "t"',
        f'unit = "{"datetime" if has_dates else "s"}"',
    ]
    for name, new in zip(whole.columns, names, strict=True):
        role, unit = ("displacement", "um") if name == one.response else ("temperature", "degC")
        lines += [f"[channels.{new}]", f'role = "{role}"', f'unit = "{unit}"']
    (folder / "machine.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")


def files_of(one: Set, clones: Path) -> tuple[Files, Callable[[], list[str]]] | None:
    if not one.repository:
        return (lambda _: b""), list
    git = clone_of(Source(one.name, one.repository, "HEAD", "", "in place", ()), clones)
    if git is None:
        return None

    def asked(*words: str) -> bytes:
        return subprocess.run(["git", "-C", str(git), *words], capture_output=True, check=True).stdout

    return (
        lambda path: asked("show", f"HEAD:{path}"),
        lambda: asked("ls-tree", "-r", "-z", "--name-only", "HEAD").decode().strip("\0").split("\0"),
    )


def apart(sets: Sequence[Set] = SETS) -> Iterator[str]:
    """The new ones that are set apart by lot."""
    return (one.name for one in sorted((one for one in sets if one.is_new), key=lambda one: one.lot)[:10])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("clones", type=Path)
    parser.add_argument("--only", action="append")
    options = parser.parse_args()
    for one in SETS:
        if options.only and one.name not in options.only:
            continue
        files = files_of(one, options.clones)
        if files is None:
            print(f"{one.name:18s} no clone of {one.repository}")
            continue
        try:
            runs = usable(one.runs(*files), one.response)
            written(one, runs, options.folder / one.name)
        except Exception as error:  # a set that has changed is left out, the others go on
            print(f"{one.name:18s} {type(error).__name__}: {error}")
            continue
        rows = [len(table) for table in runs.values()]
        print(f"{one.name:18s} {len(runs)} runs of {min(rows)} to {max(rows)} rows, {table_width(runs)} inputs")


def table_width(runs: Runs) -> int:
    return next(iter(runs.values())).shape[1] - 1


if __name__ == "__main__":
    main()
