//! Kills of the real pipeline, as many as requested: the promise of
//! `crash_recovery::killed_processes_do_not_change_the_clouds`.
//! `cargo build --release && cargo bench -p replica-tests --bench crash_soak -- --kills 200 --seed 1 [--drive FOLDER] [--swaps | --record |
//! --power-loss]`
//!
//! `--swaps` replaces stages by themselves during the whole run, which does not change the result, and counts the kills
//! during a swap. `--record` kills one process in each of as many recorded runs; test
//! `recordings::killed_process_leaves_a_complete_recording_or_one_that_says_that_it_is_not`. `--power-loss` resumes a
//! run after as many power losses; tests `power_loss`. Its disk needs `/dev/fuse`.

use replica_tests::power_loss::RecordedRun;
use replica_tests::{
    Random, binary, digest, domain_of, drive, kill_while_recording, leftovers, lidar_pipeline, long_drive, output_text,
    pipeline, result_files, run_in_own_namespace, run_under_kills, simulated_drive,
};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Pause after a swap that no supervisor has answered.
const POLL: Duration = Duration::from_millis(20);
const STAGES: [&str; 7] = ["acquire", "calibrate", "slam_aggregate", "colorize", "infer", "instance", "export"];

/// Value of an argument. Other arguments, such as cargo's own `--bench`, are ignored.
fn argument(name: &str) -> Option<String> {
    std::env::args().skip_while(|argument| argument != name).nth(1)
}

/// Starts and ends of swaps that passed their check, until `done`. Swaps while no supervisor listens fail at once.
fn swap_all_the_while(output: &Path, done: &AtomicBool) -> Vec<(Instant, Instant)> {
    let mut swaps = Vec::new();
    for stage in STAGES.iter().cycle() {
        if done.load(Ordering::Relaxed) {
            break;
        }
        let begin = Instant::now();
        let mut swap = Command::new(binary("replica"));
        swap.args(["swap", stage, "--run"]).arg(output).stdin(Stdio::null());
        let output = swap.output().expect("replica starts");
        if output_text(&output).contains("draining to a barrier") {
            swaps.push((begin, Instant::now()));
        } else {
            std::thread::park_timeout(POLL);
        }
    }
    swaps
}

/// Kills during recording.
fn recorded_kills(n: usize, seed: u64) -> ExitCode {
    let begun = Instant::now();
    let kills = kill_while_recording(&long_drive(), n, &mut Random::new(seed));
    println!("seed {seed}, {n} recorded runs, {:.1} s", begun.elapsed().as_secs_f64());
    println!("kills       {:?}", kills.struck);
    println!("results     all as undisturbed");
    println!(
        "recordings  {} complete with the same replay, {} reported as incomplete",
        kills.complete, kills.incomplete
    );
    ExitCode::SUCCESS
}

/// Power losses in a new run and in a run that replaces an earlier one.
fn power_losses(n: usize, seed: u64) -> ExitCode {
    if let Some(status) = run_in_own_namespace() {
        return if status.success() { ExitCode::SUCCESS } else { ExitCode::FAILURE };
    }
    let mut has_faults = false;
    for (name, earlier) in [("new run", None), ("--overwrite", Some(&["--set", "slam_aggregate.submap_m=5.0"][..]))] {
        let run = RecordedRun::new(lidar_pipeline(&drive(), ""), earlier);
        let n_changes = run.journal().n_changes();
        let n_syncs = run.journal().n_syncs();
        println!("{name}: {n_changes} changes, {n_syncs} syncs, {} different disks", run.crashes().len());
        let survival = run.survive(n, &mut Random::new(seed));
        println!("seed {seed}: {survival}");
        has_faults |= !survival.faults.is_empty();
    }
    if has_faults { ExitCode::FAILURE } else { ExitCode::SUCCESS }
}

fn main() -> ExitCode {
    let number = |name, default| argument(name).map_or(default, |text| text.parse().expect("a number"));
    let n_kills = number("--kills", 100);
    let seed = number("--seed", 1);
    let has = |name: &str| std::env::args().any(|argument| argument == name);
    if has("--record") {
        return recorded_kills(n_kills as usize, seed);
    }
    if has("--power-loss") {
        return power_losses(n_kills as usize, seed);
    }
    let sample = Path::new(env!("CARGO_MANIFEST_DIR")).join("drives/sample");
    let recorded = argument("--drive").map_or(sample.clone(), PathBuf::from);
    if recorded == sample && !sample.exists() {
        simulated_drive(&sample, &["--seed", "1", "--seconds", "12"]);
    }
    let recorded = recorded.canonicalize().expect("the drive exists");

    let undisturbed = pipeline(&recorded, "", "");
    let output = undisturbed.run();
    assert_eq!(output.status.code(), Some(0), "{}", output_text(&output));
    let expected = digest(&result_files(&undisturbed.output()));
    let undisturbed_s = undisturbed.summary()["total"]["wall_s"].as_f64().expect("a number");

    let launch = pipeline(&recorded, "restarts = 1000", "").with("--set").with("run.barrier_s=0.2");
    let begun = Instant::now();
    let done = AtomicBool::new(!has("--swaps"));
    let output = launch.output();
    let (kills, swaps) = std::thread::scope(|scope| {
        let swapping = scope.spawn(|| swap_all_the_while(&output, &done));
        let kills = run_under_kills(&launch, &STAGES, n_kills as usize, &mut Random::new(seed));
        done.store(true, Ordering::Relaxed);
        (kills, swapping.join().expect("swaps do not panic"))
    });
    let is_in_swap = |at: &&Instant| swaps.iter().any(|(begin, end)| (begin..end).contains(at));
    let n_in_swaps = kills.at.iter().filter(is_in_swap).count();
    let got = digest(&result_files(&launch.output()));
    let left = leftovers(&domain_of(&launch.output()));
    println!("seed {seed}, {}", recorded.display());
    println!("kills       {} {:?}", kills.total(), kills.struck);
    println!("swaps       {}, {n_in_swaps} kills during one", swaps.len());
    println!("restarts    {} by supervisors, {} by --resume", kills.restarts, kills.resumed);
    println!("seconds     {:.1}, undisturbed {undisturbed_s:.1}", begun.elapsed().as_secs_f64());
    println!("digest      {got:016x}, undisturbed {expected:016x}");
    println!("left behind {} files in /dev/shm and /tmp", left.len());
    if got == expected && left.is_empty() {
        return ExitCode::SUCCESS;
    }
    println!("FAILED: {}", if got == expected { left.join(" ") } else { "the kills changed the result".to_owned() });
    ExitCode::FAILURE
}
