//! Determines the permissions on this machine. A test that needs more is listed as ignored: the test harness can only
//! ignore tests that were ignored when it was compiled.
//!
//! | cfg | a test may |
//! |---|---|
//! | `mount_namespaces` | mount file systems in a namespace of its own (`unshare`) |
//! | `user_file_systems` | mount file systems of its own there (`/dev/fuse`) |
//! | `other_users` | start processes of another user |
//! | `network_namespaces` | connect its own networks by virtual cables (`unshare`, `ip` of Debian's iproute2) |
//! | `slurm` | start a SLURM of its own (Debian: `apt-get install slurmctld slurmd slurm-client munge`) |
//! | `object_store` | start an object store (`pip install awscli 'moto[server]'`) |
//! | `chromium` | open pages in Chromium (Debian: `apt-get install chromium`) |
//!
//! With `REPLICA_NAMESPACES=required` `mount_namespaces` and `other_users` are set, and with `REPLICA_CHROMIUM=required`
//! `chromium`, and with `REPLICA_SLURM=required` `slurm`: a test that is not allowed to do so, or lacks the program, then fails.

use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::path::Path;
use std::process::{Command, Stdio};

fn main() {
    println!("cargo::rerun-if-changed=tests/support/build.rs");
    let is_required = |variable: &str| {
        println!("cargo::rerun-if-env-changed={variable}");
        std::env::var(variable).is_ok_and(|value| value == "required")
    };
    let has_namespaces = is_required("REPLICA_NAMESPACES");
    let allowed = [
        ("mount_namespaces", has_namespaces || may_mount()),
        ("user_file_systems", may_mount() && may_serve_files()),
        ("other_users", has_namespaces || may_become_another_user()),
        ("network_namespaces", may_lay_cables()),
        ("slurm", is_required("REPLICA_SLURM") || has_slurm()),
        ("object_store", are_installed(&["aws", "moto_server"])),
        ("chromium", is_required("REPLICA_CHROMIUM") || has_chromium()),
    ];
    for (name, is_allowed) in allowed {
        println!("cargo::rustc-check-cfg=cfg({name})");
        if is_allowed {
            println!("cargo::rustc-cfg={name}");
        }
    }
}

/// Whether mounting is allowed: as the superuser, or as the root of a user namespace.
fn may_mount() -> bool {
    let mount = format!("mount -t tmpfs none '{}'", std::env::temp_dir().display());
    is_allowed_in(&["-m", "-rm"], &mount)
}

fn may_lay_cables() -> bool {
    is_allowed_in(&["-n", "-rn"], "ip link add near type veth peer name far")
}

fn is_allowed_in(kinds: &[&str], probe: &str) -> bool {
    kinds.iter().any(|kind| {
        let tried = Command::new("unshare").args([kind, "sh", "-c", probe]).stderr(Stdio::null()).status();
        tried.is_ok_and(|status| status.success())
    })
}

/// Whether SLURM is installed. Its daemons start jobs as the superuser.
fn has_slurm() -> bool {
    is_superuser() && are_installed(&["slurmctld", "slurmd", "sbatch", "munged"])
}

/// Whether the search path has all these programs. Some answer no option without a configuration.
fn are_installed(programs: &[&str]) -> bool {
    println!("cargo::rerun-if-env-changed=PATH");
    let path = std::env::var_os("PATH").unwrap_or_default();
    programs.iter().all(|program| std::env::split_paths(&path).any(|folder| folder.join(program).is_file()))
}

fn is_superuser() -> bool {
    std::fs::metadata("/proc/self").is_ok_and(|process| process.uid() == 0)
}

fn has_chromium() -> bool {
    let tried = Command::new("chromium").arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status();
    tried.is_ok_and(|status| status.success())
}

/// Whether `/dev/fuse` is usable. Support of the kernel is determined when a test mounts a file system.
fn may_serve_files() -> bool {
    std::fs::File::options().read(true).write(true).open("/dev/fuse").is_ok()
}

/// Whether other users are allowed: only for the superuser, and the other user must be able to read the programs.
fn may_become_another_user() -> bool {
    let programs = std::env::var("OUT_DIR").unwrap_or_default();
    let is_open = |folder: &Path| std::fs::metadata(folder).is_ok_and(|m| m.permissions().mode() & 0o001 != 0);
    is_superuser() && Path::new(&programs).ancestors().filter(|folder| !folder.as_os_str().is_empty()).all(is_open)
}
