//! Lets the allocator of a stage keep what it frees.

use std::env::var_os;
use std::ffi::OsStr;
use std::process::Command;

/// Settings of glibc's allocator; other libraries ignore them.
const TUNABLES: &str = "GLIBC_TUNABLES";
/// The buffers of a sweep have up to some megabytes. By default each goes back to the kernel when it is freed, and the next sweep pays
/// for clearing its pages again: a twentieth of the CPU of a run. So buffers below 32 MiB, the largest threshold, stay with the process,
/// up to 64 MiB.
const KEEP_FREED: &str = "glibc.malloc.mmap_threshold=33554432:glibc.malloc.trim_threshold=67108864";
/// What a user may have set instead.
const OF_USER: [&str; 2] = ["MALLOC_MMAP_THRESHOLD_", "MALLOC_TRIM_THRESHOLD_"];

/// Sets the environment of a stage. Settings of the user stay.
pub(super) fn keep_freed_memory(command: &mut Command) {
    if OF_USER.iter().all(|name| var_os(name).is_none())
        && let Some(tunables) = tunables(var_os(TUNABLES).as_deref())
    {
        command.env(TUNABLES, tunables);
    }
}

/// The settings, added to those of the user; `None` if these concern the allocator.
fn tunables(of_user: Option<&OsStr>) -> Option<String> {
    match of_user.map(OsStr::to_str) {
        None => Some(KEEP_FREED.to_owned()),
        Some(Some(text)) if !text.contains("glibc.malloc.") => Some(format!("{text}:{KEEP_FREED}")),
        Some(_) => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_of_the_user_stay() {
        assert_eq!(tunables(None).as_deref(), Some(KEEP_FREED));
        let others = tunables(Some(OsStr::new("glibc.rtld.nns=2"))).expect("added");
        assert_eq!(others, format!("glibc.rtld.nns=2:{KEEP_FREED}"));
        assert_eq!(tunables(Some(OsStr::new("glibc.malloc.trim_threshold=1"))), None);
    }
}
