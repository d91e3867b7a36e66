"""A stage in Python behaves like a stage in Rust."""

import random
import re
import subprocess
import sys
import time
from pathlib import Path

import pytest
from conftest import HEIGHT_SEGMENTER, PROGRAMS, STAGES, call, launch_file, python_stage, results

import replica

MISBEHAVING = STAGES / "misbehaving.py"
RUST_SEGMENTER = f"program = '{PROGRAMS / 'height-segmenter'}'"


def start(path: Path, output: Path) -> subprocess.Popen:
    """A run that has saved its first states."""
    running = subprocess.Popen([PROGRAMS / "replica-launch", path], stderr=subprocess.DEVNULL)
    while not any(output.glob("run/states/*/export.state")):
        assert running.poll() is None, "the run must not end before its first barrier"
        time.sleep(0.005)
    return running


def processes(command: str) -> list[str]:
    """Ids of the processes with this in their command line."""
    return subprocess.run(["pgrep", "-f", command], capture_output=True, text=True).stdout.split()


def signal_all(pids: list[str], name: str):
    """A process may have ended meanwhile."""
    for pid in pids:
        subprocess.run(["kill", f"-{name}", pid], stderr=subprocess.DEVNULL)


def test_classes_of_a_recording_equal_those_of_the_rust_segmenter(folder, submaps):
    rust, python = folder / "rust.mcap", folder / "python.mcap"
    call("height-segmenter", "run", "--recording", submaps, "--record", rust)
    call(HEIGHT_SEGMENTER, "run", "--recording", submaps, "--record", python)
    assert "0 differ" in call("replica", "compare", rust, python)
    classes = [message["class_id"] for message in replica.open_recording(python).messages("class")]
    assert len(classes) == 6 and all(len(set(ids)) >= 3 for ids in classes)


@pytest.fixture(scope="module")
def rust_run(folder, drive) -> dict[str, bytes]:
    """Results with the segmenter in Rust."""
    call("replica-launch", launch_file(folder, drive, "run_rust", RUST_SEGMENTER))
    return results(folder / "run_rust")


def test_run_with_the_python_segmenter_has_the_bytes_of_the_rust_run(folder, drive, rust_run):
    call("replica-launch", launch_file(folder, drive, "run_python", python_stage(HEIGHT_SEGMENTER)))
    assert results(folder / "run_python") == rust_run


def test_python_segmenter_is_swapped_in_with_the_same_bytes(folder, drive, rust_run):
    output = folder / "swapped"
    running = start(launch_file(folder, drive, "swapped", RUST_SEGMENTER), output)
    # The sink waits, so that the run does not end before the swap.
    export = processes(f"replica-export run {output}/run/export.json")
    signal_all(export, "STOP")
    arguments = ["--run", output, "--program", HEIGHT_SEGMENTER, "--set", f"python={sys.executable}"]
    swap = subprocess.Popen([PROGRAMS / "replica", "swap", "infer", *arguments], stderr=subprocess.PIPE, text=True)
    shown = swap.stderr.readline()
    while shown and "draining to a barrier" not in shown:
        shown = swap.stderr.readline()
    signal_all(export, "CONT")
    assert swap.wait() == 0, shown
    assert running.wait() == 0
    assert results(output) == rust_run
    assert "height_segmenter.py" in (output / "run/swaps.json").read_text()


def test_killed_python_stage_continues_from_its_saved_state_with_the_same_bytes(folder, drive):
    infer = python_stage(STAGES / "counting.py")
    call("replica-launch", launch_file(folder, drive, "undisturbed", infer))
    notes = (folder / "undisturbed/summary.json").read_text()
    assert "another thread runs while the stage waits" in notes
    choose, n_kills = random.Random(7), 0
    path = launch_file(folder, drive, "killed", infer)
    running = subprocess.Popen([PROGRAMS / "replica-launch", path], stderr=subprocess.PIPE, text=True)
    while running.poll() is None and n_kills < 5:
        time.sleep(choose.uniform(0.1, 0.6))
        found = processes(f"counting.py run {folder}/killed/run/infer.json")
        signal_all(found, "KILL")
        n_kills += len(found)
    stderr = running.communicate()[1]
    assert running.returncode == 0, stderr
    assert n_kills >= 1 and "SIGKILL" in stderr
    assert results(folder / "killed") == results(folder / "undisturbed")


