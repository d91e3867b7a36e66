//! Sets `REPLICA_VERSION`, which `--version` prints: the version of the package, and the commit that it was built from.
//!
//! The commit comes from the checkout, or else from the variable `REPLICA_COMMIT` (for source without its history), or
//! else is left out. It changes, and the program is compiled again, only with a new commit. Uncommitted changes are not
//! marked: finding them would require compiling again after each edit of any file.

use std::path::Path;
use std::process::Command;

fn main() {
    println!("cargo::rerun-if-env-changed=REPLICA_COMMIT");
    // HEAD names a branch or a commit; its log changes with each commit and checkout. Without logs, the branch has a file, or is a
    // line of packed-refs.
    let branch = git(&["symbolic-ref", "HEAD"]).unwrap_or_default();
    for file in ["HEAD", "logs/HEAD", &branch, "packed-refs"] {
        let path = git(&["rev-parse", "--git-path", file]).filter(|path| Path::new(path).is_file());
        // A missing file would run this script each time.
        if let Some(path) = path {
            println!("cargo::rerun-if-changed={path}");
        }
    }
    let commit = git(&["log", "-1", "--abbrev=10", "--format=%h %cs"]).or_else(|| std::env::var("REPLICA_COMMIT").ok());
    let version = std::env::var("CARGO_PKG_VERSION").unwrap_or_default();
    let commit = commit.filter(|commit| !commit.is_empty()).map(|commit| format!(" ({commit})")).unwrap_or_default();
    println!("cargo::rustc-env=REPLICA_VERSION={version}{commit}");
}

/// The answer of git; `None` outside of a checkout and without git.
fn git(arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").args(arguments).output().ok().filter(|output| output.status.success())?;
    Some(String::from_utf8(output.stdout).ok()?.trim().to_owned())
}
