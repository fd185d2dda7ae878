"""How long a move of λ takes on the Sensors page, in Chromium: 40 sensors, 10 runs × 5 000 samples.

python benchmarks/bench_workbench.py [--moves 30]

Goal: 150 ms at the median from the key to the last picture. Beside it, in the same run, the baseline: the same numbers
for the same moves by the functions of `select`, from the samples.
"""

from __future__ import annotations

import argparse
import os
import shutil
import statistics
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import bench_select
import numpy as np
from playwright.sync_api import Page, sync_playwright

from selector.models.design import datum_of, rows_of
from selector.models.least_squares import fault_gains
from selector.recording import Recording
from selector.selection import Exploration, Options
from selector.selection.candidates import LINEAR, candidates
from selector.selection.choice import tested
from selector.selection.fitting import Recipe, final_models, predictions
from selector.selection.options import question_of
from selector.selection.proving import Folds, blocks_per_run
from selector.selection.survey import RunsOf, survey
from selector.workbench.bench import Bench
from selector.workbench.pages.sensors.pictures import NAMES
from selector.workbench.server import started

WATCH = """(names) => {
  window.seen = { text: 0, drawn: {} };
  new MutationObserver(() => requestAnimationFrame(() => setTimeout(() => { window.seen.text = performance.now(); })))
    .observe(document.querySelector("#sensors-facts"), { childList: true, subtree: true });
  for (const name of names) {
    const graph = document.querySelector(`#sensors-${name} .js-plotly-plot`);
    for (const kind of ["plotly_afterplot", "plotly_restyle"]) {
      graph.on(kind, () => { window.seen.drawn[name] = performance.now(); });
    }
  }
  document.addEventListener("keydown", () => {
    performance.clearResourceTimings();
    window.seen.text = 0;
    window.seen.drawn = {};
    window.seen.key = performance.now();
  }, true);
}"""
TOLD = """() => {
  const asked = performance.getEntriesByType("resource").filter((one) => one.name.endsWith("/sensors/move"));
  const { key, text, drawn } = window.seen;
  return asked.length && text ? {
    request: asked[0].responseEnd - asked[0].startTime, bytes: asked[0].transferSize,
    text: text - key, all: Math.max(text, ...Object.values(drawn)) - key, pictures: Object.keys(drawn).length,
  } : null;
}"""


def written(source: Recording, folder: Path) -> list[Path]:
    """The recording as files, with a machine file that says where the sensors sit."""
    files = []
    for run in source.runs:
        files.append(folder / f"{run}.csv")
        source.frame.xs(run, level="run").to_csv(files[-1])
    rng = np.random.default_rng(0)
    lines = ['[time]\ncolumn = "time_s"\nunit = "s"\n']
    for channel in source.channels:
        place = rng.uniform([-0.4, -0.2, 0.2], [0.4, 1.2, 1.8]).round(3).tolist()
        where = f"xyz = {place}\n" if channel.role == "temperature" else ""
        lines.append(f'[channels.{channel.name}]\nrole = "{channel.role}"\nunit = "{channel.unit}"\n{where}')
    (folder / "machine.toml").write_text("\n".join(lines), encoding="utf-8")
    return files


def moves(page: Page, n: int) -> list[dict[str, float]]:
    """What each of `n` steps of the slider took [ms]; a step of λ that was not seen before each, then back."""
    page.evaluate(WATCH, list(NAMES))
    slider = page.locator("#sensors-slider")
    slider.focus()
    page.keyboard.press("Home")
    page.wait_for_timeout(1500)
    found = []
    for _ in range(n):
        page.keyboard.press("ArrowRight")
        # nothing is asked of the page while it works
        page.wait_for_timeout(900)
        told = page.evaluate(TOLD)
        if told is not None:
            found.append(told)
    return found


def baseline(source: Recording, level: float) -> None:
    """Groups, set, model, errors per run, VIF and faults for one λ, from the samples."""
    options = Options(level=level)
    asked = question_of(source, options)
    datum = datum_of(source, asked.sensors, asked.responses, "rise")
    found = survey(source, asked, datum)
    runs = RunsOf(source, found.runs)
    folds = Folds(found.question, runs, datum, blocks_per_run(len(found.runs), found.n_samples))
    bench = folds.linear_bench(None)
    groups = candidates(found.question, bench)
    trial = tested(found.question, groups, bench, [LINEAR], []).choice(("linear", found.question.max_sensors)).trial
    recipe = Recipe.of(found.question, datum, trial.set.sensors, trial.shape)
    rows = rows_of(runs, recipe.design, found.runs)
    for model in final_models(recipe, rows).values():
        fault_gains(model, rows.variables, recipe.sensors, {}, rise=True)
    for group in folds.outer:
        part = folds.part(group)
        predictions(recipe, rows.only(part.training(rows)), rows.only(part.unseen(rows)))


def quantiles(values: list[float]) -> str:
    """Median and 95th percentile."""
    return f"p50 {statistics.median(values):.0f} ms, p95 {np.quantile(values, 0.95):.0f} ms"


def main() -> None:
    """Time page, numbers and baseline."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--moves", type=int, default=30)
    n = parser.parse_args().moves
    bench_select.N_SENSORS = 40
    source = bench_select.recording()
    chromium = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        files = written(source, Path(folder))
        study = Path(folder) / "study"
        study.mkdir()
        server = started(Bench(study.resolve(), files, Path(folder) / "machine.toml"))
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1280, "height": 900})
        page.set_default_timeout(120_000)
        page.goto(server.access.address)
        page.locator("#to-sensors").click()
        page.locator("#sensors-facts dd").first.wait_for()
        for name in NAMES:
            page.locator(f"#sensors-{name} .main-svg").first.wait_for()
        page.wait_for_timeout(2000)
        load = os.getloadavg()[0]
        found = moves(page, n)
        browser.close()
        server.close()
    print(f"load {load:.1f} before, {os.getloadavg()[0]:.1f} after, on {os.cpu_count()} processors; {len(found)} moves")
    for key, text in (
        ("request", "request, server included"),
        ("text", "key → numbers, groups and pictures in sight painted"),
        ("all", f"key → the last of the {len(NAMES)} pictures drawn"),
    ):
        print(f"{text}: {quantiles([one[key] for one in found])}")
    print(f"answer: {statistics.median(one['bytes'] for one in found) / 1000:.0f} kB")

    start = time.perf_counter()
    explored = Exploration.of(source)
    explored.cut(explored.grouping.chosen.level)
    print(f"reading and adding up once: {time.perf_counter() - start:.2f} s")
    fresh = replace(explored)
    levels = [explored.level_of(i) for i in range(len(explored.steps))][-n:]
    for name, work in (
        ("numbers of one λ, server", lambda level: fresh.fixed(fresh.cut(level).taken)),
        ("baseline: the same numbers by the functions of select", lambda level: baseline(source, level)),
    ):
        seconds = []
        for level in levels:
            start = time.perf_counter()
            work(level)
            seconds.append(1e3 * (time.perf_counter() - start))
        print(f"{name}: {quantiles(seconds)}")


if __name__ == "__main__":
    main()
