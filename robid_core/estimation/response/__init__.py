"""From spectra to response matrices with their covariance: averages, closed loops, cross spectra, local methods."""
