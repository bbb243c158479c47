"""Does a study's shards as tasks on Dask or Ray: python cluster_study.py --help

Program, study and results are in a folder that all workers see. A shard that fails leaves the runs
that it has done, and the same command goes on from there.
"""
import argparse, os, subprocess, sys


def shard(command, folder):
    return subprocess.run([*command, "--jobs=1"], cwd=folder, capture_output=True, text=True)


def main():
    options = argparse.ArgumentParser(epilog="Further arguments go to `farside study`.")
    options.add_argument("study", help="a built-in study or a TOML file")
    options.add_argument("--out", required=True, help="the results folder")
    options.add_argument("--shards", type=int, required=True, help="how many tasks, of a core each")
    options.add_argument("--on", choices=["dask", "ray"], default="dask")
    options.add_argument("--address", help="a running cluster's; without, one is started here")
    options.add_argument("--farside", default="farside", help="the program")
    given, more = options.parse_known_args()
    command = [given.farside, "study", given.study, f"--out={given.out}", *more]
    parts = [[*command, f"--shard={i + 1}/{given.shards}"] for i in range(given.shards)]
    if given.on == "dask":
        from distributed import Client
        local = {} if given.address else {"threads_per_worker": 1, "dashboard_address": None}
        with Client(given.address, **local) as client:
            done = client.gather([client.submit(shard, p, os.getcwd(), pure=False) for p in parts])
    else:
        import ray
        ray.init(given.address)
        done = ray.get([ray.remote(shard).remote(part, os.getcwd()) for part in parts])
    for part, task in zip(parts, done):
        if task.returncode != 0:
            print(f"{part[-1]} ended with {task.returncode}: {task.stderr}", file=sys.stderr)
    sys.exit(subprocess.run([*command, f"--merge={given.shards}"]).returncode)


if __name__ == "__main__":
    main()
