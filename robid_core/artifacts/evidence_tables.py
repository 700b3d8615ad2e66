"""Tables of what backs or limits a result: errors, misfits, checks, friction, predictions, the next experiment."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from robid_core.artifacts.tables import Table

if TYPE_CHECKING:
    from robid_core.artifacts.dense_run import DenseRun
    from robid_core.artifacts.excitation import Excitation
    from robid_core.artifacts.fit import PredictionErrors
    from robid_core.artifacts.friction_curve import FrictionCurve
    from robid_core.artifacts.misfit import MisfitTable
    from robid_core.artifacts.response_check import ResponseCheck
    from robid_core.artifacts.separating_experiment import SeparatingExperiment


def error_table(errors: PredictionErrors) -> Table:
    """Return a row for each axis: what a prediction leaves, and in what range 95 % of such records lie."""
    table = Table(
        axis=list(errors.axis_names),
        unit=[errors.unit_symbol] * len(errors.axis_names),
        rms=errors.rms.tolist(),
        relative=errors.relative.tolist(),
        low=errors.low.tolist(),
        high=errors.high.tolist(),
        still=errors.still.tolist(),
    )
    for name, values in (("of_limit", errors.of_limit), ("noise", errors.noise)):
        if values is not None:
            table[name] = values.tolist()
    return table


def misfit_rows(misfit: MisfitTable) -> Table:
    """Return a row for each axis and band: misfit on the excited lines and in the other bins."""
    n_band = len(misfit.band_names)
    return Table(
        axis=np.repeat(misfit.axis_names, n_band).tolist(),
        band=list(misfit.band_names) * len(misfit.axis_names),
        lines=misfit.lines.ravel().tolist(),
        other=misfit.other.ravel().tolist(),
    )


def check_table(check: ResponseCheck) -> Table:
    """Return a row for each stiffness that was estimated twice."""
    columns = ("by_torques", "torques_error", "by_responses", "responses_error", "z", "agree")
    table = Table(parameter=list(check.names), unit=list(check.units))
    for name in columns:
        table[name] = getattr(check, name).tolist()
    return table


def friction_table(curve: FrictionCurve) -> Table:
    """Return a row for each point: speed, measured friction and that of the law."""
    return Table(speed=curve.speed.tolist(), measured=curve.measured.tolist(), fitted=curve.fitted.tolist())


def channel_table(run: DenseRun) -> Table:
    """Return a row for each channel: side of the gear, unit, and between which values it lies where it is known."""
    table = Table(channel=list(run.channels))
    table["side"] = [one.side for one in run.channels.values()]
    table["unit"] = [one.unit_symbol for one in run.channels.values()]
    known = [one.values[np.isfinite(one.values)] for one in run.channels.values()]
    table["smallest"] = [float(values.min()) if values.size else float("nan") for values in known]
    table["largest"] = [float(values.max()) if values.size else float("nan") for values in known]
    return table


def rival_table(experiment: SeparatingExperiment) -> Table:
    """Return a row for each rival: the expected log-likelihood ratio, and that of repeating what was recorded."""
    return Table(
        rival=list(experiment.rivals),
        expected=experiment.ratio.tolist(),
        repeat=experiment.repeat.tolist(),
        separated=experiment.tells.tolist(),
    )


def excitation_table(excitation: Excitation) -> Table:
    """Return a row for each configuration and axis: largest speed asked for, and what a simulation promises."""
    names, n_config = excitation.axis_names, excitation.n_config
    asked = [np.abs(excitation.realization(c)).max(axis=(0, 1, 2)) for c in range(n_config)]
    table = Table(
        configuration=np.repeat(np.arange(n_config), len(names)).tolist(),
        axis=list(names) * n_config,
        reference_rad_s=np.ravel(asked).tolist(),
    )
    torque, limit = excitation.predicted_torque, excitation.torque_limit
    for name, values in (
        ("speed_rad_s", excitation.predicted_speed),
        ("torque_nm", torque),
        ("of_torque_limit", None if torque is None or limit is None else torque / limit),
        ("travel_rad", excitation.predicted_travel),
    ):
        if values is not None:
            table[name] = values.ravel().tolist()
    return table
