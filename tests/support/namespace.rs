//! Mounts that nobody else sees: a test runs itself again in a mount namespace of its own.

use std::path::Path;
use std::process::{Command, Stdio};

/// Says to the test that it is the one inside.
const INSIDE: &str = "REPLICA_TEST_IN_NAMESPACE";

/// Whether the test `name` (as `cargo test` calls it) runs in a mount namespace of its own, where it may mount what it
/// likes. If not, it is run again in one, and there is nothing left to do here. Where the system allows no namespace the
/// test is skipped, and says so.
pub fn in_own_namespace(name: &str) -> bool {
    if std::env::var_os(INSIDE).is_some() {
        return true;
    }
    // As root without more; as somebody else as the root of a user namespace.
    let kinds = ["-m", "-rm"];
    let allowed = |kind: &&&str| {
        let mount = format!("mount -t tmpfs none '{}'", std::env::temp_dir().display());
        let tried = Command::new("unshare").args([kind, "sh", "-c", &mount]).stderr(Stdio::null()).status();
        tried.is_ok_and(|status| status.success())
    };
    let Some(kind) = kinds.iter().find(allowed) else {
        println!("skipped {name}: no mount namespace can be made here (unshare)");
        return false;
    };
    let own = std::env::current_exe().expect("a test has a path");
    let status = Command::new("unshare")
        .arg(kind)
        .arg(own)
        .args(["--exact", name, "--nocapture"])
        .env(INSIDE, "1")
        .status()
        .expect("unshare starts");
    assert!(status.success(), "{name} has failed in its namespace");
    false
}

/// Mounts an empty file system of this size on a folder, which is made.
pub fn mount_tmpfs(folder: &Path, bytes: u64) {
    std::fs::create_dir_all(folder).expect("a folder");
    mount(&["-t", "tmpfs", "-o", &format!("size={bytes}"), "none"], folder);
}

/// Gives a mounted file system another size.
pub fn resize_tmpfs(folder: &Path, bytes: u64) {
    mount(&["-o", &format!("remount,size={bytes}")], folder);
}

fn mount(arguments: &[&str], folder: &Path) {
    let status = Command::new("mount").args(arguments).arg(folder).status().expect("mount starts");
    assert!(status.success(), "mount {arguments:?} {}: {status}", folder.display());
}
