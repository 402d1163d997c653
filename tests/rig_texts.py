"""Tables of rig files that many tests believe in: a capsule in the gut, and one on a plate."""

GUT = """
[capsule]
radius_m = 6.5e-3
cylinder_length_m = 20e-3
mass_kg = 4.0e-3

[tissue]
preset = "jejunum"
wall_thickness_m = 2.5e-3
contact_angle_deg = 60.0
nose_force_angle_deg = 30.0
friction_coefficient = 0.082
mucus_thickness_m = 30e-6
recovery_time_s = 0.05
"""
PLATE = """
[capsule]
mass_kg = 0.193
[drive]
inner_mass_kg = 0.074
spring_stiffness_N_per_m = 256.23
force_N = 1.25
reaction_on_body = true
[surface]
kind = "plate"
friction_coefficient = 0.29
"""
