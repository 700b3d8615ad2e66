"""What real runs give: pages and figures of `docs/example`, which is run once; a second build keeps it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from generated_pages import drawings
from generated_pages.chart import Curve, chart, row_of
from generated_pages.stage_pictures import pictures
from robid_core import Diagnosis, Pipeline, Run
from robid_core.mechanics import equivalent_damping

EXAMPLE = Path(__file__).parent.parent / "example"


def pages() -> dict[str, str]:
    """Return pages of the runs, figures of the methods, and a picture of each stage, by their paths."""
    example, motion = Run.make(EXAMPLE / "pipeline.yaml"), Run.make(EXAMPLE / "motion.yaml")
    _write_table(motion)
    every = Run.make(Pipeline.load(EXAMPLE / "every_stage.yaml", data_root=EXAMPLE))
    figures = _figures(example, motion)
    figures |= {f"stage_{name}": lines for name, lines in pictures(example, motion, every).items()}
    texts = {f"figures/{name}.txt": "\n".join(lines) for name, lines in figures.items()}
    for name, run, stage in (("report_of_the_example", example, "page"), ("comparison", every, "compare")):
        file = run.path / "artifacts" / f"{stage}.html"
        texts[f"extra/{name}.html"] = file.read_text(encoding="utf-8")
    return texts


def _write_table(motion: Run) -> None:
    """Write a measurement as the table that `every_stage.yaml` reads."""
    run = motion["acquire"].runs[0]
    columns = [run.channels[name].values[0, 0, 0, 0, :, 0] for name in ("motor_position", "motor_torque")]
    table = np.column_stack([run.time_s, *columns])
    np.savetxt(EXAMPLE / "measured.csv", table, "%.6f", ",", header="t,q,tau", comments="")


def _figures(example: Run, motion: Run) -> dict[str, list[str]]:
    rigid, loop = motion["rigid"].time[0], motion["loop"].time[1]
    return {
        "excitation": drawings.excitation(
            example["excite"],
            "Excitation of the run in docs/example: the excited lines are odd, the slow sine stands on an even bin.",
        ),
        "responses": drawings.responses(
            example["frf"],
            "Response of one configuration by frf.log, motor acceleration over motor torque.",
        ),
        "log_fit": drawings.fitted_response(example["log_fit"], "fit.log_response, one configuration."),
        "torque_residual": _residual(example["explain"]),
        "diagnosis": drawings.cause(example["explain"], "The picture of a cause, as on the page."),
        "equivalent_gain": _equivalent_gain(),
        "design": drawings.design(
            example["choose"],
            "design.optimal on the robot of one axis: the few poses that are most informative.",
        ),
        "rigid": drawings.over_time(rigid, "fit.rigid on the run in docs/example/motion.yaml."),
        "output_error": drawings.over_time(loop, "fit.time_domain on the run in docs/example/motion.yaml."),
    }


def _residual(explained: Diagnosis) -> list[str]:
    curve = next(one for one in explained.residuals if one.variable.startswith("frequency"))
    told = (
        (curve.measured, "reference", "measured torque"),
        (curve.refitted, "first", "left by the robot file, values refitted"),
        (curve.extended, "second", "left with the missing friction law"),
    )
    curves = [
        Curve(curve.abscissa, 20 * np.log10(np.maximum(values, 1e-6)), style, name)
        for values, style, name in told
    ]
    up = "torque, dB of N m"
    return row_of(
        [chart("Torque residual", curve.variable, up, curves, logarithmic=True, size=drawings.WIDE)],
        "What each model leaves of the measured torque.",
    )


def _equivalent_gain() -> list[str]:
    rms = np.geomspace(0.2, 50, 200)
    curves = [
        Curve(rms, 20 * np.log10(equivalent_damping(rms, sine, 0.5, 0.0)), style, name)
        for sine, style, name in (
            (0.0, "first", "multisine alone"),
            (9.0, "second", "on a slow sine of 9 rad/s"),
        )
    ]
    title, across = "Gain of Coulomb friction of 0.5 N m", "rms speed of the multisine, rad/s"
    return row_of(
        [chart(title, across, "gain, dB of N m s/rad", curves, logarithmic=True, size=drawings.WIDE)],
        "The slow sine keeps the motor moving, so that friction disturbs a small multisine less.",
    )
