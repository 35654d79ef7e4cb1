"""Figure 9 of the paper: the lateral error after a sudden loss of the guidance, one panel for each driver."""

import matplotlib.pyplot as plt

import haptic_guidance as hg

figure, panels = plt.subplots(3, sharex=True, sharey=True, layout="constrained")
for panel, t_p in zip(panels, (0.1, 0.3, 0.5)):
    for condition in ("high", "mid", "low"):
        run = hg.simulate(hg.Scenario(condition=condition, driver={"t_p_s": t_p}, failure={"kind": "torque"}))
        panel.plot(run["time_s"], run["lateral_error_m"], label=f"{condition} reliance")
    panel.set(title=f"t_p = {t_p} s", ylabel="lateral error (m)", xlim=(60, 110))
panels[0].legend()
panels[-1].set_xlabel("time (s)")
figure.savefig("figure-9.png")
