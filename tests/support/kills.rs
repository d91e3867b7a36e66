//! SIGKILL at seeded moments: of one stage, of the supervisor, of all processes at once.

use crate::{Launch, Running};
use random::Random;
use rustix::process::{Signal, kill_process};
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;
use std::time::{Duration, Instant};

/// Longest wait for a moment: a longer one indicates a fault of the test, or a run that is stuck.
const TIMEOUT: Duration = Duration::from_mins(5);

/// The kills of a run.
#[derive(Debug, Default)]
pub struct Kills {
    /// Kills by victim: a stage, `supervisor` or `all`.
    pub struck: BTreeMap<String, usize>,
    /// Number of times the run was continued by `--resume`.
    pub resumed: usize,
    /// Number of restarts by supervisors.
    pub restarts: usize,
    /// Times of the kills.
    pub at: Vec<Instant>,
}

impl Kills {
    /// Number of all kills.
    pub fn total(&self) -> usize {
        self.struck.values().sum()
    }
}

/// Time of a kill.
#[derive(Debug)]
pub(crate) enum Moment {
    /// This many polls, a millisecond apart, after the last kill: during start-up, connecting, resuming, any state.
    Polls(u64),
    /// This many polls after a process of the victim exists.
    Started(u64),
    /// When this many more barriers have started.
    Barriers(u64),
    /// This many polls after a stage starts to write a state.
    Saving(u64),
}

impl Moment {
    pub(crate) fn seeded(random: &mut Random) -> Self {
        match random.index(5) {
            0 => Self::Polls(below(random, 300)),
            1 => Self::Started(below(random, 100)),
            2 => Self::Saving(below(random, 4)),
            _ => Self::Barriers(1 + below(random, 2)),
        }
    }
}

/// Runs `launch` to its end with `n_kills` kills of these stages, of the supervisor and of all at once.
///
/// # Panics
/// If the run fails; the message lists the kills.
pub fn run_under_kills(launch: &Launch, stages: &[&str], n_kills: usize, random: &mut Random) -> Kills {
    let victims: Vec<&str> = stages.iter().copied().chain(["supervisor", "all"]).collect();
    let mut kills = Kills::default();
    let mut running = launch.start();
    let mut history = String::new();
    // Every victim once, the rest random.
    let mut queue: Vec<&str> = (0..n_kills).map(|i| *victims.get(i).unwrap_or(random.pick(&victims))).collect();
    let mut soon = false;
    while let Some(victim) = queue.pop() {
        let moment = if soon { Moment::Started(below(random, 150)) } else { Moment::seeded(random) };
        soon = false;
        write!(history, "{victim} {moment:?}, ").expect("a string takes everything");
        let awaited = await_moment(launch, &mut running, victim, &moment);
        if !awaited {
            // The run has ended before the kill. Another run takes its place, which can be disturbed if the next kill
            // follows soon.
            soon = true;
            kills.restarts += restarts(&running.stderr());
            let code = running.ended();
            assert_eq!(code, Some(Some(0)), "after {history}it ended with {}", running.stderr());
            running = launch.start_again(&["--overwrite"]);
            queue.push(victim);
            continue;
        }
        if victim == "supervisor" || victim == "all" {
            kills.restarts += restarts(&running.stderr());
            running.kill(victim == "all");
            running = launch.start_again(&["--resume"]);
            kills.resumed += 1;
        } else if let Some(pid) = running.find_stage(victim)
            && kill_process(pid, Signal::KILL).is_ok()
        {
        } else {
            queue.push(victim);
            continue;
        }
        kills.at.push(Instant::now());
        *kills.struck.entry(victim.to_owned()).or_default() += 1;
    }
    let mut last = None;
    crate::wait_for("the end of the run", || {
        last = running.ended();
        last
    });
    kills.restarts += restarts(&running.stderr());
    assert_eq!(last, Some(Some(0)), "after {history}it ended with {}", running.stderr());
    kills
}

fn below(random: &mut Random, n: usize) -> u64 {
    random.index(n) as u64
}

fn restarts(output_text: &str) -> usize {
    output_text.lines().filter(|line| line.starts_with("restart ")).count()
}

/// Waits for the moment; `false` if the run has ended before it.
pub(crate) fn await_moment(launch: &Launch, running: &mut Running, victim: &str, moment: &Moment) -> bool {
    let begun = Instant::now();
    let first_barrier = launch.newest_barrier().unwrap_or_default();
    let mut polls = 0;
    let mut left = None;
    loop {
        let come = match moment {
            Moment::Polls(n) => polls >= *n,
            Moment::Started(n) => {
                let is_stage = !["supervisor", "all", "recorder"].contains(&victim);
                let is_there = !is_stage || running.find_stage(victim).is_some();
                countdown(&mut left, is_there, *n)
            }
            Moment::Barriers(n) => launch.newest_barrier().unwrap_or_default() >= first_barrier + n,
            Moment::Saving(n) => {
                let newest = launch.newest_barrier().unwrap_or_default().to_string();
                countdown(&mut left, is_saving(&launch.states().join(newest)), *n)
            }
        };
        if come {
            return true;
        }
        if running.ended().is_some() {
            return false;
        }
        assert!(begun.elapsed() < TIMEOUT, "no {moment:?} of {victim}: {}", running.stderr());
        polls += 1;
        std::thread::park_timeout(Duration::from_millis(1));
    }
}

/// Counts `n` polls down from the first at which `begun` holds.
fn countdown(left: &mut Option<u64>, begun: bool, n: u64) -> bool {
    match left {
        None if begun => *left = Some(n),
        None => return false,
        Some(left) => *left = left.saturating_sub(1),
    }
    *left == Some(0)
}

fn is_saving(barrier: &Path) -> bool {
    let files = std::fs::read_dir(barrier).into_iter().flatten().flatten();
    files.into_iter().any(|file| file.path().extension().is_some_and(|extension| extension == "partial"))
}