def alone(submaps: Path, fault: str, code: int) -> str:
    return call(MISBEHAVING, "run", "--recording", submaps, "--set", f"infer.fault={fault}", code=code)


@pytest.mark.parametrize(
    ("fault", "code", "last_line"),
    [
        ("raise", 1, r"misbehaving\.py:\d+: ZeroDivisionError: division by zero"),
        ("keep", 1, r"submap: arrays of 3 messages \(seq \[0, 1, 2\]\) are kept after the step, at most 2 are allowed; keep copies"),
        ("keep_loan", 1, r"BufferError: class: an array still refers to the loan: `del` it before publish"),
        ("outlive", 1, r"RuntimeError: class: the loan is published: its memory belongs to the readers"),
        ("write", 1, r"ValueError: assignment destination is read-only"),
        ("configuration", 78, r"the drive has no camera 7"),
        ("exit", 1, r"SystemExit: 0"),
    ],
)
def test_fault_is_the_last_log_line_and_gives_the_exit_code(submaps, fault, code, last_line):
    lines = [line for line in alone(submaps, fault, code).splitlines() if "no drive was given" not in line]
    assert re.search(last_line, lines[-1]), lines


def test_fault_in_a_run_is_reported_by_the_supervisor(folder, drive):
    infer = python_stage(MISBEHAVING) + "\nfault = 'raise'"
    shown = call("replica-launch", launch_file(folder, drive, "fault", infer), "--set", "run.restarts=0", code=1)
    assert "ZeroDivisionError: division by zero" in shown and "in step" in shown


def test_arrays_kept_in_a_run_end_it_with_the_rule(folder, drive):
    infer = python_stage(MISBEHAVING) + "\nfault = 'keep'"
    shown = call("replica-launch", launch_file(folder, drive, "kept", infer), "--set", "run.restarts=0", code=1)
    assert "at most 2 are allowed; keep copies" in shown


def test_wrong_settings_are_refused_with_file_and_line(folder, drive):
    infer = python_stage(MISBEHAVING) + "\nfault = 'late'\nlimits = ['a']\nn = 0\nis_on = 1\nfaulty = 2"
    path = launch_file(folder, drive, "wrong", infer)
    shown = call("replica-launch", path, "--check", code=78)
    for text in (
        "infer.fault: value \"late\" must be one of none, raise",
        "infer.limits: ",
        "infer.n: value 0 must be at least 1",
        "infer.is_on: ",
        "infer.faulty: unknown key; did you mean `fault`?",
    ):
        assert f"{path}:" in shown and text in shown, shown
    path = launch_file(folder, drive, "contradicting", python_stage(MISBEHAVING) + "\nn = 11")
    assert "infer.n: must be up to 10 while is_on" in call("replica-launch", path, "--check", code=78)


def test_absent_interpreter_is_named(folder, drive):
    infer = f"program = '{MISBEHAVING}'\npython = 'absent/bin/python'"
    shown = call("replica-launch", launch_file(folder, drive, "absent", infer), "--check", code=78)
    assert f"{folder}/absent/bin/python: cannot be started" in shown


def test_changed_script_is_refused_by_resume(folder, drive):
    script = folder / "changing.py"
    as_started = (STAGES / "counting.py").read_text()
    script.write_text(as_started)
    path = launch_file(folder, drive, "changed", python_stage(script))
    running = start(path, folder / "changed")
    running.kill()
    running.wait()
    script.write_text(as_started + "\n# changed\n")
    assert "changing.py" in call("replica-launch", path, "--resume", code=78)
    # The refusal loses nothing; the resumed run also frees the memory of the killed run.
    script.write_text(as_started)
    call("replica-launch", path, "--resume")


def test_outputs_are_usable_only_within_a_step():
    with pytest.raises(RuntimeError, match="only within step and finish"):
        replica.Outputs().loan("class", 3)


def test_class_with_an_unknown_topic_is_refused():
    class Lost(replica.Stage):
        name, inputs = "lost", ["submaps"]

    with pytest.raises(ValueError, match="there is no topic \"submaps\"; known are sweep, image"):
        replica.run(Lost)
