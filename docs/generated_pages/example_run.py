"""What a real run gives: the page and the figures of `docs/example`, which is run once; a second build keeps it."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np

from generated_pages.chart import Curve, chart, row_of
from robid_core.mechanics import equivalent_damping
from robid_core.pipeline import Pipeline
from robid_core.run import RunOptions, run_pipeline

EXAMPLE = Path(__file__).parent.parent / "example"
WIDE = (480, 260)
HERTZ = "frequency, Hz"
MOST_POINTS = 600


def pages() -> dict[str, str]:
    """Return the run's page and the figures of the methods by their paths."""
    run_pipeline(Pipeline.load(EXAMPLE / "pipeline.yaml"), RunOptions())
    folder = EXAMPLE / "runs" / "one-axis"
    artifacts = folder / "artifacts"
    run_pipeline(Pipeline.load(EXAMPLE / "motion.yaml"), RunOptions())
    moved = EXAMPLE / "runs" / "motion" / "artifacts"
    figures = {
        "excitation": _excitation(artifacts),
        "responses": _responses(artifacts),
        "log_fit": _log_fit(artifacts),
        "torque_residual": _residual(artifacts),
        "diagnosis": _diagnosis(artifacts),
        "equivalent_gain": _equivalent_gain(),
        "design": _design(artifacts),
        "rigid": _over_time(moved / "rigid.h5", 0, "fit.rigid on the run in docs/example/motion.yaml."),
        "output_error": _over_time(
            moved / "loop.h5", 1, "fit.time_domain on the run in docs/example/motion.yaml."
        ),
    }
    page = (artifacts / "page.html").read_text(encoding="utf-8")
    return {f"figures/{name}.txt": "\n".join(lines) for name, lines in figures.items()} | {
        "extra/report_of_the_example.html": page
    }


def _excitation(folder: Path) -> list[str]:
    """Spectrum of the speed reference of one experiment, and the beginning of it over time."""
    with h5py.File(folder / "excite.h5") as file, h5py.File(folder / "acquire.h5") as record:
        reference = file["reference"][0, 0, 0, :, 0]
        sample_time = float(np.diff(record["runs/0000/time_s"][:2])[0])
        lines = record["line"][:]
    amplitude = 2 * np.abs(np.fft.rfft(reference)) / len(reference)
    frequency = np.fft.rfftfreq(len(reference), sample_time)
    band = (frequency > 0.2) & (frequency < 100)
    others = band & ~np.isin(np.arange(len(frequency)), lines)
    decibel = 20 * np.log10(np.maximum(amplitude, 1e-4))
    seen = slice(0, round(2.0 / sample_time), 2)
    time = sample_time * np.arange(len(reference))
    return row_of(
        [
            chart(
                "The first two seconds",
                "time, s",
                "speed reference, rad/s",
                [Curve(time[seen], reference[seen])],
                size=WIDE,
            ),
            chart(
                "Its spectrum",
                HERTZ,
                "amplitude, dB of rad/s",
                [
                    Curve(
                        frequency[others],
                        decibel[others],
                        "reference",
                        "not excited: detection lines, and the slow sine",
                        dots=True,
                    ),
                    Curve(frequency[lines], decibel[lines], "second", "excited lines", dots=True),
                ],
                logarithmic=True,
                size=WIDE,
            ),
        ],
        "Excitation of the run in docs/example: the excited lines are odd, the slow sine stands on an even bin.",
    )


def _responses(folder: Path) -> list[str]:
    with h5py.File(folder / "frf.h5") as file:
        frequency, response = file["frequency_hz"][:], file["response"][0, :, 0, 0]
        blocks = file["block_response"][0, :, :, 0, 0]
        deviation = np.sqrt(
            file["input_gram_inverse"][0, :, 0, 0].real * file["output_covariance"][0, :, 0, 0].real
        )
    spread = np.abs(blocks - blocks.mean(axis=0)).max(axis=0)
    return row_of(
        [
            chart(
                "Response",
                HERTZ,
                "magnitude, dB",
                [Curve(frequency, 20 * np.log10(np.abs(response)))],
                logarithmic=True,
                size=WIDE,
            ),
            chart(
                "Uncertainty",
                HERTZ,
                "relative to the response, dB",
                [
                    Curve(
                        frequency,
                        20 * np.log10(deviation / np.abs(response)),
                        "second",
                        "stated standard deviation",
                    ),
                    Curve(
                        frequency,
                        20 * np.log10(spread / np.abs(response)),
                        "reference",
                        "blocks, from their mean",
                        dots=True,
                    ),
                ],
                logarithmic=True,
                size=WIDE,
            ),
        ],
        "Response of one configuration by frf.log, motor acceleration over motor torque.",
    )


