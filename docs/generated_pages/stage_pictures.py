"""A picture of what each built-in stage makes, from the runs of `docs/example`."""

from __future__ import annotations

from generated_pages import drawings
from robid_core import Robot, Run

WHERE = "docs/example/{}.yaml"
ESTIMATORS = ("ari", "h1", "harmonic", "indirect", "jio", "lpm", "lrm", "spectral", "two_stage")


def pictures(example: Run, motion: Run, every: Run) -> dict[str, list[str]]:
    """Return the picture of each stage by its name, as lines of reStructuredText."""
    found = _motions(example, motion, every) | _records(example, every)
    found |= {f"frf.{name}": drawings.responses(every[name], _in("every_stage")) for name in ESTIMATORS}
    found["frf.log"] = drawings.responses(example["frf"], _in("pipeline"))
    return found | _fits(example, motion, every) | _diagnoses(example, every)


def _in(pipeline: str, more: str = "") -> str:
    return f"In {WHERE.format(pipeline)}{more}."


def _motions(example: Run, motion: Run, every: Run) -> dict[str, list[str]]:
    """Return configurations and what is moved there."""
    two = "the pose that separates two causes which the recorded one cannot distinguish"
    return {
        "design.candidates": drawings.configurations(every["where"], _in("every_stage")),
        "design.optimal": drawings.design(
            example["choose"], _in("pipeline", ": few poses, the most informative")
        ),
        "design.separating": drawings.configurations(
            every["where_next"], _in("every_stage", f": {two}"), every["once"]
        ),
        "excitation.multisine": drawings.excitation(
            example["excite"], _in("pipeline", ", beside a slow sine")
        ),
        "excitation.fourier": drawings.excitation(motion["move"], _in("motion"), 10.0),
        "excitation.binary_sequence": drawings.excitation(every["binary"], _in("every_stage")),
        "excitation.chirp": drawings.excitation(every["chirp"], _in("every_stage"), 4.0),
        "excitation.filtered_noise": drawings.excitation(every["noise"], _in("every_stage"), 12.0),
        "excitation.constant_velocity": drawings.excitation(every["sweeps"], _in("every_stage"), 1e9),
        "excitation.separating": drawings.excitation(every["next"], _in("every_stage")),
    }


def _records(example: Run, every: Run) -> dict[str, list[str]]:
    """Return what is measured, and what a compensation takes off."""
    measured, clean, smooth = every["acquire"], every["clean"], every["smooth"]
    still = _in("every_stage", ": nothing, of one axis whose inertia does not change")
    return {
        "acquisition.drives": drawings.record(example["acquire"], _in("pipeline")),
        "acquisition.simulated": drawings.record(measured, _in("every_stage")),
        "acquisition.recorded": drawings.record(every["read"], _in("every_stage", ", read from a table")),
        "compensate.ripple": drawings.taken_off(measured, clean, _in("every_stage"), over_turns=True),
        "compensate.friction": drawings.taken_off(clean, smooth, _in("every_stage")),
        "compensate.simulation": drawings.taken_off(smooth, every["still"], still),
    }


def _fits(example: Run, motion: Run, every: Run) -> dict[str, list[str]]:
    rigid, loop = motion["rigid"].time[0], motion["loop"].time[1]
    spring = _in("every_stage", ": below the frequency at which angle and torque are cut off")
    return {
        "fit.log_response": drawings.fitted_response(example["log_fit"], _in("pipeline")),
        "fit.torque_residual": drawings.modelled_response(example["frf"], example["fit"], _in("pipeline")),
        "fit.rigid": drawings.over_time(rigid, _in("motion")),
        "fit.time_domain": drawings.over_time(loop, _in("motion")),
        "fit.friction": drawings.friction(every["friction"].friction[0], _in("every_stage")),
        "fit.presliding": drawings.bristles(every["stuck"], every["presliding"], spring),
        "fit.state_space": drawings.modelled_response(every["h1"], every["state_space"], _in("every_stage")),
    }


def _diagnoses(example: Run, every: Run) -> dict[str, list[str]]:
    """Return what diagnoses show, and reports in a frame."""
    ratio = Robot.load("one_axis").parameter("gear_ratio.axis_1")
    return {
        "diagnosis.effects": drawings.cause(example["explain"], _in("pipeline")),
        "diagnosis.cross_validation": drawings.over_time(every["left_out"].time[0], _in("every_stage")),
        "diagnosis.prediction": drawings.over_time(every["predicted"].time[0], _in("every_stage")),
        "diagnosis.closed_loop": drawings.over_time(every["loop"].time[1], _in("every_stage")),
        "diagnosis.deflection": drawings.gear_deflection(every["acquire"], ratio, _in("every_stage")),
        "report.html": drawings.page(
            "report_of_the_example.html", "Page of the run in docs/example/pipeline.yaml"
        ),
        "report.comparison": drawings.page(
            "comparison.html", "Page of the run in docs/example/every_stage.yaml"
        ),
    }
