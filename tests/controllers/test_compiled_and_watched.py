"""Generated C under the sanitizers of the compiler, and how much of it the hostile rows reach."""

from __future__ import annotations

import json
import shutil
import subprocess
from dataclasses import fields, replace

import numpy as np
import pytest

from selector.controllers.c_compiler import compiler
from selector.controllers.evaluator import axes_of
from selector.controllers.guard.decided import decided_limits
from selector.controllers.program.guarded_program import guarded_program
from selector.controllers.replay.parts import Answers
from selector.controllers.writers.c99 import NAME, c_files
from tests.controllers import hostile
from tests.controllers.plain_guard import plain_answers
from tests.controllers.test_generated_programs import KINDS

STRICT = ("-std=c99", "-ffp-contract=off", "-Wall", "-Wextra", "-Werror", "-g")
# what a conversion, a shift, an index or a read of uninitialised stack may do wrong; the first one ends the program
SANITIZED = ("-O1", "-fsanitize=address,undefined,float-cast-overflow", "-fno-sanitize-recover=all")
# from the first to the last line of a call; the loop reads a row of doubles and writes a row of doubles
MAIN = """#include <stdio.h>
#include "{name}.h"

int main(void)
{{
    static double in[{n_in}], out[{n_out}];
    {name} m;
    {name}_init(&m);
    while (fread(in, sizeof(double), {n_in}, stdin) == {n_in}) {{
{given}
        switch ((int)in[{n_in} - 2]) {{ /* a member that the control keeps is overwritten */
{kept}
        default: break;
        }}
        {name}_step(&m);
{taken}
        if (fwrite(out, sizeof(double), {n_out}, stdout) != {n_out}) return 1;
    }}
    return 0;
}}
"""


def built(folder, model, options):
    """The program of `model` as a filter of rows, compiled in `folder`."""
    into = list(hostile.rows(2, 0, len(axes_of(model))).columns(model))
    out = [variable.name for variable in guarded_program(model).of("output")]
    main = MAIN.format(
        name=NAME,
        n_in=len(into) + 2,
        n_out=len(out),
        given="\n".join(f"        m.{one} = in[{k}];" for k, one in enumerate(into)),
        kept="\n".join(
            f"        case {k}: m.{one.name} = in[{len(into) + 1}]{'' if one.kind == 'real' else ' > 0.5'}; break;"
            for k, one in enumerate(guarded_program(model).of("retained"))
        ),
        taken="\n".join(f"        out[{k}] = m.{one};" for k, one in enumerate(out)),
    )
    for file, text in {**c_files(model), "main.c": main}.items():
        (folder / file).write_text(text, encoding="ascii")
    command = [compiler(), *STRICT, *options, "-o", "program", "main.c", f"{NAME}.c"]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True)


def answered(folder, model, rows, overwritten=None):
    """What the program gives, and what it said while it ran; `overwritten`: for each row a kept member (-1: none), and
    what is written into it."""
    n = len(rows.dt_s)
    poked = np.column_stack([np.full(n, -1.0), np.zeros(n)]) if overwritten is None else overwritten
    given = np.column_stack([*rows.columns(model).values(), poked]).astype(np.float64)
    done = subprocess.run(["./program"], cwd=folder, input=given.tobytes(), capture_output=True)
    out = [variable.name for variable in guarded_program(model).of("output")]
    found = np.frombuffer(done.stdout).reshape(-1, len(out))
    return Answers.of_outputs(dict(zip(out, found.T, strict=True)), model), done.stderr.decode(), done.returncode


@pytest.mark.skipif(compiler() is None, reason="no C compiler; Debian: apt install gcc")
@pytest.mark.parametrize("adapted", [False, True])
@pytest.mark.parametrize("kind", KINDS)
def test_sanitizers_have_nothing_to_say(tmp_path, kind, adapted):
    model = hostile.model(**kind)
    rows = hostile.rows(4000, 7, len(axes_of(model)))
    if adapted:
        model, rows = hostile.adapted(model, with_gain=True), hostile.touched(rows, 3)
    done = built(tmp_path, model, SANITIZED)
    if done.returncode != 0 and "sanitize" in done.stderr:
        pytest.skip(f"{compiler()} has no sanitizers")
    assert done.returncode == 0, done.stderr
    answers, said, code = answered(tmp_path, model, rows)
    assert (said, code) == ("", 0)
    expected = plain_answers(model, rows)
    for field in fields(Answers):
        assert np.array_equal(getattr(answers, field.name), getattr(expected, field.name)), field.name


@pytest.mark.skipif(compiler() is None or shutil.which("gcov") is None, reason="no gcov; Debian: apt install gcc")
def test_hostile_rows_reach_the_generated_program(tmp_path):
    """Members that a control keeps are overwritten, too, as by a dead battery: nothing leaves its limits."""
    model = hostile.adapted(hostile.model(), with_gain=True)
    done = built(tmp_path, model, ("-O0", "--coverage"))
    assert done.returncode == 0, done.stderr
    limits, _ = decided_limits(model)
    for seed in range(4):
        n, rng = 10_000, np.random.default_rng(seed)
        rows = hostile.touched(hostile.rows(n, seed, len(axes_of(model))), seed)
        broken = rng.random(rows.readings.shape) < 0.01
        rows = replace(
            rows, readings=np.where(broken, rng.choice(model.guard.break_codes, broken.shape), rows.readings)
        )
        members = len(list(guarded_program(model).of("retained")))
        which = np.where(rng.random(n) < 0.05, rng.integers(0, members, n), -1)
        answers, _, code = answered(tmp_path, model, rows, np.column_stack([which, rng.choice(hostile.BAD, n)]))
        assert code == 0
        assert np.isfinite(answers.correction_um).all()
        for k, limit in enumerate(limits.values()):
            assert np.abs(answers.correction_um[:, k]).max() <= limit.clamp_um
    said = subprocess.run(
        ["gcov", "--json-format", "--stdout", "--branch-probabilities", f"program-{NAME}.gcda"],
        cwd=tmp_path, capture_output=True, text=True, check=True,
    ).stdout  # fmt: skip
    lines = next(of["lines"] for of in json.loads(said)["files"] if of["file"].endswith(f"{NAME}.c"))
    branches = [one["count"] > 0 for line in lines for one in line["branches"]]
    reached = sum(line["count"] > 0 for line in lines) / len(lines), sum(branches) / len(branches)
    # measured: docs/explanation/the-guard.md; what is left are caps of times and variances, and conditions that
    # a statement before them has made true
    assert reached[0] >= 0.95, reached
    assert reached[1] >= 0.9, reached


@pytest.mark.skipif(compiler() is None, reason="no C compiler; Debian: apt install gcc")
def test_fast_mathematics_is_refused(tmp_path):
    model = hostile.model()
    assert built(tmp_path, model, ("-O2",)).returncode == 0
    done = built(tmp_path, model, ("-O2", "-ffast-math"))
    assert done.returncode != 0
    assert "without -ffast-math" in done.stderr
