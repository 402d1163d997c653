"""A campaign over folders of measured series: `close-loop` on each, and one page of what they say together."""
