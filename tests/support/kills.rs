//! SIGKILL at seeded moments: of one stage, of the supervisor, of all processes at once.

use crate::{Launch, Random, Running};
use rustix::process::{Signal, kill_process};
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;
use std::time::{Duration, Instant};

/// A moment that has not come after so long never comes; a fault of the test or a run that stands.
const PATIENCE: Duration = Duration::from_mins(5);

/// What a run had to stand.
#[derive(Debug, Default)]
pub struct Kills {
    /// By victim: a stage, `supervisor` or `all`.
    pub struck: BTreeMap<String, usize>,
    /// Times that the run was gone on with by `--resume`.
    pub resumed: usize,
    /// Restarts that supervisors made.
    pub restarts: usize,
}

impl Kills {
    /// All of them.
    pub fn total(&self) -> usize {
        self.struck.values().sum()
    }
}

/// When a kill strikes.
#[derive(Debug)]
enum Moment {
    /// So many looks, a millisecond apart, after the one before: during start-up, connecting, resuming, whatever it hits.
    Looks(u64),
    /// So many looks after a process of the victim is there.
    Started(u64),
    /// When so many more barriers have begun.
    Barriers(u64),
    /// When somebody writes a state; so many looks later.
    Saving(u64),
}

impl Moment {
    fn seeded(random: &mut Random) -> Self {
        match random.below(5) {
            0 => Self::Looks(random.below(300)),
            1 => Self::Started(random.below(100)),
            2 => Self::Saving(random.below(4)),
            _ => Self::Barriers(1 + random.below(2)),
        }
    }
}

/// Runs `launch` to its end under `n_kills` kills of these stages, of the supervisor and of all at once.
///
/// # Panics
/// If the run ends otherwise than well; the message tells what was killed when.
pub fn run_under_kills(launch: &Launch, stages: &[&str], n_kills: usize, random: &mut Random) -> Kills {
    let victims: Vec<&str> = stages.iter().copied().chain(["supervisor", "all"]).collect();
    let mut kills = Kills::default();
    let mut running = launch.start();
    let mut history = String::new();
    // Every victim in turn, so that none is spared, the rest by chance.
    let mut queue: Vec<&str> = (0..n_kills).map(|i| *victims.get(i).unwrap_or(random.choose(&victims))).collect();
    let mut soon = false;
    while let Some(victim) = queue.pop() {
        let moment = if soon { Moment::Started(random.below(150)) } else { Moment::seeded(random) };
        soon = false;
        write!(history, "{victim} {moment:?}, ").expect("a string takes everything");
        let awaited = await_moment(launch, &mut running, victim, &moment);
        if !awaited {
            // The run has ended before its time; what follows the last barrier is done again, and can be disturbed again, if
            // the next kill comes soon.
            soon = true;
            kills.restarts += restarts(&running.stderr());
            let code = running.ended();
            assert_eq!(code, Some(Some(0)), "after {history}it ended with {}", running.stderr());
            running = launch.start_again(&["--resume"]);
            kills.resumed += 1;
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

fn restarts(said: &str) -> usize {
    said.lines().filter(|line| line.starts_with("restart ")).count()
}

/// Waits for the moment; `false` if the run has ended before.
fn await_moment(launch: &Launch, running: &mut Running, victim: &str, moment: &Moment) -> bool {
    let begun = Instant::now();
    let first_barrier = launch.newest_barrier().unwrap_or_default();
    let mut looks = 0;
    let mut left = None;
    loop {
        let come = match moment {
            Moment::Looks(n) => looks >= *n,
            Moment::Started(n) => {
                let is_there = victim == "supervisor" || victim == "all" || running.find_stage(victim).is_some();
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
        assert!(begun.elapsed() < PATIENCE, "waited in vain for {moment:?} of {victim}: {}", running.stderr());
        looks += 1;
        std::thread::park_timeout(Duration::from_millis(1));
    }
}

/// Counts `n` looks down from the first at which `begun` holds.
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