def _log_fit(folder: Path) -> list[str]:
    with h5py.File(folder / "log_fit.h5") as file:
        frequency = file["response/frequency_hz"][:]
        measured, modelled, start = (
            20 * np.log10(np.abs(file[f"response/{name}"][0, :, 0, 0]))
            for name in ("measured", "modelled", "start")
        )
    curves = [
        Curve(frequency, start, "reference", "robot file"),
        Curve(frequency, modelled, "second", "fitted model"),
        Curve(frequency, measured, "first", "measured", dots=True),
    ]
    return row_of(
        [chart("Response", HERTZ, "magnitude, dB", curves, logarithmic=True, size=WIDE)],
        "fit.log_response, one configuration.",
    )


def _residual_curve(folder: Path, beginning: str) -> tuple[str, dict[str, np.ndarray]]:
    """Return a residual of the diagnosis over a variable whose name begins so."""
    with h5py.File(folder / "explain.h5") as file:
        for group in file["residuals"].values():
            variable = str(group.attrs["variable"])
            if variable.startswith(beginning):
                return variable, {name: group[name][:] for name in group}
    raise LookupError(f"no residual over {beginning}")


def _residual(folder: Path) -> list[str]:
    variable, curve = _residual_curve(folder, "frequency")
    decibel = {
        name: 20 * np.log10(np.maximum(values, 1e-6)) for name, values in curve.items() if name != "abscissa"
    }
    curves = [
        Curve(curve["abscissa"], decibel["measured"], "reference", "measured torque"),
        Curve(curve["abscissa"], decibel["refitted"], "first", "left by the robot file, values refitted"),
        Curve(curve["abscissa"], decibel["extended"], "second", "left with the missing friction law"),
    ]
    return row_of(
        [chart("Torque residual", variable, "torque, dB of N m", curves, logarithmic=True, size=WIDE)],
        "What each model leaves of the measured torque.",
    )


def _diagnosis(folder: Path) -> list[str]:
    with h5py.File(folder / "explain.h5") as file:
        finding = file["findings/0000"]
        variable = str(finding.attrs["variable"])
        x, residual, explained = (finding[name][:] for name in ("abscissa", "residual", "explained"))
    curves = [
        Curve(x, explained, "second", "friction.load_dependent, as found"),
        Curve(x, residual, "first", "torque that the rest of the model leaves", dots=True),
    ]
    return row_of(
        [chart("The cause", variable, "torque, N m", curves, size=WIDE)],
        "The picture of a cause, as on the page.",
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
    return row_of(
        [
            chart(
                "Gain of Coulomb friction of 0.5 N m",
                "rms speed of the multisine, rad/s",
                "gain, dB of N m s/rad",
                curves,
                logarithmic=True,
                size=WIDE,
            )
        ],
        "The slow sine keeps the motor moving, so that friction disturbs a small multisine less.",
    )


def _design(folder: Path) -> list[str]:
    with h5py.File(folder / "choose.h5") as file:
        angle, weight = file["angle"][:, 0], file["weight"][:]
    order = np.argsort(angle)
    curves = [
        Curve(
            np.repeat(angle[order], 3),
            np.stack([0 * weight, weight[order], 0 * weight], axis=1).ravel(),
            "second",
        )
    ]
    return row_of(
        [
            chart(
                "Chosen configurations", "angle of axis_1, rad", "share of the experiments", curves, size=WIDE
            )
        ],
        "design.optimal on the robot of one axis: the few poses that are most informative.",
    )


def _over_time(file_name: Path, index: int, caption: str) -> list[str]:
    """Measured and modelled torque over time, and their difference."""
    with h5py.File(file_name) as file:
        found = file[f"time/{index:04d}"]
        every = max(1, found["time_s"].shape[0] // MOST_POINTS)
        time, measured, modelled = (
            found[name][:].reshape(found["time_s"].shape[0], -1)[::every, 0]
            for name in ("time_s", "measured", "modelled")
        )
    curves = [Curve(time, measured, "first", "measured"), Curve(time, modelled, "reference", "model")]
    left = [Curve(time, measured - modelled, "second")]
    return row_of(
        [
            chart("Motor torque", "time, s", "torque, N m", curves, size=WIDE),
            chart("Measured less model", "time, s", "torque, N m", left, size=WIDE),
        ],
        caption,
    )
