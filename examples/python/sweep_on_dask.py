"""A sweep on a Dask cluster: here one of this machine; on SLURM or Kubernetes only the cluster's line differs.

    pip install haptic-guidance distributed
    python examples/python/sweep_on_dask.py examples/sweep-reliance.toml
"""

import sys

from distributed import Client, LocalCluster

import haptic_guidance as hg


def main() -> None:
    # On SLURM: dask_jobqueue.SLURMCluster(cores=8, memory="4GB"), then cluster.scale(jobs=16).
    # On Kubernetes: dask_kubernetes.operator.KubeCluster(name="sweep", image=...), then cluster.scale(16).
    with LocalCluster() as cluster, Client(cluster) as client:
        result = hg.sweep(sys.argv[1], client, out="out/sweep-on-dask", progress=lambda n, of: print(f"{n}/{of}", end="\r"))
    print(f"\n{result.summary['drives']} drives: {result.parquet}")


if __name__ == "__main__":
    main()
