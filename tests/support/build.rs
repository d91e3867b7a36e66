//! Finds out what this machine allows. A test that needs more is listed as ignored: the test harness can only ignore what was
//! ignored when it was compiled.
//!
//! | cfg | a test may |
//! |---|---|
//! | `mount_namespaces` | mount file systems in a namespace of its own (`unshare`) |
//! | `other_users` | start processes of another user |
//!
//! With `REPLICA_NAMESPACES=required` both are set, and a test that is not allowed to do so fails.

use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::path::Path;
use std::process::{Command, Stdio};

fn main() {
    println!("cargo::rerun-if-changed=tests/support/build.rs");
    println!("cargo::rerun-if-env-changed=REPLICA_NAMESPACES");
    let is_required = std::env::var("REPLICA_NAMESPACES").is_ok_and(|value| value == "required");
    for (name, is_allowed) in [("mount_namespaces", may_mount()), ("other_users", may_become_another_user())] {
        println!("cargo::rustc-check-cfg=cfg({name})");
        if is_allowed || is_required {
            println!("cargo::rustc-cfg={name}");
        }
    }
}

/// As the superuser, or as the root of a user namespace.
fn may_mount() -> bool {
    let mount = format!("mount -t tmpfs none '{}'", std::env::temp_dir().display());
    ["-m", "-rm"].iter().any(|kind| {
        let tried = Command::new("unshare").args([kind, "sh", "-c", &mount]).stderr(Stdio::null()).status();
        tried.is_ok_and(|status| status.success())
    })
}

/// Only the superuser may, and the other user must be able to read the programs.
fn may_become_another_user() -> bool {
    let is_superuser = std::fs::metadata("/proc/self").is_ok_and(|process| process.uid() == 0);
    let programs = std::env::var("OUT_DIR").unwrap_or_default();
    let is_open = |folder: &Path| std::fs::metadata(folder).is_ok_and(|m| m.permissions().mode() & 0o001 != 0);
    is_superuser && Path::new(&programs).ancestors().filter(|folder| !folder.as_os_str().is_empty()).all(is_open)
}
