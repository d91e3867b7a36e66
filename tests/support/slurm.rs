//! A SLURM of three nodes on this machine: controller, node daemons and authentication in a folder of its own.

use crate::wait_for;
use std::fmt::Write;
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// Names of the nodes. A job that asks for two processors has a node of its own.
const NODES: [&str; 3] = ["n1", "n2", "n3"];

/// The cluster. Dropping it ends its daemons, but not the processes of jobs.
pub struct Slurm {
    folder: tempfile::TempDir,
}

impl Slurm {
    /// Starts the daemons and waits until all nodes are idle. Only the superuser may.
    pub fn start() -> Self {
        let cluster = Self { folder: tempfile::tempdir().expect("a folder") };
        let path = |name: &str| cluster.folder.path().join(name);
        for folder in ["state", "log", "spool/n1", "spool/n2", "spool/n3"] {
            std::fs::create_dir_all(path(folder)).expect("made");
        }
        std::fs::write(cluster.configuration(), cluster.text()).expect("written");
        let key: Vec<u8> = (0..1024_u32).map(|k| (k * 31 % 251) as u8).collect();
        std::fs::write(path("munge.key"), key).expect("written");
        set_mode(&path("munge.key"), 0o600);
        // Jobs of other users would also enter it.
        set_mode(cluster.folder.path(), 0o755);
        let mut authentication = Command::new("munged");
        authentication.arg("--force");
        for (option, file) in [
            ("socket", "munge.socket"),
            ("key-file", "munge.key"),
            ("pid-file", "munge.pid"),
            ("log-file", "log/munge.log"),
            ("seed-file", "munge.seed"),
        ] {
            authentication.arg(format!("--{option}={}", path(file).display()));
        }
        assert!(authentication.status().expect("munge is installed").success());
        assert!(cluster.daemon("slurmctld").arg("-c").status().expect("slurmctld is installed").success());
        for node in NODES {
            cluster.start_node(node);
        }
        wait_for("three idle nodes", || {
            let nodes = cluster.command("sinfo").args(["--noheader", "--Node", "--format=%N %T"]).output().ok()?;
            (String::from_utf8_lossy(&nodes.stdout).matches(" idle").count() == NODES.len()).then_some(())
        });
        cluster
    }
    /// The configuration file, which the variable `SLURM_CONF` names.
    pub fn configuration(&self) -> PathBuf {
        self.folder.path().join("slurm.conf")
    }
    /// A command with this cluster.
    pub fn command(&self, program: impl AsRef<std::ffi::OsStr>) -> Command {
        let mut command = Command::new(program);
        command.env("SLURM_CONF", self.configuration());
        command
    }
    /// Runs a command of SLURM, which must succeed.
    pub fn ask(&self, program: &str, arguments: &[&str]) -> String {
        let output = self.command(program).args(arguments).output().expect("SLURM is installed");
        assert!(output.status.success(), "{program} {arguments:?}: {}", text(&output));
        text(&output)
    }
    /// Starts the daemon of a node.
    pub fn start_node(&self, node: &str) {
        assert!(self.daemon("slurmd").args(["-N", node]).status().expect("slurmd is installed").success());
    }
    /// Kills the daemon of a node. The processes of its jobs live on, as after a failure of its network.
    pub fn kill_node(&self, node: &str) {
        let file = self.folder.path().join(format!("slurmd-{node}.pid"));
        kill(&file, "-KILL");
        std::fs::remove_file(file).expect("removed");
    }
    fn daemon(&self, program: &str) -> Command {
        let mut command = self.command(program);
        command.arg("-f").arg(self.configuration());
        command
    }
    fn text(&self) -> String {
        let host = std::fs::read_to_string("/proc/sys/kernel/hostname").expect("Linux");
        let host = host.trim().split('.').next().expect("a name").to_owned();
        // Another cluster may run on this machine. The ports stay free until the daemons take them.
        let listeners: Vec<TcpListener> = (0..4).map(|_| TcpListener::bind("127.0.0.1:0").expect("a port")).collect();
        let ports: Vec<u16> = listeners.iter().map(|one| one.local_addr().expect("an address").port()).collect();
        let folder = self.folder.path().display();
        let mut text = format!(
            "ClusterName=loop\nSlurmctldHost={host}(127.0.0.1)\nSlurmctldPort={}\nSlurmUser=root\nAuthType=auth/munge\n\
             AuthInfo=cred_expire=5,socket={folder}/munge.socket\nCryptoType=crypto/munge\nMpiDefault=none\n\
             ProctrackType=proctrack/linuxproc\nTaskPlugin=task/none\nJobAcctGatherType=jobacct_gather/none\n\
             SwitchType=switch/none\nSelectType=select/cons_tres\nSelectTypeParameters=CR_Core\nReturnToService=2\n\
             SlurmdTimeout=10\nSlurmctldTimeout=10\nBatchStartTimeout=10\nMessageTimeout=10\nKillWait=5\nMinJobAge=3000\n\
             InactiveLimit=0\nOverTimeLimit=0\nJobRequeue=1\nStateSaveLocation={folder}/state\n\
             SlurmdSpoolDir={folder}/spool/%n\nSlurmctldPidFile={folder}/slurmctld.pid\n\
             SlurmdPidFile={folder}/slurmd-%n.pid\nSlurmctldLogFile={folder}/log/slurmctld.log\n\
             SlurmdLogFile={folder}/log/slurmd-%n.log\nSlurmdParameters=config_overrides\n\
             AccountingStorageType=accounting_storage/none\nSchedulerParameters=sched_interval=2,batch_sched_delay=0\n\
             PartitionName=all Nodes=n[1-3] Default=YES MaxTime=INFINITE State=UP\n",
            ports[0]
        );
        for (node, port) in NODES.iter().zip(&ports[1..]) {
            // Writing to a string cannot fail.
            let _ = writeln!(
                text,
                "NodeName={node} NodeHostname={host} NodeAddr=127.0.0.1 Port={port} CPUs=2 RealMemory=4000 State=UNKNOWN"
            );
        }
        text
    }
}

impl Drop for Slurm {
    fn drop(&mut self) {
        let _ = self.command("scancel").args(["--user=root"]).status();
        for daemon in ["slurmd-n1", "slurmd-n2", "slurmd-n3", "slurmctld", "munge"] {
            kill(&self.folder.path().join(format!("{daemon}.pid")), "-TERM");
        }
    }
}

/// Signals the process of a pid file, if it is there.
fn kill(file: &Path, signal: &str) {
    if let Ok(pid) = std::fs::read_to_string(file) {
        let _ = Command::new("kill").args([signal, pid.trim()]).status();
    }
}

fn set_mode(path: &Path, mode: u32) {
    use std::os::unix::fs::PermissionsExt;
    std::fs::set_permissions(path, std::fs::Permissions::from_mode(mode)).expect("set");
}

fn text(output: &Output) -> String {
    String::from_utf8_lossy(&[&output.stdout[..], &output.stderr].concat()).into_owned()
}
