"""What we believe about the capsule and the gut: laws, drives, effects, and how they are identified. Imports nothing of
ours.
"""

import casadi as _ca

_ca.GlobalOptions.setNumpyMode(1)  # np.where, np.clip, np.tanh ... on SX and MX, so a law is written once
