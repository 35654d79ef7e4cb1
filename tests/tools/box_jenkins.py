"""Prints the expected values of host-sim/evidence/src/real_drives/box_jenkins/tests.rs.

    python tests/tools/box_jenkins.py      (needs numpy and statsmodels; written with statsmodels 0.15.0)

The series is computed there too: two inputs of waves, and ARMA(2,1) noise of a linear congruential generator.
"""

import numpy as np
from statsmodels.tsa.ar_model import AutoReg
from statsmodels.tsa.statespace.sarimax import SARIMAX

ROWS, FROM, AHEAD = 600, 400, 5

state, errors = 1, []
for _ in range(ROWS):
    state = (1103515245 * state + 12345) % 2**31
    errors.append(state / 2**31 - 0.5)
k = np.arange(ROWS)
inputs = np.c_[np.sin(0.11 * k) + 0.5 * np.sin(0.043 * k + 1), np.sin(0.6 * k) * np.sin(0.013 * k)]
noise = np.zeros(ROWS)
for i, e in enumerate(errors):
    last, before = (noise[i - lag] if i >= lag else 0.0 for lag in (1, 2))
    noise[i] = 1.2 * last - 0.35 * before + e + (0.4 * errors[i - 1] if i else 0.0)
torque = inputs @ [0.8, -0.3] + noise

free = {"order": (2, 0, 1), "enforce_stationarity": False, "enforce_invertibility": False}
found = SARIMAX(torque, inputs, **free).fit(disp=False, method="powell", maxiter=5000)
found = SARIMAX(torque, inputs, **free).fit(found.params, disp=False)
print("weights, d_1, d_2, c:", found.params[:-1].round(5).tolist())
print("standard errors:", found.bse[:-1].round(5).tolist())
known = [0.8, -0.3, 1.2, -0.35, 0.4, 1 / 12]
past = SARIMAX(torque[:FROM], inputs[:FROM], **free).smooth(known)
print(f"row {FROM - 1 + AHEAD} by {FROM} rows:", past.forecast(AHEAD, exog=inputs[FROM : FROM + AHEAD])[-1].round(9))
own = AutoReg(torque, 6, hold_back=16).fit()
print("own past:", own.params[1:].round(9).tolist())
