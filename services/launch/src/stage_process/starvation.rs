//! Time in which a stage could not work because other programs had the processors.
//!
//! A healthy stage on a loaded machine takes many times longer for a step. Only time in which it waits for something
//! else, or has a processor, counts for `hang_s` and `stall_s`.

use std::time::{Duration, Instant};

/// Shortest interval that is judged: the kernel counts processor time in hundredths of a second.
const INTERVAL: Duration = Duration::from_secs(1);
/// Unit of processor times in /proc (`USER_HZ`, 100 on every platform of Linux that Rust supports).
const TICK: Duration = Duration::from_millis(10);
/// Positions in /proc/[pid]/stat after the name of the program.
const STATE: usize = 0;
const USER_TIME: usize = 11;
const SYSTEM_TIME: usize = 12;

/// Observation of a process from one look to the next.
#[derive(Default)]
pub struct Starvation {
    interval: Option<Interval>,
}

/// An interval that is not judged yet.
struct Interval {
    begun: Instant,
    /// Processor time of the process at its beginning.
    processor_time: Duration,
    /// Sum over the looks of the number of threads that had or wanted a processor.
    runnable: usize,
    looks: usize,
}

/// The state of a process at one moment.
struct Look {
    processor_time: Duration,
    /// Threads that have or want a processor.
    runnable: usize,
}

impl Starvation {
    /// Looks at a process. Once a second: the part of the past interval in which it waited for a processor. Zero
    /// without /proc.
    pub fn look(&mut self, pid: u32) -> Duration {
        let Some(look) = Look::at(pid) else { return Duration::ZERO };
        let n_processors = std::thread::available_parallelism().map_or(1, usize::from);
        self.add(&look, Instant::now(), n_processors)
    }

    fn add(&mut self, look: &Look, now: Instant, n_processors: usize) -> Duration {
        let start = Interval { begun: now, processor_time: look.processor_time, runnable: 0, looks: 0 };
        let interval = self.interval.get_or_insert(start);
        interval.runnable += look.runnable.min(n_processors);
        interval.looks += 1;
        let seconds = now.duration_since(interval.begun);
        if seconds < INTERVAL {
            return Duration::ZERO;
        }
        let wanted = seconds.mul_f64(interval.runnable as f64 / interval.looks as f64);
        let had = look.processor_time.saturating_sub(interval.processor_time);
        self.interval = None;
        let missing_share = 1.0 - had.div_duration_f64(wanted.max(TICK)).min(1.0);
        // A process that waits for something else most of the time lacks a processor only in the rest.
        seconds.min(wanted).mul_f64(missing_share)
    }
}

/// The load of the machine in words.
pub fn load() -> String {
    let n_processors = std::thread::available_parallelism().map_or(1, usize::from);
    let text = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
    match text.split(' ').next() {
        Some(load) if !load.is_empty() => format!("load average {load} on {n_processors} processors"),
        _ => format!("{n_processors} processors"),
    }
}

impl Look {
    fn at(pid: u32) -> Option<Self> {
        let folder = format!("/proc/{pid}");
        let process = Fields::read(&format!("{folder}/stat"))?;
        let ticks = process.number(USER_TIME)? + process.number(SYSTEM_TIME)?;
        let threads = std::fs::read_dir(format!("{folder}/task")).ok()?.flatten();
        let is_runnable = |thread: &std::fs::DirEntry| {
            let stat = Fields::read(&thread.path().join("stat").to_string_lossy());
            stat.is_some_and(|stat| stat.text(STATE) == Some("R"))
        };
        let runnable = threads.filter(is_runnable).count();
        Some(Self { processor_time: TICK * u32::try_from(ticks).ok()?, runnable })
    }
}

/// A file `stat` of /proc after the name of the program.
struct Fields(String);

impl Fields {
    fn read(path: &str) -> Option<Self> {
        let text = std::fs::read_to_string(path).ok()?;
        // The name of the program, in parentheses, may contain spaces.
        Some(Self(text.rsplit_once(") ")?.1.to_owned()))
    }

    fn text(&self, position: usize) -> Option<&str> {
        self.0.split_ascii_whitespace().nth(position)
    }

    fn number(&self, position: usize) -> Option<u64> {
        self.text(position)?.parse().ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Time lost in 2 s in which the threads had this processor time, s.
    fn lost(runnable: usize, processor_s: f64, n_processors: usize) -> f64 {
        let begun = Instant::now();
        let mut starvation = Starvation::default();
        let mut look = Look { processor_time: Duration::from_secs(7), runnable };
        assert_eq!(starvation.add(&look, begun, n_processors), Duration::ZERO);
        look.processor_time += Duration::from_secs_f64(processor_s);
        starvation.add(&look, begun + Duration::from_secs(2), n_processors).as_secs_f64()
    }

    #[test]
    fn time_without_a_processor_is_lost() {
        assert!((lost(1, 0.2, 2) - 1.8).abs() < 1e-9, "one thread with a tenth of a processor");
        assert!((lost(2, 1.0, 2) - 1.5).abs() < 1e-9, "two threads with half a processor");
    }

    #[test]
    fn work_and_waits_for_other_things_are_not_lost() {
        assert_eq!(lost(1, 2.0, 2), 0.0, "an endless loop");
        assert_eq!(lost(16, 4.0, 2), 0.0, "more threads than processors");
        assert_eq!(lost(0, 0.0, 2), 0.0, "waits for a disk or for another process");
    }

    #[test]
    fn own_process_is_runnable_and_uses_processor_time() {
        let before = Look::at(std::process::id()).expect("/proc");
        let begun = Instant::now();
        // Some hundredths of a second of work, on a busy machine later.
        let mut after = Look::at(std::process::id()).expect("/proc");
        while after.processor_time == before.processor_time && begun.elapsed() < Duration::from_mins(1) {
            after = Look::at(std::process::id()).expect("/proc");
        }
        assert!(after.runnable >= 1 && after.processor_time > before.processor_time);
    }

    #[test]
    fn absent_process_loses_nothing() {
        assert!(Look::at(u32::MAX).is_none());
        assert_eq!(Starvation::default().look(u32::MAX), Duration::ZERO);
    }
}
