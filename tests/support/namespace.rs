//! Mounts and networks that are invisible to other processes: a test runs itself again in its own namespace.

use std::path::Path;
use std::process::{Command, ExitStatus, Stdio};

/// Set for the test inside the namespace.
const INSIDE: &str = "REPLICA_TEST_IN_NAMESPACE";

/// Whether the calling test runs in its own mount namespace, where it may mount anything. If not, it is run again in
/// one, and the caller returns. Use [`crate::in_own_namespace!`].
///
/// # Panics
/// If no namespace can be created, or if the test fails in it.
pub fn runs_in_own_namespace(test: &str) -> bool {
    runs_again(test, again_in_namespace)
}

/// [`runs_in_own_namespace`] with a separate network, in which the test may create cables.
///
/// # Panics
/// See [`runs_in_own_namespace`].
pub fn runs_in_own_network(test: &str) -> bool {
    runs_again(test, || again_in(&["-n", "-rn"], "ip link add near type veth peer name far"))
}

fn runs_again(test: &str, again: impl FnOnce() -> Command) -> bool {
    if std::env::var_os(INSIDE).is_some() {
        return true;
    }
    // The test harness names a test without the crate.
    let test = test.split_once("::").map_or(test, |(_, test)| test);
    let output = again().args(["--exact", test, "--nocapture", "--include-ignored"]).output().expect("unshare starts");
    let stdout = String::from_utf8_lossy(&output.stdout);
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{test} has failed in its namespace:\n{stdout}{stderr}");
    assert!(stdout.contains("1 passed"), "the test binary has no test {test}:\n{stdout}");
    false
}

/// Runs a program that is not a test in its own namespace. Returns `None` inside the namespace; otherwise runs the
/// program again in one, with the same arguments, and returns its exit status.
pub fn run_in_own_namespace() -> Option<ExitStatus> {
    if std::env::var_os(INSIDE).is_some() {
        return None;
    }
    Some(again_in_namespace().args(std::env::args_os().skip(1)).status().expect("unshare starts"))
}

/// This program, without arguments, in a separate mount namespace.
fn again_in_namespace() -> Command {
    let mount = format!("mount -t tmpfs none '{}'", std::env::temp_dir().display());
    again_in(&["-m", "-rm"], &mount)
}

/// This program, without arguments, in a namespace of the first of these kinds in which the shell command succeeds: as
/// the superuser; or as the root of a user namespace.
fn again_in(kinds: &[&str], probe: &str) -> Command {
    let allowed = |kind: &&&str| {
        let tried = Command::new("unshare").args([kind, "sh", "-c", probe]).stderr(Stdio::null()).status();
        tried.is_ok_and(|status| status.success())
    };
    let kind = kinds.iter().find(allowed).unwrap_or_else(|| panic!("no namespace allows {probe} here (unshare)"));
    let mut command = Command::new("unshare");
    command.arg(kind).arg(std::env::current_exe().expect("a program has a path")).env(INSIDE, "1");
    command
}

/// See [`runs_in_own_namespace`]; takes the name of the calling test.
#[macro_export]
macro_rules! in_own_namespace {
    ($test:literal) => {
        $crate::runs_in_own_namespace(concat!(module_path!(), "::", $test))
    };
}

/// Creates a folder and mounts an empty file system of this size on it.
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

/// [`in_own_namespace!`] with a separate network.
#[macro_export]
macro_rules! in_own_network {
    ($test:literal) => {
        $crate::runs_in_own_network(concat!(module_path!(), "::", $test))
    };
}

/// The end of a cable to the network of another process.
pub struct Cable;

impl Cable {
    /// A cable from `near`, in this network, with the address 10.77.0.1, to `far` with [`Cable::FAR`] in the network of
    /// a process.
    pub fn to(process: u32) -> Self {
        let process = process.to_string();
        ip(&["link", "add", "near", "type", "veth", "peer", "name", "far", "netns", &process]);
        ip(&["address", "add", "10.77.0.1/24", "dev", "near"]);
        ip(&["link", "set", "near", "up"]);
        let there = |arguments: &[&str]| call("nsenter", &[&["-t", &process, "-n", "ip"][..], arguments].concat());
        there(&["address", "add", &format!("{}/24", Self::FAR), "dev", "far"]);
        there(&["link", "set", "far", "up"]);
        Self
    }
    /// The address of the other end.
    pub const FAR: &str = "10.77.0.2";
    /// Interrupts the cable: nothing arrives at either end, and neither end is notified.
    pub fn pull(&self) {
        ip(&["link", "set", "near", "down"]);
    }
    /// Undoes [`Cable::pull`].
    pub fn plug_in(&self) {
        ip(&["link", "set", "near", "up"]);
    }
}

fn ip(arguments: &[&str]) {
    call("ip", arguments);
}

fn call(program: &str, arguments: &[&str]) {
    let status = Command::new(program).args(arguments).status().expect("iproute2 and util-linux are installed");
    assert!(status.success(), "{program} {arguments:?}: {status}");
}
