"""Checks of records before any fit: time stamps, sensors, the order and signs of columns, and the motion.

A check is a function of a `View` of one record that yields its findings; `examine` has them in order.
"""
