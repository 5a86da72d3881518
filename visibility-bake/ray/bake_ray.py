#!/usr/bin/env python3
"""Runs the shards of a bake as tasks of a Ray cluster, and assembles them to the file that a game loads.

A shard is a pure function of the scene, the settings and its number, so a shard may be baked any number of
times on any machine: an attempt that is lost with its machine is made again, and a shard that is late is baked
a second time where a machine is idle. Finished shards are kept in a store, a folder or an object store, and a
driver that is started again goes on with the shards that the store lacks.
"""

import argparse
import ctypes
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
import uuid

import pyarrow.fs
import ray


def open_store(place):
    """Returns the file system and the path in it of a folder: of a URI such as s3://bucket/path, or of a path."""
    if "://" in place:
        return pyarrow.fs.FileSystem.from_uri(place)
    return pyarrow.fs.LocalFileSystem(), os.path.abspath(place)


def shard_path(folder, shard, count):
    """Returns the path of the file of a shard."""
    return f"{folder}/{shard}-of-{count}.shard"


def stored_shards(files, folder, count):
    """Returns the numbers of the shards that a folder of the store holds."""
    found = files.get_file_info(pyarrow.fs.FileSelector(folder, allow_not_found=True))
    names = {info.base_name for info in found if info.is_file}
    return {shard for shard in range(count) if os.path.basename(shard_path(folder, shard, count)) in names}


def put(files, path, data):
    """Writes a file so that it is there whole or not at all."""
    part = f"{path}.part-{uuid.uuid4().hex}"
    with files.open_output_stream(part) as stream:
        stream.write(data)
    files.move(part, path)


