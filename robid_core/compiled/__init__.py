"""How loops in Python become machine code that runs on eight experiments at once: numba kernels, lanes, views, laws.

Knows nothing of robots. Authors of laws take `kernel`, `where` and the functions from `robid_core.mechanics`.
"""
