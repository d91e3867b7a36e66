"""Programs, a drive and a recording that all tests share."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
PROGRAMS = Path(os.environ.get("REPLICA_PROGRAMS", ROOT / "target/release"))
STAGES = Path(__file__).parent / "stages"
HEIGHT_SEGMENTER = ROOT / "examples/python/height_segmenter.py"


def call(program, *arguments, code: int = 0) -> str:
    """Runs a program, which must end with this exit code. Returns its output."""
    command = [sys.executable, program] if str(program).endswith(".py") else [PROGRAMS / program]
    ended = subprocess.run([*command, *arguments], text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=300)
    assert ended.returncode == code, f"{program} {arguments}: {ended.returncode}\n{ended.stdout}"
    return ended.stdout


@pytest.fixture(scope="session")
def folder(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("replica")


@pytest.fixture(scope="session")
def drive(folder) -> Path:
    call("replica", "simulate", "--seed", "5", "--seconds", "6", "--rig", "survey", "--out", folder / "drive")
    return folder / "drive"


@pytest.fixture(scope="session")
def submaps(folder, drive) -> Path:
    """A recording of six submaps."""
    sweeps, submaps = folder / "sweeps.mcap", folder / "submaps.mcap"
    call("replica-acquire", "run", "--drive", drive, "--record", sweeps)
    keys = ["--set", "slam_aggregate.submap_m=3", "--set", "slam_aggregate.min_used_fixes_share=0.0"]
    call("replica-slam_aggregate", "run", "--drive", drive, "--recording", sweeps, "--record", submaps, *keys)
    return submaps


def launch_file(folder: Path, drive: Path, output: str, infer: str) -> Path:
    """A launch file whose run ends without a doubt."""
    path = folder / f"{output}.toml"
    path.write_text(
        f"[run]\ndrive = '{drive}'\noutput = '{output}'\nbarrier_s = 0.2\nrestart_delay_s = 0.0\nrestarts = 100\nreport = false\n"
        f"[acquire]\n[slam_aggregate]\nsubmap_m = 3.0\nmin_used_fixes_share = 0.0\n[infer]\n{infer}\n[export]\n"
        "max_position_deviation_m = 1000.0\nmax_height_deviation_m = 1000.0\nmax_heading_deviation_deg = 180.0\n"
    )
    return path


def python_stage(program: Path) -> str:
    """Keys of a stage's table."""
    return f"program = '{program}'\npython = '{sys.executable}'"


def results(output: Path) -> dict[str, bytes]:
    """The final files of a run by name."""
    files = [*sorted(output.glob("clouds/*")), output / "trajectory.txt"]
    return {file.name: file.read_bytes() for file in files}
