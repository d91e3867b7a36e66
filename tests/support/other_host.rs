//! Another host for a stage: an agent, and a connection to it that can be cut.

use crate::{Launch, Running, binary, processes_of, wait_for};
use random::Random;
use rustix::process::{Signal, kill_process};
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicI64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// No cut is due.
const NEVER: i64 = i64::MAX;

/// `replica agent` in the folder of the programs. Killed when dropped.
struct AgentProcess {
    child: Child,
    address: String,
}

impl AgentProcess {
    /// Starts the agent by a command that ends with the program; `errors` receives its messages.
    fn start_by(mut command: Command, listen: &str, key: &Path, errors: &Path) -> Self {
        let folder = binary("replica").parent().expect("a folder").to_owned();
        let errors = std::fs::File::options().create(true).append(true).open(errors).expect("opened");
        let command = command.args(["agent", "--listen", listen, "--key"]).arg(key).arg("--folder").arg(folder);
        let mut child = command.stdout(Stdio::piped()).stderr(errors).spawn().expect("replica starts");
        let mut line = String::new();
        BufReader::new(child.stdout.take().expect("piped")).read_line(&mut line).expect("a line");
        let address = line.strip_prefix("listening on ").and_then(|rest| rest.split(',').next());
        let address = address.unwrap_or_else(|| panic!("unexpected: {line}")).to_owned();
        Self { child, address }
    }
}

impl Drop for AgentProcess {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A key, and an agent that uses it.
pub struct OtherHost {
    folder: tempfile::TempDir,
    agent: AgentProcess,
}

impl OtherHost {
    /// Starts the agent on a free port of this host.
    pub fn start() -> Self {
        Self::start_by(Command::new(binary("replica")), "127.0.0.1:0")
    }
    /// Starts the agent in a separate network, connected by [`crate::Cable`].
    pub fn in_own_network() -> Self {
        let mut command = Command::new("unshare");
        command.arg("-n").arg(binary("replica"));
        Self::start_by(command, "0.0.0.0:7878")
    }
    fn start_by(command: Command, listen: &str) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let key = folder.path().join("agent.key");
        let made = Command::new(binary("replica")).args(["agent", "--new-key"]).arg(&key).output();
        assert!(made.expect("replica starts").status.success());
        let agent = AgentProcess::start_by(command, listen, &key, &folder.path().join("agent.txt"));
        Self { folder, agent }
    }
    /// The agent's address.
    pub fn address(&self) -> &str {
        &self.agent.address
    }
    /// The agent's process.
    pub fn process(&self) -> u32 {
        self.agent.child.id()
    }
    /// The key file.
    pub fn key(&self) -> PathBuf {
        self.folder.path().join("agent.key")
    }
    /// The messages of the agent.
    pub fn messages(&self) -> String {
        std::fs::read_to_string(self.folder.path().join("agent.txt")).unwrap_or_default()
    }
    fn restart(&mut self) {
        let errors = self.folder.path().join("agent.txt");
        self.agent = AgentProcess::start_by(Command::new(binary("replica")), "127.0.0.1:0", &self.key(), &errors);
    }
    /// The launch file with one of its stages on this host, reached by `address`. `program` is a path in the agent's
    /// folder; empty: the program of the stage.
    pub fn runs(&self, launch: Launch, stage: &str, program: &str, address: &str) -> Launch {
        let key = self.key().to_string_lossy().into_owned();
        let settings = [("host", address), ("host_key", &key), ("program", program)];
        let mut launch = launch;
        for (key, value) in settings {
            launch = launch.with("--set").with(&format!("{stage}.{key}={value}"));
        }
        launch
    }
}

/// Passes connections on to an agent, and cuts them.
pub struct Proxy {
    address: String,
    shared: Arc<Shared>,
}

struct Shared {
    target: Mutex<String>,
    connections: Mutex<Vec<TcpStream>>,
    /// Bytes of both directions until the next cut.
    left: AtomicI64,
}

impl Proxy {
    /// A proxy to an agent at `target`. Its threads end with the process.
    pub fn start(target: &str) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let address = listener.local_addr().expect("an address").to_string();
        let target = Mutex::new(target.to_owned());
        let left = AtomicI64::new(NEVER);
        let shared = Arc::new(Shared { target, connections: Mutex::default(), left });
        let of_thread = Arc::clone(&shared);
        thread(move || {
            for client in listener.incoming().flatten() {
                let target = of_thread.target.lock().expect("no panic").clone();
                // Without an agent the client reads the end.
                if let Ok(server) = TcpStream::connect(target) {
                    pass_on(&of_thread, &client, &server);
                }
            }
        });
        Self { address, shared }
    }
    /// The address on which it listens.
    pub fn address(&self) -> &str {
        &self.address
    }
    /// Later connections lead to this agent.
    pub fn set_target(&self, target: &str) {
        target.clone_into(&mut self.shared.target.lock().expect("no panic"));
    }
    /// Cuts all connections after this many further bytes, at any position.
    pub fn cut_after(&self, n_bytes: u32) {
        self.shared.left.store(i64::from(n_bytes), Ordering::SeqCst);
    }
    /// Whether the cut is done.
    pub fn has_cut(&self) -> bool {
        self.shared.left.load(Ordering::SeqCst) == NEVER
    }
}

