"""Nonlinear model predictive control: a few Gauss-Newton SQP steps on the control model, condensed, solved by daqp."""
