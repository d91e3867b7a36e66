//! Free and used resources of the machine: shared memory, disk, and the kernel's kills for lack of memory.

use crate::decision::Evidence;
use crate::decision::cause::mib;
use ipc::Domain;
use run::space::{MIN_SHARED_MEMORY, SHARED_MEMORY, free_bytes};
use std::path::{Path, PathBuf};

/// The resources that a run uses.
pub struct Resources {
    domain: Domain,
    output: PathBuf,
    /// Files that may contain the kernel's count of kills, the closest group first.
    oom_counters: Vec<PathBuf>,
    oom_kills: u64,
}

impl Resources {
    /// The resources of a run that starts now.
    pub fn new(domain: &Domain, output: &Path) -> Self {
        let groups = std::fs::read_to_string("/proc/self/cgroup").unwrap_or_default();
        Self::with_counters(domain, output, oom_counters(&groups))
    }

    fn with_counters(domain: &Domain, output: &Path, oom_counters: Vec<PathBuf>) -> Self {
        let oom_kills = oom_kills(&oom_counters);
        Self { domain: domain.clone(), output: output.to_owned(), oom_counters, oom_kills }
    }

    /// The current figures, for an observed fault.
    pub fn evidence(&mut self, log_lines: &[String]) -> Evidence {
        let now = oom_kills(&self.oom_counters);
        let before = std::mem::replace(&mut self.oom_kills, now);
        Evidence {
            log_lines: log_lines.to_vec(),
            has_kernel_killed: self.oom_kills > before,
            free_disk: free_bytes(&self.output),
            free_shared_memory: free_bytes(SHARED_MEMORY),
            used_shared_memory: self.domain.used_bytes(),
        }
    }
}

/// The reason why there is too little shared memory to start. Memory of `left_over` counts as free: it is removed
/// before the start.
pub fn lacks_shared_memory(left_over: Option<&Domain>) -> Option<String> {
    let Some(free) = free_bytes(SHARED_MEMORY) else {
        return Some(format!("shared memory: {SHARED_MEMORY} cannot be examined"));
    };
    let free = free + left_over.map_or(0, Domain::used_bytes);
    (free < MIN_SHARED_MEMORY).then(|| {
        let free = mib(Some(free));
        let needed = mib(Some(MIN_SHARED_MEMORY));
        format!("shared memory: {free} free in {SHARED_MEMORY}, a run needs at least {needed}")
    })
}

/// Processes that the kernel has killed for lack of memory: in the control group of this process, or else on the machine.
fn oom_kills(counters: &[PathBuf]) -> u64 {
    let count = |path: &PathBuf| count_in(&std::fs::read_to_string(path).ok()?);
    counters.iter().find_map(count).unwrap_or_default()
}

/// Files that may contain the count, the closest group first, from the content of /proc/self/cgroup.
fn oom_counters(groups: &str) -> Vec<PathBuf> {
    let in_group = groups.lines().filter_map(|line| {
        let mut fields = line.splitn(3, ':');
        fields.next()?;
        let controllers = fields.next()?;
        let path = fields.next()?.trim_end_matches('/');
        match controllers {
            "" => Some(format!("/sys/fs/cgroup{path}/memory.events").into()),
            "memory" => Some(format!("/sys/fs/cgroup/memory{path}/memory.oom_control").into()),
            _ => None,
        }
    });
    in_group.chain(["/proc/vmstat".into()]).collect()
}

/// The value of the line `oom_kill <n>`.
fn count_in(text: &str) -> Option<u64> {
    text.lines().find_map(|line| line.strip_prefix("oom_kill ")?.trim().parse().ok())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kills_of_the_kernel_are_counted_in_the_closest_group() {
        let v2 = oom_counters("0::/system.slice/run.service\n");
        assert_eq!(v2, ["/sys/fs/cgroup/system.slice/run.service/memory.events", "/proc/vmstat"].map(PathBuf::from));
        let v1 = oom_counters("8:pids:/\n4:memory:/\n0::/\n");
        assert_eq!(v1[0], PathBuf::from("/sys/fs/cgroup/memory/memory.oom_control"));
        assert_eq!(count_in("low 0\nhigh 0\noom 3\noom_kill 2\noom_group_kill 0\n"), Some(2));
        assert_eq!(count_in("oom_kill_disable 0\nunder_oom 0\noom_kill 5\n"), Some(5));
        assert_eq!(count_in("oom 3\n"), None);
    }

    #[test]
    fn kernel_is_blamed_only_for_kills_since_the_last_fault() {
        let folder = tempfile::tempdir().expect("a folder");
        let [absent, events, machine] = ["absent", "memory.events", "vmstat"].map(|name| folder.path().join(name));
        let write = |path: &Path, n: u64| std::fs::write(path, format!("oom 9\noom_kill {n}\n")).expect("written");
        write(&events, 3);
        write(&machine, 7);
        let domain = Domain::new("none").expect("a name");
        let counters = vec![absent, events.clone(), machine.clone()];
        let mut resources = Resources::with_counters(&domain, folder.path(), counters);
        assert!(!resources.evidence(&[]).has_kernel_killed, "kills before the run");
        write(&machine, 8);
        assert!(!resources.evidence(&[]).has_kernel_killed, "a kill outside the group");
        write(&events, 4);
        assert!(resources.evidence(&[]).has_kernel_killed);
        assert!(!resources.evidence(&[]).has_kernel_killed, "counted once");
    }
}
