//! Cores, instructions and memory.

use super::check::{Check, State, at_least};
use run::space::size_text;
use std::thread::available_parallelism;

/// Memory that is available to a run, bytes. The sample drive takes 1.0 GB: `peak_private_bytes` of all stages and
/// `peak_shared_memory_bytes` in its summary.json. Queues of full submaps take up to 1 GB more.
const LEAST_MEMORY: u64 = 2_000_000_000;
const GOOD_MEMORY: u64 = 4_000_000_000;

/// The checks.
pub fn checks() -> [Check; 3] {
    [cores(), instructions(), memory()]
}

fn cores() -> Check {
    let n_cores = available_parallelism().map_or(1, usize::from);
    Check::ok("cores", n_cores.to_string(), "at least 2")
        .or(at_least(&n_cores, &1, &2), || "on one core a run takes more than twice the time".to_owned())
}

/// The vector instructions for which kernels are compiled (crate `wide_loops`).
fn instructions() -> Check {
    let VectorInstructions { found, state } = vectors();
    Check::ok("instructions", found, "AVX2 and FMA or more on x86-64: loops take 8 numbers at once").or(state, || {
        "the loops take 4 numbers at once; in a virtual machine let the guest see the host's processor".to_owned()
    })
}

/// Vector instructions of the processor.
struct VectorInstructions {
    found: &'static str,
    state: State,
}

#[cfg(target_arch = "x86_64")]
fn vectors() -> VectorInstructions {
    let has_v3 = is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma");
    match (is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512dq"), has_v3) {
        (true, true) => VectorInstructions { found: "AVX-512", state: State::Ok },
        (_, true) => VectorInstructions { found: "AVX2", state: State::Ok },
        _ => VectorInstructions { found: "SSE2", state: State::Warning },
    }
}

#[cfg(not(target_arch = "x86_64"))]
fn vectors() -> VectorInstructions {
    VectorInstructions { found: "as compiled", state: State::Ok }
}

fn memory() -> Check {
    let meminfo = std::fs::read_to_string("/proc/meminfo").unwrap_or_default();
    let Some(available) = available_bytes(&meminfo) else {
        return Check::ok("memory", "unknown: /proc/meminfo cannot be read", "readable")
            .or(State::Warning, || "mount /proc".to_owned());
    };
    let rule = format!("at least {}, better {}", size_text(LEAST_MEMORY), size_text(GOOD_MEMORY));
    Check::ok("memory", format!("{} available", size_text(available)), rule)
        .or(at_least(&available, &LEAST_MEMORY, &GOOD_MEMORY), || {
            "end other programs, or leave stages out with --without".to_owned()
        })
}

/// The line `MemAvailable:   12345 kB`.
fn available_bytes(meminfo: &str) -> Option<u64> {
    let line = meminfo.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    let kib: u64 = line.split_whitespace().next()?.parse().ok()?;
    Some(kib << 10)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn available_memory_is_read_in_bytes() {
        assert_eq!(available_bytes("MemTotal: 9 kB\nMemAvailable:    2048 kB\n"), Some(2 << 20));
        assert_eq!(available_bytes("MemTotal: 9 kB\n"), None);
    }
}
