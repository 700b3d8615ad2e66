"""Local parametric methods: a rational function through the lines around each line, thesis section 3.2.4.

`model` orders and how many lines they need, `window` which lines belong to which, `regressors` the linear equations,
`rational` their solution, `covariance` how sure it is, `joint` from reference to input and output, `fit` all of it.
"""
