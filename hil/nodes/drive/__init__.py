"""The drive as a node: state machine, power stage, sync clock."""
