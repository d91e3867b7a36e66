//! What was used up when a stage failed: disk, shared memory, memory. Said with the figures of that moment, because a moment
//! later they are others.

use crate::watch::Fault;
use ipc::Domain;
use rustix::fs::statvfs;
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::ExitStatus;

/// Where shared memory lies.
const SHARED_MEMORY: &str = "/dev/shm";

/// Free shared memory without which no run is begun, bytes: two submaps of 4 million points of 28 bytes with their
/// columns, once in work and once waiting.
const MIN_SHARED_MEMORY: u64 = 512 << 20;

/// Signals with a reason that can be named.
const SIGNALS: [(i32, &str); 7] = [
    (4, "SIGILL: an instruction that this processor does not have"),
    (6, "SIGABRT: an allocation that failed, or a panic within a panic"),
    (7, "SIGBUS: memory behind a mapped file was not there, as when shared memory is full"),
    (9, "signal 9: by someone, or by the kernel for lack of memory"),
    (11, "SIGSEGV: an address that is none"),
    (24, "SIGXCPU: its CPU time reached the limit (ulimit -t)"),
    (25, "SIGXFSZ: a file reached the largest size that is allowed (ulimit -f)"),
];

/// What the operating system's errors say in a stage's last words, and what helps.
const ERRORS: [(&str, &str); 4] = [
    ("(os error 27)", "a file reached the largest size that is allowed (ulimit -f)"),
    ("(os error 28)", "a disk is full: make room"),
    ("(os error 30)", "a file system is read-only: make it writable"),
    ("(os error 122)", "a disk quota is used up: make room"),
];

/// Name and reason of the signal that ended a process.
pub fn signal_text(signal: i32) -> String {
    let known = SIGNALS.iter().find(|(number, _)| *number == signal);
    known.map_or_else(|| format!("signal {signal}"), |(_, text)| (*text).to_owned())
}

/// The machine's means as a run sees them.
pub struct Means {
    domain: Domain,
    output: PathBuf,
    oom_kills: u64,
}

impl Means {
    /// Of a run that begins now.
    pub fn new(domain: &Domain, output: &Path) -> Self {
        Self { domain: domain.clone(), output: output.to_owned(), oom_kills: oom_kills() }
    }

    /// Adds to a fault what was used up, if something was. A full disk is not emptied by a restart, so there is none.
    pub fn explain(&mut self, fault: &mut Fault, status: Option<ExitStatus>, last_words: &[String]) {
        let signal = status.and_then(|status| status.signal());
        let before = std::mem::replace(&mut self.oom_kills, oom_kills());
        let cause = ERRORS.iter().find(|(number, _)| last_words.iter().any(|line| line.contains(number)));
        if let Some((_, cause)) = cause {
            let free = free_text(&self.output);
            add(fault, &format!("{cause}, then go on with --resume ({free} are free on the disk of the output)"));
            fault.may_restart = false;
        } else if signal == Some(7) {
            let used = mib(self.domain.used_bytes());
            add(fault, &format!("{} are free in {SHARED_MEMORY}, this run uses {used}", free_text(SHARED_MEMORY)));
        } else if signal == Some(9) && self.oom_kills > before {
            add(fault, "it was the kernel: memory had run out");
        } else if signal == Some(25) {
            add(fault, "raise the limit, then go on with --resume");
            fault.may_restart = false;
        }
    }
}

fn add(fault: &mut Fault, text: &str) {
    fault.text.push_str("; ");
    fault.text.push_str(text);
}

/// What is wrong if there is too little shared memory to start. What `left_over` holds counts as free: it is wiped first.
pub fn lacks_shared_memory(left_over: Option<&Domain>) -> Option<String> {
    let Some(free) = free_bytes(SHARED_MEMORY) else {
        return Some(format!("shared memory: {SHARED_MEMORY} cannot be examined"));
    };
    let free = free + left_over.map_or(0, Domain::used_bytes);
    (free < MIN_SHARED_MEMORY).then(|| {
        let (free, needed) = (mib(free), mib(MIN_SHARED_MEMORY));
        format!("shared memory: {free} are free in {SHARED_MEMORY}, at least {needed} are needed")
    })
}

