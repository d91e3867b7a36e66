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
    oom_kills: u64,
}

impl Resources {
    /// For a run that begins now.
    pub fn new(domain: &Domain, output: &Path) -> Self {
        Self { domain: domain.clone(), output: output.to_owned(), oom_kills: oom_kills() }
    }

    /// The figures of this moment, at which a fault was observed.
    pub fn evidence(&mut self, log_lines: &[String]) -> Evidence {
        let before = std::mem::replace(&mut self.oom_kills, oom_kills());
        Evidence {
            log_lines: log_lines.to_vec(),
            has_kernel_killed: self.oom_kills > before,
            free_disk: free_bytes(&self.output),
            free_shared_memory: free_bytes(SHARED_MEMORY),
            used_shared_memory: self.domain.used_bytes(),
        }
    }
}

/// Why there is too little shared memory to start. What `left_over` holds counts as free: it is removed before the start.
pub fn lacks_shared_memory(left_over: Option<&Domain>) -> Option<String> {
    let Some(free) = free_bytes(SHARED_MEMORY) else {
        return Some(format!("shared memory: {SHARED_MEMORY} cannot be examined"));
    };
    let free = free + left_over.map_or(0, Domain::used_bytes);
    (free < MIN_SHARED_MEMORY).then(|| {
        let (free, needed) = (mib(Some(free)), mib(Some(MIN_SHARED_MEMORY)));
        format!("shared memory: {free} free in {SHARED_MEMORY}, a run needs at least {needed}")
    })
}

/// Processes that the kernel has killed for lack of memory: in the control group of this process, or else on the machine.
fn oom_kills() -> u64 {
    let groups = std::fs::read_to_string("/proc/self/cgroup").unwrap_or_default();
    let count = |path: &String| count_in(&std::fs::read_to_string(path).ok()?);
    oom_counts(&groups).iter().find_map(count).unwrap_or_default()
}

/// Files that may hold the count, the closest group first, from the content of /proc/self/cgroup.
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

    fn resources(oom_kills: u64) -> Resources {
        Resources { domain: Domain::new("none").expect("a name"), output: "/".into(), oom_kills }
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
    fn kernel_is_blamed_only_for_kills_since_the_last_fault() {
        let now = oom_kills();
        assert!(!resources(now + 1).evidence(&[]).has_kernel_killed);
        let mut since_boot = resources(0);
        // Only where the kernel has killed before.
        assert_eq!(since_boot.evidence(&[]).has_kernel_killed, now > 0);
        assert!(!since_boot.evidence(&[]).has_kernel_killed, "counted once");
    }
}
