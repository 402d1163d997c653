"""Channels with several clocks as tables: one a clock, or all at the union of their times."""

from collections.abc import Sequence

import numpy as np

from hil.formats.channels import Array, Channel, RefusedError
from models.rigs.columns import TIME


def by_clock(channels: Sequence[Channel]) -> list[tuple[str, Array, list[Channel]]]:
    """Channels by (group, times (n,)), without `t_s`: it is the clock of channels without one, else their count is."""
    clock = next((channel.values for channel in channels if channel.heading.name == TIME), None)
    found: list[tuple[str, Array, list[Channel]]] = []
    for channel in (channel for channel in channels if channel.heading.name != TIME):
        own = channel.time_s if channel.time_s is not None else clock
        times = own if own is not None else np.arange(len(channel.values), dtype=float)
        for group, other, members in found:
            if group == channel.heading.group and np.array_equal(other, times):
                members.append(channel)
                break
        else:
            found.append((channel.heading.group, times, [channel]))
    return found


def one_table(channels: Sequence[Channel]) -> dict[str, Array]:
    """All channels as columns at the union of their times `t_s`, NaN for missing samples."""
    if all(channel.time_s is None for channel in channels):
        lengths = {channel.heading.name: len(channel.values) for channel in channels}
        if len(set(lengths.values())) > 1:
            raise RefusedError(f"columns must have one length; got {lengths}"[:300])
        return {channel.heading.name: channel.values for channel in channels}
    if any(channel.time_s is None and channel.heading.name != TIME for channel in channels):
        raise RefusedError("columns without a clock must not stand beside channels with one: give --rig or --kind")
    groups = by_clock(channels)
    times = np.unique(np.concatenate([time_s for _, time_s, _ in groups]))
    columns = {TIME: times}
    for _, time_s, members in groups:
        at = np.searchsorted(times, time_s)
        for channel in members:
            column = np.full(times.shape, np.nan)
            column[at] = channel.values
            columns[channel.heading.name] = column
    return columns
