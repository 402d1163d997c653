"""Records looked at before anything is fitted to them: what the stamps, the sensor, the wiring and the motion are.

A check is a function of a `View` of one record that yields its findings; `examine` has them in order.
"""
