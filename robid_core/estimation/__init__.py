"""Estimation: pure functions on arrays, from spectra to parameters with their uncertainty.

`multisine` what is asked of the motors, `spectra` response matrices, `covariance` how sure they are, `speed`
the motion they were measured under; `least_squares`, `information` and `intervals` from there to parameters.
Plugins import from the modules: ``from robid_core.estimation.spectra import response_from_spectra``.
"""
