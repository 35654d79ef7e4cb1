"""Four design choices (FDCA) in NumPy, from the equations of docs/reference/laws-and-drivers.md.

    cargo test --release -q -p haptic-sim --test all fdca::record -- --ignored --nocapture | grep , \\
        | python3 tests/tools/fdca.py > tests/data/fdca_drives.csv

haptic-sim's test `fdca` holds the simulator's law against the last column; `bindings/python/tests/test_laws.py` holds the last
column against this.
"""

import sys

import numpy as np

COLUMNS = (
    "k_y_rad_per_m,k_psi,lohs,sohf,loha_nm_per_rad,"
    "e_y_m,e_theta_rad,e_theta_rate_rad_per_s,wheel_angle_rad,speed_m_per_s,yaw_rate_rad_per_s"
)
# The car as the ECU knows it: curvature gain, stability factor, aligning gain (docs/parameters.md, 16 to 18).
GAIN, STABILITY, ALIGNING = 0.022324, 0.001753, 0.9874


def asked_nm(rows):
    """What FDCA asks for, N.m; rows as COLUMNS."""
    k_y, k_psi, lohs, sohf, loha, e_y, e_theta, e_theta_rate, wheel, speed, yaw_rate = np.asarray(rows, float).T
    understeer = 1.0 + STABILITY * np.square(speed)
    path_curvature = (yaw_rate + e_theta_rate) / speed
    d_ff = path_curvature * understeer / GAIN
    d_fb = sohf * (k_y * e_y + k_psi * e_theta)
    stiffness = ALIGNING * np.square(speed) * GAIN / understeer
    return loha * (d_fb + d_ff - wheel) + stiffness * (lohs * d_ff + d_fb)


if __name__ == "__main__":
    table = np.loadtxt(sys.stdin, delimiter=",")
    print("# What FDCA sees in three drives, and asks for by tests/tools/fdca.py.")
    print(f"{COLUMNS},asked_nm")
    for row, torque in zip(table, asked_nm(table)):
        print(",".join(f"{number:.7g}" for number in row) + f",{torque:.9f}")
