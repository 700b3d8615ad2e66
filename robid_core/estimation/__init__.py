"""Estimation: pure functions on arrays, from signals to parameters with their uncertainty.

`excitation` what is asked of the motors, `response` frequency responses and how sure they are, `distortion` what is not
linear in them, `rigid` the torque of rigid bodies; `least_squares`, `information` and `intervals` from there to
parameters. Import from the modules: ``from robid_core.estimation.response.spectra import response_from_spectra``.
"""