def end_with_parent():
    """Lets a new process be killed when the thread that has made it ends, so that no work outlives its task."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG


def run_program(command):
    """Runs the program `bake` and returns what it prints. Raises ChildProcessError if a signal has ended it,
    which may go well next time, and ValueError if it refuses its arguments or its input."""
    done = subprocess.run(
        command, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False, preexec_fn=end_with_parent
    )
    said = (done.stderr.strip() or done.stdout.strip())[-2000:].removeprefix("error: ")
    if done.returncode < 0:
        raise ChildProcessError(f"{command[0]} was ended by {signal.Signals(-done.returncode).name}: {said}")
    if done.returncode > 0:
        raise ValueError(said or f"{command[0]} ended with exit code {done.returncode}")
    return done.stdout


def bake_shard(program, job, threads, store, name, shard, count):
    """Bakes one shard and puts it into the store. Returns its seconds, bytes and node."""
    start = time.monotonic()
    files, folder = open_store(store)
    with tempfile.TemporaryDirectory(prefix="bake-shard-") as work:
        out = os.path.join(work, "shard")
        part = ["--shard", f"{shard}/{count}", "--threads", str(threads), "-o", out]
        run_program([program, *job, *part])
        with open(out, "rb") as file:
            data = file.read()
    put(files, shard_path(f"{folder}/{name}", shard, count), data)
    node = ray.get_runtime_context().get_node_id()
    return {"seconds": time.monotonic() - start, "bytes": len(data), "node": node}


class Driver:
    """Keeps a bounded number of shards in flight until all are done."""

    def __init__(self, arguments, job, name, count, waiting):
        self.arguments, self.job, self.name, self.count = arguments, job, name, count
        self.total = len(waiting)
        self.waiting = sorted(waiting, reverse=True)
        self.attempts = dict.fromkeys(waiting, 0)
        self.pending = {}  # Shard of each task in flight.
        self.done = {}  # Result of each shard.
        self.lost = []  # Shard and reason of each attempt that was lost.
        self.copies = 0
        self.most_in_flight = 0
        # Attempts are counted here and not by Ray, so that the report can tell them.
        self.task = ray.remote(num_cpus=arguments.threads, max_retries=0)(bake_shard)

    def submit(self, shard):
        self.attempts[shard] += 1
        arguments = self.arguments
        task = self.task.remote(
            arguments.program, self.job, arguments.threads, arguments.store, self.name, shard, self.count
        )
        self.pending[task] = shard
        self.most_in_flight = max(self.most_in_flight, len(self.pending))

    def slots(self):
        """Returns the number of shards that the cluster, as it is now, can bake at the same time."""
        return max(1, int(ray.cluster_resources().get("CPU", 0)) // self.arguments.threads)

    def fill(self):
        slots = self.slots()
        # One more for each slot, so that no slot waits for the driver.
        limit = self.arguments.in_flight or 2 * slots
        while self.waiting and len(self.pending) < limit:
            self.submit(self.waiting.pop())
        # The last shards are baked twice where a machine is idle: the first machine may be slow, or dead.
        late = [shard for shard in self.pending.values() if self.attempts[shard] <= self.arguments.retries]
        for shard in late:
            in_flight = list(self.pending.values())
            if self.waiting or len(in_flight) >= min(slots, limit):
                break
            if in_flight.count(shard) == 1:
                self.copies += 1
                self.submit(shard)

    def take(self, task):
        shard = self.pending.pop(task)
        try:
            result = ray.get(task)
        except ray.exceptions.RayTaskError as error:
            if not isinstance(error.cause, OSError):
                raise SystemExit(f"error: shard {shard}: {error.cause}") from None
            self.lose(shard, error.cause)
        except ray.exceptions.RayError as error:
            self.lose(shard, error)
        else:
            self.done.setdefault(shard, result)

    def lose(self, shard, error):
        # Only the first sentence: Ray goes on with advice.
        reason = f"{type(error).__name__}: {str(error).strip().splitlines()[0].split('. ')[0]}"
        self.lost.append({"shard": shard, "reason": reason})
        print(f"shard {shard} lost: {reason}", flush=True)
        if shard in self.done or shard in self.pending.values():
            return
        if self.attempts[shard] > self.arguments.retries:
            raise SystemExit(f"error: shard {shard} was lost {self.attempts[shard]} times; {reason}")
        self.waiting.append(shard)

    def run(self):
        start = time.monotonic()
        while len(self.done) < self.total:
            self.fill()
            ready, _ = ray.wait(list(self.pending), timeout=1)
            for task in ready:
                self.take(task)
            if ready:
                passed, done = time.monotonic() - start, len(self.done)
                left = f"{passed / done * (self.total - done):.0f} s to go" if done else ""
                state = f"{done}/{self.total} shards, {len(self.pending)} in flight, {passed:.1f} s"
                print(state + (f", {left}" if left else ""), flush=True)


def report(driver, count, seconds, assembly, price):
    """Returns what a bake has cost, as a dictionary for JSON."""
    work = sum(result["seconds"] for result in driver.done.values())
    hours = work * driver.arguments.threads / 3600
    nodes = {}
    for result in driver.done.values():
        nodes[result["node"]] = nodes.get(result["node"], 0) + 1
    return {
        "shards": count,
        "already_there": count - driver.total,
        "baked": len(driver.done),
        "attempts": sum(driver.attempts.values()),
        "copies": driver.copies,
        "lost": driver.lost,
        "most_in_flight": driver.most_in_flight,
        "seconds": seconds,
        "seconds_of_shards": work,
        "seconds_of_assembly": assembly,
        "cpu_hours": hours,
        "cost": hours * price,
        "bytes_of_shards": sum(result["bytes"] for result in driver.done.values()),
        "shards_by_node": nodes,
    }


def assemble(program, job, out, files, folder, count):
    """Assembles the shards of the store to the file that a game loads. Returns what the program prints."""
    with tempfile.TemporaryDirectory(prefix="bake-assemble-") as work:
        shards = []
        for shard in range(count):
            path = shard_path(folder, shard, count)
            if not isinstance(files, pyarrow.fs.LocalFileSystem):
                with files.open_input_stream(path) as stream:
                    data = stream.read()
                path = os.path.join(work, str(shard))
                with open(path, "wb") as file:
                    file.write(data)
            shards.append(path)
        return run_program([program, "assemble", *job, "-o", out, "--shards", *shards])


def read_arguments():
    parser = argparse.ArgumentParser(
        description="Bake what can be seen from each viewcell of a scene on a Ray cluster.",
        epilog="Options after -- are those of `bake` that say what is baked: --size, --cells, --gap and others.",
    )
    parser.add_argument("scene", help="scene as `bake` takes it; a file must have the same path on all nodes")
    parser.add_argument("-o", "--out", required=True, metavar="FILE", help="file to write")
    parser.add_argument("--store", required=True, metavar="PLACE",
                        help="folder that all nodes share, or a URI such as s3://bucket/path, for finished shards")
    parser.add_argument("--program", default="bake", metavar="PATH",
                        help="the program `bake`, the same on all nodes (default: bake)")
    parser.add_argument("--shards", type=int, metavar="N",
                        help="number of shards (default: one for 16 viewcells); a resumed bake needs the same")
    parser.add_argument("--threads", type=int, default=1, metavar="N", help="threads of a shard (default: 1)")
    parser.add_argument("--in-flight", type=int, metavar="N",
                        help="most shards in flight (default: twice what the cluster bakes at a time)")
    parser.add_argument("--retries", type=int, default=3, metavar="N",
                        help="how often a lost shard is baked again (default: 3)")
    parser.add_argument("--address", metavar="HOST:PORT",
                        help="address of the cluster (default: RAY_ADDRESS, else one on this machine alone)")
    parser.add_argument("--price", type=float, default=0.04, metavar="X",
                        help="price of an hour of a processor, for the report (default: 0.04)")
    parser.add_argument("--json", metavar="FILE", help="file to write the report to")
    own, job = sys.argv[1:], []
    if "--" in own:
        at = own.index("--")
        own, job = own[:at], own[at + 1:]
    arguments = parser.parse_args(own)
    if arguments.threads < 1 or arguments.retries < 0 or min(arguments.shards or 1, arguments.in_flight or 1) < 1:
        parser.error("--threads, --shards and --in-flight are at least 1, --retries at least 0")
    # Tasks run in other folders.
    if os.sep in arguments.program:
        arguments.program = os.path.abspath(arguments.program)
    if os.path.exists(arguments.scene):
        arguments.scene = os.path.abspath(arguments.scene)
    return arguments, [arguments.scene, *job]


def main():
    arguments, job = read_arguments()
    start = time.monotonic()
    try:
        name, viewcells = run_program([arguments.program, "fingerprint", *job]).split()
        count = min(arguments.shards or -(-int(viewcells) // 16), int(viewcells))
        files, root = open_store(arguments.store)
        # Shards of another scene or of other settings have another name.
        folder = f"{root}/{name}"
        files.create_dir(folder, recursive=True)
        there = stored_shards(files, folder, count)
    except (ValueError, OSError) as error:
        raise SystemExit(f"error: {error}") from None
    print(f"{viewcells} viewcells in {count} shards, {len(there)} of them there already", flush=True)
    ray.init(address=arguments.address, log_to_driver=False, logging_level="warning")
    driver = Driver(arguments, job, name, count, set(range(count)) - there)
    driver.run()
    baked = time.monotonic()
    try:
        print(assemble(arguments.program, job, arguments.out, files, folder, count), end="")
    except (ValueError, OSError) as error:
        raise SystemExit(f"error: {error}") from None
    end = time.monotonic()
    found = report(driver, count, end - start, end - baked, arguments.price)
    print(
        f"{found['baked']} shards in {found['seconds']:.1f} s, {found['attempts']} attempts, {len(driver.lost)} lost,"
        f" {found['copies']} copies; {found['cpu_hours']:.4f} hours of processors, cost {found['cost']:.4f}"
    )
    if arguments.json:
        with open(arguments.json, "w", encoding="utf-8") as file:
            json.dump(found, file, indent=1)
    ray.shutdown()


if __name__ == "__main__":
    main()
