//! Cost and latency of supervision: CPU time of the supervisor, the time from a stage's exit or hang to its report, and the time
//! from a kill until the run has passed the lost barrier. With the pipeline of tests/misbehaving.
//! `cargo build --release -p launch -p misbehaving && cargo bench -p replica-tests --bench supervision [-- ROUNDS]`

use replica_tests::{Launch, Running, binary, wait_for};
use rustix::process::{Pid, Signal, kill_process};
use std::fmt::Write;
use std::time::{Duration, Instant};

/// Duration of the measurement: long enough for a tenth of a percent.
const WATCHED: Duration = Duration::from_secs(10);
/// Limit after which a silent stage hangs, s.
const HANG_S: f64 = 1.0;

/// Interval of sweeps, ms. Five times real time: the goal for the pipeline on two cores.
const PACE_MS: u64 = 20;

/// Endless sweeps of 2000 points, one every `pace_ms` or as fast as possible (0), and a barrier every 50 sweeps. The
/// pause before a restart is the default, 0.5 s.
fn launch(pace_ms: u64) -> Launch {
    let mut text = format!(
        "[run]\ndrive = '.'\noutput = 'out'\nbarrier_s = 5.0\nrestarts = 1000\nhang_s = {HANG_S:.1}\n\
         restart_delay_s = 0.5\n[source]\nprogram = '{}'\nticks = 1000000\npoints = 2000\npace_ms = {pace_ms}\n",
        binary("misbehaving-source").display()
    );
    for (table, keys) in [("relay", ""), ("sink", "lines = false")] {
        let program = binary(&format!("misbehaving-{table}"));
        writeln!(text, "[{table}]\nprogram = '{}'\n{keys}", program.display()).expect("a string takes everything");
    }
    Launch::new(&text)
}

/// The last barrier for which every stage has saved its state.
fn barrier(launch: &Launch) -> u64 {
    let states = launch.output().join("run/states");
    let entries = std::fs::read_dir(states).into_iter().flatten().flatten();
    let complete = entries.filter(|entry| {
        ["source", "relay", "sink"].iter().all(|stage| entry.path().join(format!("{stage}.state")).is_file())
    });
    complete.filter_map(|entry| entry.file_name().to_string_lossy().parse().ok()).max().unwrap_or_default()
}

fn wait_for_barrier_after(launch: &Launch, seen: u64) {
    wait_for("a further barrier", || (barrier(launch) > seen).then_some(()));
}

/// CPU time of all threads of a process, s.
fn cpu_s(pid: Pid) -> f64 {
    let tasks = std::fs::read_dir(format!("/proc/{}/task", pid.as_raw_nonzero())).expect("it lives").flatten();
    let nanos = tasks.filter_map(|task| {
        let text = std::fs::read_to_string(task.path().join("schedstat")).ok()?;
        text.split(' ').next()?.parse::<u64>().ok()
    });
    nanos.sum::<u64>() as f64 * 1e-9
}

/// CPU of the supervisor at five times real time, percent of a core.
fn supervisor_share() -> f64 {
    let launch = launch(PACE_MS);
    let running = launch.start();
    wait_for_barrier_after(&launch, 0);
    let begun = Instant::now();
    let before = cpu_s(running.pid());
    std::thread::sleep(WATCHED);
    100.0 * (cpu_s(running.pid()) - before) / begun.elapsed().as_secs_f64()
}

/// Times of one fault, ms: until its report, and until the run has passed the lost barrier.
struct Reaction {
    seen_ms: f64,
    caught_up_ms: f64,
}

fn reaction(launch: &Launch, running: &Running, signal: Signal, words: &str) -> Reaction {
    // In the middle of work, not at a restart.
    wait_for_barrier_after(launch, barrier(launch));
    let relay = running.stage("relay");
    let reports = running.stderr().matches(words).count();
    let before = barrier(launch);
    let begun = Instant::now();
    kill_process(relay, signal).expect("the stage lives");
    let ms = |begun: Instant| begun.elapsed().as_secs_f64() * 1e3;
    let seen = || (running.stderr().matches(words).count() > reports).then(|| ms(begun));
    let seen_ms = wait_for("the report", seen);
    wait_for_barrier_after(launch, before);
    Reaction { seen_ms, caught_up_ms: ms(begun) }
}

fn reactions(rounds: usize, signal: Signal, words: &str) -> Vec<Reaction> {
    // A separate run for each: the pause before a restart doubles with each further restart.
    let round = |_| {
        let launch = launch(0);
        let running = launch.start();
        reaction(&launch, &running, signal, words)
    };
    (0..rounds).map(round).collect()
}

fn print(name: &str, mut values: Vec<f64>, goal: f64) {
    values.sort_unstable_by(f64::total_cmp);
    let median = values[values.len() / 2];
    let max = values[values.len() - 1];
    let verdict = if max < goal { "reached" } else { "MISSED" };
    println!("| {name} | {median:.2} | {max:.2} | < {goal} | {verdict} |");
}

fn main() {
    let rounds = std::env::args().find_map(|argument| argument.parse().ok()).unwrap_or(10);
    let load = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
    println!("load before: {}\n", load.trim());
    println!("| figure | median | max | goal | |\n|---|---|---|---|---|");
    print("CPU of the supervisor, % of a core", vec![supervisor_share()], 0.5);
    let exits = reactions(rounds, Signal::KILL, "[relay] exit: was killed by SIGKILL");
    print("exit to its report, ms", exits.iter().map(|r| r.seen_ms).collect(), 100.0);
    print("kill to restarted and caught up, ms", exits.iter().map(|r| r.caught_up_ms).collect(), 2000.0);
    let hangs = reactions(rounds.div_ceil(2), Signal::STOP, "[relay] hang: no heartbeat");
    let late = hangs.iter().map(|r| r.seen_ms - HANG_S * 1e3).collect();
    print("hang to its report, beyond the set time, ms", late, 500.0);
}
