"""How much authority should the guidance have? Eleven closed loops side by side, each with a constant authority.

    pip install 'haptic-guidance[gym]'
    python examples/python/train_an_agent.py
"""

import gymnasium
import numpy as np

import haptic_guidance.envs  # registers the environments

envs = gymnasium.make_vec("haptic_guidance/Authority-v0", num_envs=11)
authority = np.linspace(0, 1, 11, dtype=np.float32)[:, None]
rewards, ended = np.zeros(11), np.zeros(11, dtype=bool)
observations, _ = envs.reset(seed=[1] * 11)  # the same driver for all
while not ended.all():
    observations, reward, terminated, truncated, _ = envs.step(authority)
    rewards += reward * ~ended
    ended |= terminated | truncated
for share, reward in zip(authority[:, 0], rewards):
    print(f"authority {share:.1f}: return {reward:.2f}")
