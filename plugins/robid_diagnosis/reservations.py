"""What keeps a reader of a diagnosis from taking its values as they stand: something is left that has no name."""

from __future__ import annotations

from robid_core import Doubt, Finding, MisfitTable
from robid_diagnosis.trials import DOUBTFUL


def reservations(findings: tuple[Finding, ...], misfit: float, left: MisfitTable) -> tuple[Doubt, ...]:
    """Return a remark where a diagnosis leaves more than noise, or an unknown cause; nothing where it leaves neither.

    Parameters
    ----------
    findings
        What was found.
    misfit
        Per degree of freedom of the robot that was found.
    left
        Where it misfits.
    """
    unknown = [finding.where for finding in findings if finding.kind == "unknown"]
    if misfit <= DOUBTFUL and not unknown:
        return ()
    said = []
    if misfit > DOUBTFUL:
        places = left.worst(DOUBTFUL)
        said.append(
            f"misfit {misfit:.3g} with what was found" + (f" ({', '.join(places)})" if places else "")
        )
    said += [f"an unknown cause at {', '.join(dict.fromkeys(unknown))}"] if unknown else []
    return (
        Doubt(
            "left unexplained",
            f"{', and '.join(said)}: the extended robot lacks something, and standard errors do not cover it",
            "use it in motions like the recorded ones only, and look where its residual is a function of what",
            "remark",
        ),
    )
