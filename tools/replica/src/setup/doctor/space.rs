//! Shared memory, leftovers of killed runs in it, and the disk of the results.

use super::check::{Check, State, at_least};
use super::programs::PlannedRun;
use ipc::Domain;
use run::space::{MIN_SHARED_MEMORY, SHARED_MEMORY, free_bytes, size_text};
use run::wiring::Wiring;
use std::path::{Path, PathBuf};

/// Shared memory with which queues never wait for room, bytes.
const GOOD_SHARED_MEMORY: u64 = 2 << 30;

/// Free disk if no launch file states the need of its drive, bytes: one and ten minutes of an HDL-32E with all columns.
const LEAST_DISK: u64 = 3_000_000_000;
const GOOD_DISK: u64 = 30_000_000_000;

/// Free disk as a multiple of the estimated size of the clouds; the estimate is wrong by up to a half.
const LEAST_SHARE: f64 = 1.0;
const GOOD_SHARE: f64 = 1.5;

/// The checks.
pub fn shared_memory() -> [Check; 2] {
    [free_shared_memory(), leftovers()]
}

fn free_shared_memory() -> Check {
    let rule = format!("at least {}, better {}", size_text(MIN_SHARED_MEMORY), size_text(GOOD_SHARED_MEMORY));
    let Some(free) = free_bytes(SHARED_MEMORY) else {
        return Check::ok("shared memory", format!("{SHARED_MEMORY} cannot be examined"), rule)
            .or(State::Problem, || format!("mount a tmpfs at {SHARED_MEMORY}"));
    };
    Check::ok("shared memory", format!("{} free in {SHARED_MEMORY}", size_text(free)), rule).or(
        at_least(&free, &MIN_SHARED_MEMORY, &GOOD_SHARED_MEMORY),
        || {
            "as superuser: mount -o remount,size=4G /dev/shm; in a container: --shm-size=4g (Docker, Podman), or an emptyDir \
             with medium Memory (Kubernetes)"
                .to_owned()
        },
    )
}

/// Shared memory of killed runs without a living supervisor.
fn leftovers() -> Check {
    let rule = "none of this user's killed runs";
    let domains = match Domain::all_own() {
        Ok(domains) => domains,
        Err(error) => {
            return Check::ok("leftovers", error.to_string(), rule).or(State::Warning, || "see ls /dev/shm".to_owned());
        }
    };
    let is_alive = |domain: &Domain, output: &Path| {
        Wiring::read(output).is_ok_and(|wiring| wiring.domain == domain.name() && wiring.is_alive(output))
    };
    let left =
        domains.iter().filter(|(domain, output)| !output.as_deref().is_some_and(|output| is_alive(domain, output)));
    let left: Vec<&(Domain, _)> = left.collect();
    let bytes: u64 = left.iter().map(|(domain, _)| domain.used_bytes()).sum();
    let found = if left.is_empty() { "none".to_owned() } else { format!("{} runs, {}", left.len(), size_text(bytes)) };
    let advice = || {
        let of_run = |(domain, output): &&(Domain, Option<PathBuf>)| {
            let output = output.as_ref().map(|output| format!("   # of {}", output.display())).unwrap_or_default();
            format!("rm -r {}*{output}", domain.root().display())
        };
        let commands: Vec<String> = left.iter().map(of_run).collect();
        format!("continue them with --resume, or remove their memory:\n{}", commands.join("\n"))
    };
    let state = if left.is_empty() { State::Ok } else { State::Warning };
    Check::ok("leftovers", found, rule).or(state, advice)
}

/// Free space for the results.
pub fn disk(output: &Path, planned: Option<&PlannedRun>) -> Check {
    let place = output.display();
    let Some(free) = free_bytes(output) else {
        return Check::ok("disk", format!("{place} cannot be examined"), "free space for the results")
            .or(State::Warning, || "name an existing folder with --output".to_owned());
    };
    let found = format!("{} free in {place}", size_text(free));
    let advice = || "make room, or set another run.output".to_owned();
    let Some(need) = planned.and_then(PlannedRun::space_need) else {
        let rule = format!(
            "at least {}, better {}; with a launch file: what its drive needs",
            size_text(LEAST_DISK),
            size_text(GOOD_DISK)
        );
        return Check::ok("disk", found, rule).or(at_least(&free, &LEAST_DISK, &GOOD_DISK), advice);
    };
    let millions = need.points as f64 * 1e-6;
    let rule = format!("clouds of about {millions:.1} million points take {}", size_text(need.bytes));
    let share = free as f64 / need.bytes.max(1) as f64;
    Check::ok("disk", found, rule).or(at_least(&share, &LEAST_SHARE, &GOOD_SHARE), advice)
}
