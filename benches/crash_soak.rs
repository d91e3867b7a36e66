//! Kills of the real pipeline, as many as wanted: the promise of `crash_recovery::killed_processes_do_not_change_the_clouds`.
//! `cargo build --release && cargo bench --bench crash_soak -- --kills 200 --seed 1 [--drive FOLDER] [--swaps]`
//!
//! `--swaps` replaces stages by themselves all the while, which does not change the result, and counts the kills during a swap.

use replica_tests::{
    Random, binary, digest, domain_of, leftovers, output_text, pipeline, result_files, run_under_kills, simulated_drive,
};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Pause after a swap that no supervisor has answered.
const POLL: Duration = Duration::from_millis(20);
const STAGES: [&str; 7] = ["acquire", "calibrate", "slam_aggregate", "colorize", "infer", "instance", "export"];

/// Value of an argument. Others, such as cargo's own `--bench`, are ignored.
fn argument(name: &str) -> Option<String> {
    std::env::args().skip_while(|argument| argument != name).nth(1)
}

/// Begins and ends of swaps that passed their check, until `done`. Swaps while no supervisor listens fail at once.
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

fn main() -> ExitCode {
    let number = |name, default| argument(name).map_or(default, |text| text.parse().expect("a number"));
    let (n_kills, seed) = (number("--kills", 100), number("--seed", 1));
    let sample = Path::new(env!("CARGO_MANIFEST_DIR")).join("drives/sample");
    let drive = argument("--drive").map_or(sample.clone(), PathBuf::from);
    if drive == sample && !sample.exists() {
        simulated_drive(&sample, &["--seed", "1", "--seconds", "12"]);
    }
    let drive = drive.canonicalize().expect("the drive exists");

    let undisturbed = pipeline(&drive, "", "");
    let output = undisturbed.run();
    assert_eq!(output.status.code(), Some(0), "{}", output_text(&output));
    let expected = digest(&result_files(&undisturbed.output()));
    let undisturbed_s = undisturbed.summary()["total"]["wall_s"].as_f64().expect("a number");

    let launch = pipeline(&drive, "restarts = 1000", "").with("--set").with("run.barrier_s=0.2");
    let begun = Instant::now();
    let (done, output) = (AtomicBool::new(!std::env::args().any(|argument| argument == "--swaps")), launch.output());
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
    println!("seed {seed}, {}", drive.display());
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