fn thread(work: impl FnOnce() + Send + 'static) {
    std::thread::Builder::new().name("proxy".to_owned()).spawn(work).expect("a thread");
}

fn pass_on(shared: &Arc<Shared>, client: &TcpStream, server: &TcpStream) {
    let copy = |stream: &TcpStream| stream.try_clone().expect("a copy");
    for stream in [client, server] {
        stream.set_nodelay(true).expect("a socket");
        shared.connections.lock().expect("no panic").push(copy(stream));
    }
    for (from, to) in [(client, server), (server, client)] {
        let shared = Arc::clone(shared);
        let mut from = copy(from);
        let mut to = copy(to);
        thread(move || {
            let mut piece = vec![0; 4096];
            while let Ok(n @ 1..) = from.read(&mut piece) {
                let before = shared.left.load(Ordering::SeqCst);
                if before == NEVER {
                    if to.write_all(&piece[..n]).is_err() {
                        break;
                    }
                    continue;
                }
                let left = shared.left.fetch_sub(n as i64, Ordering::SeqCst);
                let whole = left > n as i64;
                // Bytes before the cut arrive.
                let sent = to.write_all(&piece[..if whole { n } else { left.clamp(0, n as i64) as usize }]);
                if !whole {
                    for stream in shared.connections.lock().expect("no panic").drain(..) {
                        let _ = stream.shutdown(Shutdown::Both);
                    }
                    shared.left.store(NEVER, Ordering::SeqCst);
                }
                if sent.is_err() {
                    break;
                }
            }
            let _ = (from.shutdown(Shutdown::Both), to.shutdown(Shutdown::Both));
        });
    }
}

/// Targets of disturbances of a stage on another host.
const VICTIMS: [&str; 4] = ["connection", "stand-in", "stage", "agent"];

/// Runs `launch` to its end while its connection is cut and the processes at both ends are killed, `n` times in all.
/// `stage` is the stage on the other host. Returns the number of disturbances by target.
///
/// # Panics
/// If the run fails; the message lists what happened.
pub fn run_under_cuts(
    launch: &Launch,
    stage: &str,
    (host, proxy): (&mut OtherHost, &Proxy),
    n: usize,
    random: &mut Random,
) -> BTreeMap<&'static str, usize> {
    let mut struck = BTreeMap::new();
    let mut history = Vec::new();
    let mut running = launch.start();
    running.stage(stage);
    while history.len() < n {
        let victim = VICTIMS.get(history.len()).unwrap_or(random.pick(&VICTIMS));
        std::thread::park_timeout(Duration::from_millis(random.index(400) as u64));
        if let Some(code) = running.ended() {
            assert_eq!(code, Some(0), "after {history:?} it ended with {}\n{}", running.stderr(), host.messages());
            running = launch.start_again(&["--overwrite"]);
            // The start itself is refused if the other host does not answer its queries.
            running.stage(stage);
        }
        let is_struck = match *victim {
            "connection" => cut(proxy, &mut running, random.index(300_000) as u32),
            "stand-in" => kill(running.find_stage(stage)),
            "stage" => kill(processes_of(host.process()).pop()),
            _ => {
                host.restart();
                proxy.set_target(host.address());
                true
            }
        };
        if is_struck {
            history.push(*victim);
            *struck.entry(*victim).or_default() += 1;
        }
    }
    let mut last = None;
    wait_for("the end of the run", || {
        last = running.ended();
        last
    });
    assert_eq!(last, Some(Some(0)), "after {history:?} it ended with {}\n{}", running.stderr(), host.messages());
    struck
}

fn kill(process: Option<rustix::process::Pid>) -> bool {
    process.is_some_and(|pid| kill_process(pid, Signal::KILL).is_ok())
}

/// Cuts after this many bytes; `false` if the run has ended before them.
fn cut(proxy: &Proxy, running: &mut Running, n_bytes: u32) -> bool {
    proxy.cut_after(n_bytes);
    wait_for("a cut or the end of the run", || (proxy.has_cut() || running.ended().is_some()).then_some(()));
    let has_cut = proxy.has_cut();
    proxy.shared.left.store(NEVER, Ordering::SeqCst);
    has_cut
}
