"""Fits by the prediction-error method: Gauss-Newton on residuals in units of the noise."""
