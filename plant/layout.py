"""Where numbers stand in the arrays of the compiled steps: parameters, state, recorded columns, law tables."""

from typing import Final

# parameters `p`
(
    P_MASS,  # kg, body
    P_SURFACE,  # GUT or PLATE
    P_HOOP,  # factor on the hoop stress
    P_MU,  # wall or plate, sliding
    P_MU_STATIC,  # plate, at rest
    P_WEIGHT,  # N, what presses on the surface beside the wall: m g, with the inner mass
    P_RECOVERY,  # s, t_r
    P_MAGNET_K,  # N/m
    P_MAGNET_RANGE,  # m
    P_OUTER_MOMENT,  # A m2, magnet on the carriage
    P_INNER_MOMENT,  # A m2, magnet in the capsule
    P_MAGNET_HEIGHT,  # m, across the lumen between both
    P_MAGNET_ALONG,  # 1: moments along the lumen, opposite; 0: across it
    P_LINK_K,  # N/m, elastic link of a pull
    P_LINK_C,  # N s/m
    P_COIL_GAIN,  # N/A
    P_COIL_R,  # ohm
    P_COIL_L,  # H, 0: no delay
    P_COIL_LIMIT,  # A
    P_COIL_EMF,  # V s/m, back-EMF
    P_INNER_MASS,  # kg
    P_SPRING_K,  # N/m
    P_SPRING_C,  # N s/m
    P_FRONT_GAP,  # m
    P_FRONT_K,  # N/m
    P_REAR_GAP,  # m
    P_REAR_K,  # N/m
    P_REACTION,  # 1: the drive's reaction acts on the body, 0: outer field
    P_VISCOUS,  # N s/m, of a plate
    P_OFFSET,  # N, against +x
    P_PROFILE_START,  # m
    P_PROFILE_STEP,  # m
    P_COUNT,
) = range(33)
GUT: Final = 0.0  # what the body lies on
PLATE: Final = 1.0

# state `s`
(
    S_STEP,  # steps done
    S_X,
    S_V,
    S_U,  # m, wall displacement
    S_SLIP,  # 0 while the wall sticks, else the direction of its slip
    S_DIRECTION,  # last direction of motion
    S_CURRENT,  # A
    S_INNER_X,
    S_INNER_V,
    S_TRAVEL,  # m, path length so far
    S_ADHESION,  # 1, bond strength
    S_SINCE_REST,  # m, path since the last rest
    S_RELAX,  # 1, built-up stress
    S_SWEPT,  # m, path since the last reversal
    S_WOBBLE,  # rad
    S_HYSTERESIS,  # 1
    S_DRIVE_LAST,  # last drive value, for its rate
    S_PRESSING,  # N, with which a magnet presses the body on its surface
    S_COUNT,
) = range(19)

# recorded columns
O_T, O_X, O_V, O_U, O_FORCE, O_DRIVE, O_CURRENT, O_INNER_X, O_INNER_V, O_COUNT = range(10)

# law tables: one row a law over an even grid
L_RESISTANCE, L_PRESSURE, L_MUCUS, L_TENSION, L_DRAG, L_COUNT = range(6)
NODES: Final = 20001  # of each law's table
SPEED_SPAN: Final = 0.5  # m/s
MUCUS_SPAN: Final = 1.0  # (m/s)^(1/4): the film's drag is nearly a fourth root at rest
DRAG_SPAN: Final = 8e-3  # m
