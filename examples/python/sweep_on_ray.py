"""The same on Ray: an executor is whatever has `submit`.

    pip install haptic-guidance ray
"""

import sys

import ray

import haptic_guidance as hg


class RayExecutor:
    def submit(self, function, *arguments):
        return ray.remote(function).options(max_retries=20).remote(*arguments).future()


if __name__ == "__main__":
    ray.init()
    print(hg.sweep(sys.argv[1], RayExecutor(), out="out/sweep-on-ray").parquet)
