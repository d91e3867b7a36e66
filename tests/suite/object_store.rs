//! `packaging/object_store/process`: drives and outputs in an object store, by a local server of the same protocol.

use replica_tests::{Launch, binary, undisturbed, wait_for};
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};

const SOURCE: &str = "ticks = 60\npoints = 500";

/// A server with the bucket `street`. Killed when dropped.
struct Store {
    server: Child,
    endpoint: String,
}

impl Store {
    fn start() -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let address = listener.local_addr().expect("an address");
        drop(listener);
        let mut server = Command::new("moto_server");
        server.args(["-H", "127.0.0.1", "-p", &address.port().to_string()]);
        let server = server.stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("moto is installed");
        wait_for("the object store", || TcpStream::connect(address).ok());
        let store = Self { server, endpoint: format!("http://{address}") };
        store.ask(&["s3", "mb", "s3://street"]);
        store
    }
    fn command(&self, program: impl AsRef<std::ffi::OsStr>) -> Command {
        let mut command = Command::new(program);
        command.env("AWS_ENDPOINT_URL", &self.endpoint).env("AWS_DEFAULT_REGION", "us-east-1");
        command.env("AWS_ACCESS_KEY_ID", "test").env("AWS_SECRET_ACCESS_KEY", "test").env("REPLICA", binary("replica"));
        command
    }
    fn ask(&self, arguments: &[&str]) -> String {
        let output = self.command("aws").args(arguments).output().expect("aws is installed");
        assert!(output.status.success(), "aws {arguments:?}: {}", text(&output));
        text(&output)
    }
    /// Names of the objects below `prefix`.
    fn objects(&self, prefix: &str) -> Vec<String> {
        let lines = self.command("aws").args(["s3", "ls", "--recursive", &format!("s3://street/{prefix}")]).output();
        let lines = text(&lines.expect("aws is installed"));
        lines.lines().filter_map(|line| line.split_whitespace().last().map(str::to_owned)).collect()
    }
}

impl Drop for Store {
    fn drop(&mut self) {
        let _ = self.server.kill();
        let _ = self.server.wait();
    }
}

fn text(output: &Output) -> String {
    String::from_utf8_lossy(&[&output.stdout[..], &output.stderr].concat()).into_owned()
}

/// The script for the drive `monday`.
fn process(store: &Store, launch: &Launch, scratch: &Path) -> Command {
    let script = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("packaging/object_store/process");
    let mut command = store.command(script);
    command
        .arg(launch.folder().join("launch.toml"))
        .args(["s3://street/drives/monday", "s3://street/out"])
        .arg(scratch);
    command.stdin(Stdio::null());
    command
}

#[test]
#[cfg_attr(not(object_store), ignore = "needs `aws` and `moto_server`: pip install awscli 'moto[server]'")]
fn drained_job_continues_on_another_node_and_marks_its_output_last() {
    let store = Store::start();
    let launch = Launch::misbehaving("", &format!("{SOURCE}\npace_ms = 100"), "");
    let recorded = launch.folder().join("recorded");
    std::fs::create_dir(&recorded).expect("made");
    std::fs::write(recorded.join("scan"), vec![7; 1000]).expect("written");
    store.ask(&["s3", "sync", &recorded.display().to_string(), "s3://street/drives/monday"]);
    let scratch = launch.folder().join("scratch");

    let mut first = process(&store, &launch, &scratch).spawn().expect("bash");
    let states = scratch.join("out/monday/run/states");
    wait_for("a barrier of all stages", || {
        let barriers = std::fs::read_dir(&states).ok()?.flatten();
        barriers.map(|barrier| barrier.path().join("sink.state")).find(|state| state.is_file())
    });
    rustix::process::kill_process(rustix::process::Pid::from_child(&first), rustix::process::Signal::TERM)
        .expect("it lives");
    assert_eq!(first.wait().expect("waits").code(), Some(3), "drained");
    let objects = store.objects("out/monday/");
    assert!(objects.iter().any(|name| name.ends_with("sink.state")), "{objects:?}");
    assert!(!objects.contains(&"out/monday/complete.json".to_owned()), "a part of the output does not look complete");
    assert!(!objects.iter().any(|name| name.contains("/leases/")), "{objects:?}");

    // Another node has nothing on its disk.
    std::fs::remove_dir_all(&scratch).expect("removed");
    let second = process(&store, &launch, &scratch).output().expect("bash");
    assert!(second.status.success(), "{}", text(&second));
    let log = std::fs::read_to_string(scratch.join("out/monday.log")).expect("a log");
    assert!(log.contains("resuming from barrier"), "{log}");
    let fetched = launch.folder().join("fetched");
    store.ask(&["s3", "sync", "s3://street/out/monday", &fetched.display().to_string()]);
    assert!(std::fs::read(fetched.join("sink.txt")).expect("there") == undisturbed(SOURCE, ""), "the result differs");
    assert!(fetched.join("complete.json").is_file());
    assert!(!fetched.join("run/states").exists(), "the states of a finished run are removed");

    let third = process(&store, &launch, &scratch).output().expect("bash");
    assert!(third.status.success() && text(&third).contains("monday: done before"), "{}", text(&third));
    let marker =
        ["s3api", "put-object", "--bucket", "street", "--key", "out/monday/complete.json", "--if-none-match", "*"];
    let again = store.command("aws").args(marker).output().expect("aws is installed");
    assert!(!again.status.success() && text(&again).contains("PreconditionFailed"), "{}", text(&again));
}
