#!/usr/bin/env python3
"""Bakes a scene on a Ray cluster of two nodes on this machine, one of which is killed during the bake, and
compares the file with that of one thread without Ray. Needs the path of the program `bake`."""

import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time

import ray

SCENE = ["london:3,3", "--cells", "walks", "--gap", "100%"]
SHARDS = 12
HERE = os.path.dirname(os.path.abspath(__file__))


def descendants(process):
    """Returns the ids of a process and of all that it and its children have started."""
    children = {}
    for name in filter(str.isdigit, os.listdir("/proc")):
        try:
            with open(f"/proc/{name}/stat", encoding="utf-8") as file:
                # The name of the program is in brackets and may hold anything.
                parent = int(file.read().rsplit(")", 1)[1].split()[1])
        except OSError:
            continue  # It has ended.
        children.setdefault(parent, []).append(int(name))
    found = [process]
    for parent in found:
        found.extend(children.get(parent, []))
    return found


def kill(node):
    """Kills all processes of a node at once, as if its machine had lost power."""
    for process in descendants(node.pid):
        try:
            os.kill(process, signal.SIGKILL)
        except ProcessLookupError:
            pass
    node.wait()


def start(work, name, processors, *arguments):
    command = [sys.executable, "-m", "ray.scripts.scripts", "start", *arguments]
    command += ["--node-ip-address=127.0.0.1", f"--num-cpus={processors}", "--object-store-memory=100000000"]
    command += ["--block"]
    with open(os.path.join(work, name), "w", encoding="utf-8") as log:
        return subprocess.Popen(command, stdout=log, stderr=subprocess.STDOUT, start_new_session=True)


def wait_for(what, is_there, seconds=60):
    end = time.monotonic() + seconds
    while not is_there():
        if time.monotonic() > end:
            raise SystemExit(f"error: {what}: not in {seconds} s")
        time.sleep(0.2)


def is_open(port):
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


def check(program, work, nodes):
    whole, out, store = (os.path.join(work, name) for name in ("whole.pvs", "ray.pvs", "store"))
    begin = time.monotonic()
    subprocess.run([program, *SCENE, "-o", whole, "--threads", "1"], check=True, stdout=subprocess.DEVNULL)
    print(f"one thread without Ray: {time.monotonic() - begin:.1f} s", flush=True)

    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    address = f"127.0.0.1:{port}"
    head = ["--head", f"--port={port}", "--include-dashboard=false", f"--temp-dir={work}/ray"]
    nodes.append(start(work, "head.log", 2, *head))
    wait_for("the first node", lambda: is_open(port))
    nodes.append(start(work, "second.log", 1, f"--address={address}"))
    ray.init(address=address, log_to_driver=False, logging_level="error")
    wait_for("the second node", lambda: sum(node["Alive"] for node in ray.nodes()) == 2)
    ray.shutdown()

    def command(report, settings=SCENE[1:], program=program):
        driver = [sys.executable, os.path.join(HERE, "bake_ray.py"), SCENE[0], "-o", out, "--store", store]
        driver += ["--program", program, "--shards", str(SHARDS), "--address", address, "--json", report]
        return [*driver, "--", *settings]

    def same_bytes():
        with open(whole, "rb") as one, open(out, "rb") as other:
            return one.read() == other.read()

    report = os.path.join(work, "report.json")
    is_killed = False
    with subprocess.Popen(command(report), stdout=subprocess.PIPE, text=True) as driver:
        for line in driver.stdout:
            print(line, end="", flush=True)
            if line.startswith(f"3/{SHARDS} ") and not is_killed:
                kill(nodes.pop())
                is_killed = True
                print("the second node is killed", flush=True)
    assert driver.returncode == 0 and is_killed, driver.returncode
    assert same_bytes(), "other bytes than those of one thread"
    with open(report, encoding="utf-8") as file:
        found = json.load(file)
    assert found["baked"] == SHARDS and found["already_there"] == 0, found
    # The attempt that went with the node was made again, be it as a copy because Ray was slow to notice.
    assert found["attempts"] > SHARDS and (found["lost"] or found["copies"]), found
    assert len(found["shards_by_node"]) == 2, "the killed node baked nothing before"
    assert found["most_in_flight"] == 6, "three slots, and twice as many tasks"

    # A driver that is started again bakes the shards that are not there. One of them hangs, and is copied.
    hanging = os.path.join(work, "hanging")
    with open(hanging, "w", encoding="utf-8") as file:
        file.write(f"""#!/bin/sh
case "$*" in *"--shard 0/"*) mkdir "{work}/hung" 2>/dev/null && exec sleep 300;; esac
exec "{program}" "$@"
""")
    os.chmod(hanging, 0o755)
    (folder,) = os.listdir(store)
    for shard in (0, 7):
        os.remove(os.path.join(store, folder, f"{shard}-of-{SHARDS}.shard"))
    os.remove(out)
    subprocess.run(command(report, program=hanging), check=True, timeout=120)
    assert same_bytes(), "other bytes after going on"
    with open(report, encoding="utf-8") as file:
        found = json.load(file)
    assert found["baked"] == 2 and found["already_there"] == SHARDS - 2 and found["copies"] >= 1, found

    # Refused input ends the driver with what the program says, and is not tried again.
    refused = subprocess.run(command(report, ["--gap", "7"]), capture_output=True, text=True, check=False)
    assert refused.returncode == 1 and "a part is a number" in refused.stderr, refused


def main():
    os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
    nodes = []
    # Paths of sockets must be short.
    with tempfile.TemporaryDirectory(prefix="bake-ray-", dir="/tmp", ignore_cleanup_errors=True) as work:
        # Tasks that are killed leave their files.
        os.environ["TMPDIR"] = work
        try:
            check(os.path.abspath(sys.argv[1]), work, nodes)
        finally:
            for node in nodes:
                kill(node)
    print("the same bytes from two nodes, one of which was killed")


if __name__ == "__main__":
    main()