fn free_bytes(path: impl AsRef<Path>) -> Option<u64> {
    statvfs(path.as_ref()).ok().map(|space| space.f_bavail * space.f_frsize)
}

fn free_text(path: impl AsRef<Path>) -> String {
    free_bytes(path).map_or_else(|| "an unknown amount".to_owned(), mib)
}

fn mib(bytes: u64) -> String {
    format!("{:.1} MiB", bytes as f64 / f64::from(1 << 20))
}

/// Processes that the kernel has killed for lack of memory: in this process's control group, or else on the machine.
fn oom_kills() -> u64 {
    let groups = std::fs::read_to_string("/proc/self/cgroup").unwrap_or_default();
    let count = |path: &String| count_in(&std::fs::read_to_string(path).ok()?);
    oom_counts(&groups).iter().find_map(count).unwrap_or_default()
}

/// Files that may hold the count, the closest first, from the content of /proc/self/cgroup.
fn oom_counts(groups: &str) -> Vec<String> {
    let in_group = groups.lines().filter_map(|line| {
        let mut fields = line.splitn(3, ':');
        let (_, controllers, path) = (fields.next()?, fields.next()?, fields.next()?.trim_end_matches('/'));
        match controllers {
            "" => Some(format!("/sys/fs/cgroup{path}/memory.events")),
            "memory" => Some(format!("/sys/fs/cgroup/memory{path}/memory.oom_control")),
            _ => None,
        }
    });
    in_group.chain(["/proc/vmstat".to_owned()]).collect()
}

/// The value of the line `oom_kill <n>`.
fn count_in(text: &str) -> Option<u64> {
    text.lines().find_map(|line| line.strip_prefix("oom_kill ")?.trim().parse().ok())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fault() -> Fault {
        Fault { stage: "relay".into(), text: "exit".into(), may_restart: true }
    }

    fn means(oom_kills: u64) -> Means {
        Means { domain: Domain::new("none").expect("a name"), output: "/".into(), oom_kills }
    }

    #[test]
    fn kills_of_the_kernel_are_counted_in_the_closest_group() {
        let v2 = oom_counts("0::/system.slice/run.service\n");
        assert_eq!(v2, ["/sys/fs/cgroup/system.slice/run.service/memory.events", "/proc/vmstat"]);
        let v1 = oom_counts("8:pids:/\n4:memory:/\n0::/\n");
        assert_eq!(v1[0], "/sys/fs/cgroup/memory/memory.oom_control");
        assert_eq!(count_in("low 0\nhigh 0\noom 3\noom_kill 2\noom_group_kill 0\n"), Some(2));
        assert_eq!(count_in("oom_kill_disable 0\nunder_oom 0\noom_kill 5\n"), Some(5));
        assert_eq!(count_in("oom 3\n"), None);
    }

    #[test]
    fn a_full_disk_is_named_and_not_restarted() {
        let mut full = fault();
        let words = ["ERROR stage: /out/run/states/3/relay.state: No space left on device (os error 28)".to_owned()];
        means(0).explain(&mut full, Some(ExitStatus::from_raw(1 << 8)), &words);
        assert!(full.text.contains("a disk is full: make room, then go on with --resume ("), "{}", full.text);
        assert!(!full.may_restart);
        let mut other = fault();
        means(0).explain(&mut other, Some(ExitStatus::from_raw(1 << 8)), &["os error 2".to_owned()]);
        assert_eq!(other, fault());
    }

    #[test]
    fn the_kernel_is_blamed_only_if_it_has_killed_since() {
        let now = oom_kills();
        let (mut by_someone, mut by_kernel) = (fault(), fault());
        means(now + 1).explain(&mut by_someone, Some(ExitStatus::from_raw(9)), &[]);
        assert_eq!(by_someone, fault());
        if now > 0 {
            means(0).explain(&mut by_kernel, Some(ExitStatus::from_raw(9)), &[]);
            assert_eq!(by_kernel.text, "exit; it was the kernel: memory had run out");
        }
    }
}
