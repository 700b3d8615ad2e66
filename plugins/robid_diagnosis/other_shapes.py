"""A law that leaves more than noise where it acts, fitted again from other shapes.

Laws with corners, exponents or memory have several minima. A search begins at the shape that promises most beside
springs and friction that were fitted without the law, and the fit ends in the minimum that is next to it. Such a law
would be called a part of what acts there; before that, each number of its shape is halved and doubled, one at a time,
and all are fitted from there.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from robid_core import RobidError
from robid_diagnosis.candidates import Candidate
from robid_diagnosis.hypothesis import ZERO_SPEEDS, Addition, Hypothesis
from robid_diagnosis.remainder import REMAINS, chance_of_remainders
from robid_diagnosis.search import Failure, Hit
from robid_diagnosis.trials import AGAIN, CLOSE, WRONG, Trial, Trials, key_of, nearness, plainest_first

FACTORS = (2.0, 0.5)


def from_other_shapes(fits: Trials, trials: list[Trial]) -> list[Trial]:
    """Return the trials, the best ones at their place from the shapes that fit best; fits end where one leaves noise.

    Nothing is fitted where the best leaves noise already, or so much that something else lacks.
    """
    if not trials or _is_all(fits, trials[0]):
        return trials
    found = list(trials)
    rivals = [one for one in trials if one.gain > CLOSE * trials[0].gain and _place(one) == _place(trials[0])]
    for rival in rivals[:AGAIN]:
        best = _of_its_best_shape(fits, rival)
        found[trials.index(rival)] = best
        if _is_all(fits, best):
            break
    return trials if found == trials else plainest_first(sorted(found, key=lambda trial: -trial.worth))


def _of_its_best_shape(fits: Trials, first: Trial) -> Trial:
    """Fit a trial's law from other shapes, and return the best of all."""
    best = first
    for hypothesis in _other_shapes(first):
        try:
            fitted = fits.case.fit_what_is_seen(hypothesis, fits.progress, fits.current)
        except RobidError as error:
            fits.failures.append(Failure(*key_of(first.hit), str(error)))
            continue
        trial = fits.trial_of(fitted, first.hit)
        if trial.gain > best.gain + nearness(best.fitted):
            best = trial
            if _is_all(fits, best):
                break
    return best if best is first else fits.to_the_end(best)


def _place(trial: Trial) -> str | None:
    return key_of(trial.hit)[1]


def _is_all(fits: Trials, trial: Trial) -> bool:
    """Whether noise is left where a law acts, or so much that something else lacks."""
    if trial.addition is None or fits.leaves_much([trial]):
        return True
    if trial.fitted.misfit > WRONG:
        return False
    return chance_of_remainders(fits.current, trial.fitted, [trial.addition.on])[0] >= REMAINS


def _other_shapes(trial: Trial) -> Iterator[Hypothesis]:
    """Hypotheses that begin with one number of the last law's shape halved or doubled, all else as it was found."""
    law = trial.addition
    if law is None or not isinstance(trial.hit, Hit):
        return
    found = trial.fitted.robot.parameters()
    values = {name: found.get(f"effect.{law.label}.{name}", value) for name, value in law.values.items()}
    rows = {row.name: row for row in trial.hit.candidate.effect.parameters}
    for name in _shape(trial.hit.candidate, law, trial.hit.meaning.names):
        for factor in FACTORS:
            value = factor * values[name]
            if rows[name].lower < value < rows[name].upper:
                begun = replace(law, values={**values, name: value})
                yield replace(
                    trial.fitted.hypothesis, additions=(*trial.fitted.hypothesis.additions[:-1], begun)
                )


def _shape(candidate: Candidate, law: Addition, linear: tuple[str, ...]) -> tuple[str, ...]:
    """Free numbers of a law that decide its shape and not its size; none of a wave, whose orders a search counts."""
    units = {row.name: row.unit for row in candidate.effect.parameters}
    if candidate.place is None or "order" in units:
        return ()
    held = {*linear, *ZERO_SPEEDS}
    return tuple(
        name for name in law.free if name not in held and units[name] in ("1", "N m", "rad", "rad/s")
    )
