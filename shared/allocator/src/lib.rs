//! Lets the allocator of a process keep freed memory.
//!
//! By default each buffer of some megabytes is returned to the kernel when it is freed, and the next one pays for
//! clearing its pages again: a twentieth of the CPU time of a run, a fifth of the CPU time of a training. The settings
//! apply to glibc; other libraries ignore them.
//!
//! Start reading at [`Keep`], which lists the two settings. The supervisor calls [`keep_freed_memory`] for the stages that it starts. A
//! tool with large buffers calls [`restart_with_kept_memory`] as the first thing in its `main`, because glibc reads its settings
//! before `main` begins.
//!
//! The crate must never change a setting of the user: if one of the allocator's variables is set, it does nothing. It
//! must never change a result, and never end a program: if the settings cannot be made, the program continues without
//! them and takes longer.

use std::env::{args_os, current_exe, var_os};
use std::ffi::OsStr;
use std::os::unix::process::CommandExt;
use std::process::Command;

const TUNABLES: &str = "GLIBC_TUNABLES";
/// Variables that a user may have set instead.
const OF_USER: [&str; 2] = ["MALLOC_MMAP_THRESHOLD_", "MALLOC_TRIM_THRESHOLD_"];

/// Amount of freed memory that a process keeps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Keep {
    /// Buffers below 32 MiB, up to 64 MiB: the buffers of a few sweeps.
    Sweeps,
    /// Buffers below 1 GiB, without a limit: activations of a training, records of a delivery.
    Large,
}

impl Keep {
    fn tunables(self) -> &'static str {
        match self {
            Self::Sweeps => "glibc.malloc.mmap_threshold=33554432:glibc.malloc.trim_threshold=67108864",
            Self::Large => "glibc.malloc.mmap_threshold=1073741824:glibc.malloc.trim_threshold=1099511627776",
        }
    }
}

/// Sets the environment of a process that will be started. Settings of the user are kept.
pub fn keep_freed_memory(command: &mut Command, keep: Keep) {
    if OF_USER.iter().all(|name| var_os(name).is_none())
        && let Some(tunables) = tunables(var_os(TUNABLES).as_deref(), keep)
    {
        command.env(TUNABLES, tunables);
    }
}

/// Starts this process again with the environment of [`keep_freed_memory`], unless the allocator already has settings.
/// Must be called first in `main`. If the program cannot be started again, it continues unchanged: the settings save only
/// time.
pub fn restart_with_kept_memory(keep: Keep) {
    let Ok(program) = current_exe() else { return };
    let mut command = Command::new(program);
    command.args(args_os().skip(1));
    keep_freed_memory(&mut command, keep);
    if command.get_envs().next().is_some() {
        // Returns only on failure.
        let _ = command.exec();
    }
}

/// The settings, added to the settings of the user; `None` if the user's settings concern the allocator.
fn tunables(of_user: Option<&OsStr>, keep: Keep) -> Option<String> {
    match of_user.map(OsStr::to_str) {
        None => Some(keep.tunables().to_owned()),
        Some(Some(text)) if !text.contains("glibc.malloc.") => Some(format!("{text}:{}", keep.tunables())),
        Some(_) => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_of_the_user_stay() {
        let kept = Keep::Sweeps.tunables();
        assert_eq!(tunables(None, Keep::Sweeps).as_deref(), Some(kept));
        let others = tunables(Some(OsStr::new("glibc.rtld.nns=2")), Keep::Sweeps).expect("added");
        assert_eq!(others, format!("glibc.rtld.nns=2:{kept}"));
        assert_eq!(tunables(Some(OsStr::new("glibc.malloc.trim_threshold=1")), Keep::Large), None);
    }
}
