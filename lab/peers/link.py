#!/usr/bin/env python3
"""Bandwidth and round-trip time of the link to another host, compared with iperf3 and ping.

Needs root, iproute2, iperf3 and iputils-ping (Debian), and:
    cargo build --release && cargo build --release -p studies --example throughput

Makes two network namespaces with a virtual cable between them, without a limit and with limits of 2.5 and 1 Gbit/s.
`--sample` also runs the sample drive with [infer] on the other host and on this one.
"""

import argparse
import json
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PROGRAMS = ROOT / "target/release"
NEAR, FAR = "replica-near", "replica-far"
ADDRESS = "10.77.0.2"
# Name, and arguments of `tc qdisc add dev DEVICE root`.
CABLES = [
    ("no limit", None),
    ("2.5 Gbit/s", "tbf rate 2500mbit burst 2mb latency 20ms"),
    ("1 Gbit/s", "tbf rate 1gbit burst 1mb latency 20ms"),
]


def run(*command, check=True, **keywords):
    return subprocess.run([str(word) for word in command], check=check, capture_output=True, text=True, **keywords)


def in_namespace(name, *command):
    return ["ip", "netns", "exec", name, *[str(word) for word in command]]


def lay_cable(limit):
    for name in (NEAR, FAR):
        run("ip", "netns", "add", name)
    run("ip", "link", "add", "near", "netns", NEAR, "type", "veth", "peer", "name", "far", "netns", FAR)
    for name, device, address in [(NEAR, "near", "10.77.0.1/24"), (FAR, "far", ADDRESS + "/24")]:
        run(*in_namespace(name, "ip", "address", "add", address, "dev", device))
        for link in (device, "lo"):
            run(*in_namespace(name, "ip", "link", "set", link, "up"))
        if limit:
            run(*in_namespace(name, "tc", "qdisc", "add", "dev", device, "root", *limit.split()))


def remove_cable():
    for name in (NEAR, FAR):
        run("ip", "netns", "delete", name, check=False)


class Server:
    """A program in the far namespace, until the end of the block."""

    def __init__(self, *command, **keywords):
        self.process = subprocess.Popen(in_namespace(FAR, *command), stdout=subprocess.DEVNULL, **keywords)
        time.sleep(0.5)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.terminate()
        self.process.wait()


def iperf3_megabytes_per_second():
    with Server("iperf3", "--server"):
        answer = json.loads(run(*in_namespace(NEAR, "iperf3", "--client", ADDRESS, "--time", 5, "--json")).stdout)
    return answer["end"]["sum_received"]["bits_per_second"] / 8e6


def ping_microseconds():
    answer = run(*in_namespace(NEAR, "ping", "-c", 200, "-i", 0.002, "-q", ADDRESS)).stdout
    return float(answer.rsplit("/", 4)[-3]) * 1000


def link_figures(key, megabytes):
    program = PROGRAMS / "examples/throughput"
    with Server(program, "listen", ADDRESS + ":7879", key):
        answer = run(*in_namespace(NEAR, program, "connect", ADDRESS + ":7879", key, megabytes)).stdout
    return [float(word) for word in answer.split()]


def sample_seconds(key, folder, is_far):
    options = ["--set", f"infer.host={ADDRESS}:7878", "--set", f"infer.host_key={key}"] if is_far else []
    output = folder / "sample"
    command = [PROGRAMS / "replica-launch", ROOT / "launch.toml", "--overwrite", "--set", f"run.output={output}"]
    with Server(PROGRAMS / "replica", "agent", "--listen", ADDRESS + ":7878", "--key", key, "--folder", ROOT,
                stderr=subprocess.DEVNULL):
        ended = run(*in_namespace(NEAR, *command, "--set", "run.report=false", *options), check=False)
    if ended.returncode != 0:
        sys.exit(ended.stderr)
    return json.loads((output / "summary.json").read_text())["total"]["wall_s"]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=3, help="medians of this many")
    parser.add_argument("--megabytes", type=int, default=1000, help="sent by the link")
    parser.add_argument("--sample", action="store_true", help="also run the sample drive")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        key = folder / "agent.key"
        run(PROGRAMS / "replica", "agent", "--new-key", key)
        print("cable               iperf3 MB/s  link MB/s  share   ping us  link us")
        for name, limit in CABLES:
            remove_cable()
            lay_cable(limit)
            try:
                iperf3 = statistics.median(iperf3_megabytes_per_second() for _ in range(arguments.runs))
                figures = [link_figures(key, arguments.megabytes) for _ in range(arguments.runs)]
                ping = ping_microseconds()
                link, latency = (statistics.median(column) for column in zip(*figures))
                print(f"{name:18}  {iperf3:11.0f}  {link:9.0f}  {100 * link / iperf3:4.0f} %  {ping:8.0f}  {latency:7.0f}")
                if arguments.sample:
                    seconds = [[sample_seconds(key, folder, is_far) for is_far in (False, True)] for _ in range(arguments.runs)]
                    here, there = (statistics.median(column) for column in zip(*seconds))
                    print(f"{name:18}  the sample: {here:.1f} s, with [infer] on the other host {there:.1f} s")
            finally:
                remove_cable()


if __name__ == "__main__":
    main()
