//! A stage on another host: the run, its result and its recovery equal a run on one host.

use replica_tests::swaps::{started, stop, swapped, wait_for_two_barriers};
use replica_tests::{
    Cable, Launch, OtherHost, Proxy, Random, binary, domain_of, drive, in_own_network, leftovers, output_text,
    pipeline, processes_of, reference, result_files, run_under_cuts, undisturbed, undisturbed_lines, wait_for,
};
use rustix::net::{self, AddressFamily, SocketType};
use rustix::process::{Signal, kill_process};
use std::fs::Permissions;
use std::net::{Ipv4Addr, SocketAddrV4};
use std::os::fd::OwnedFd;
use std::os::unix::fs::PermissionsExt;

const RELAY: &str = "misbehaving-relay";
const SOURCE: &str = "ticks = 300\npoints = 5000";

#[test]
fn stage_on_another_host_gives_the_same_bytes_and_the_same_summary() {
    let host = OtherHost::start();
    let summary = |launch: &Launch| {
        let mut summary = launch.stage_summary("relay");
        let counters = summary["counters"].as_object_mut().expect("counters").clone();
        // There are no rows in shared memory on another host.
        let counters: Vec<_> = counters.into_iter().filter(|(name, _)| name != "rows_in_shared_memory").collect();
        (counters, summary["doubts"].take(), summary["ticks"].take())
    };
    let doubted = "doubt_at_tick = 5";
    let here = Launch::misbehaving("", SOURCE, doubted);
    assert_eq!(here.run().status.code(), Some(3), "the doubt");
    let there = host.runs(Launch::misbehaving("", SOURCE, doubted), "relay", RELAY, host.address());
    let output = there.run();
    assert_eq!(output.status.code(), Some(3), "{}\n{}", output_text(&output), host.messages());
    assert!(there.read("sink.txt") == here.read("sink.txt"), "the host changed the result");
    assert_eq!(summary(&there), summary(&here));
    assert_eq!(leftovers(&domain_of(&there.output())), Vec::<String>::new());
}

#[test]
fn network_on_another_host_gives_the_same_clouds() {
    let host = OtherHost::start();
    let expected = reference("pipeline", || pipeline(&drive(), "", ""));
    let launch = host.runs(pipeline(&drive(), "", ""), "infer", "", host.address());
    let output = launch.run();
    assert_eq!(output.status.code(), Some(0), "{}\n{}", output_text(&output), host.messages());
    assert!(result_files(&launch.output()) == expected, "the host changed the clouds");
}

#[test]
fn cut_connections_and_killed_processes_do_not_change_the_result() {
    let expected = undisturbed(SOURCE, "");
    let mut host = OtherHost::start();
    let proxy = Proxy::start(host.address());
    let launch = Launch::misbehaving("restarts = 1000", SOURCE, "");
    let launch = host.runs(launch, "relay", RELAY, proxy.address());
    let struck = run_under_cuts(&launch, "relay", (&mut host, &proxy), 45, &mut Random::new(7));
    println!("{struck:?}");
    assert_eq!(struck.len(), 4, "each was struck: {struck:?}");
    assert!(launch.read("sink.txt") == expected, "the cuts changed the result");
    assert_eq!(launch.summary()["outcome"], "done");
    assert_eq!(leftovers(&domain_of(&launch.output())), Vec::<String>::new());
}

#[test]
#[cfg_attr(not(network_namespaces), ignore = "needs network namespaces and `ip` (iproute2)")]
fn pulled_cable_between_two_hosts_does_not_change_the_result() {
    // Created where the reference has its network.
    let expected = undisturbed(SOURCE, "");
    if !in_own_network!("pulled_cable_between_two_hosts_does_not_change_the_result") {
        return;
    }
    let host = OtherHost::in_own_network();
    let cable = Cable::to(host.process());
    let launch = Launch::misbehaving("restarts = 1000\nhang_s = 3.0", SOURCE, "");
    let launch = host.runs(launch, "relay", RELAY, &format!("{}:7878", Cable::FAR));
    let running = launch.start();
    for barrier in [2, 6] {
        launch.wait_for_barrier(barrier);
        let n_faults = running.stderr().matches("no answer for 3 s").count();
        cable.pull();
        wait_for("a fault", || (running.stderr().matches("no answer for 3 s").count() > n_faults).then_some(()));
        cable.plug_in();
    }
    assert_eq!(running.wait(), Some(0), "{}\n{}", launch.stderr(), host.messages());
    assert!(launch.read("sink.txt") == expected, "the cuts changed the result");
}

/// An error of the stage is an error of the run, with its host.
#[test]
fn failed_stage_on_another_host_is_reported_and_restarts() {
    let host = OtherHost::start();
    let relay = "fault = \"error\"\nat_tick = 23\nonce = \"struck\"";
    let launch = host.runs(Launch::misbehaving("", SOURCE, relay), "relay", RELAY, host.address());
    let output = launch.run();
    let text = output_text(&output);
    assert_eq!(output.status.code(), Some(0), "{text}");
    assert!(text.contains(&format!("on {}: ", host.address())), "{text}");
    assert_eq!(launch.summary()["total"]["restarts"], 1);
    assert!(launch.read("sink.txt") == undisturbed(SOURCE, ""), "the fault changed the result");
}

#[test]
fn stage_moves_between_hosts_by_swaps() {
    let host = OtherHost::start();
    let launch = Launch::misbehaving("", "ticks = 1000000\npoints = 1000", "");
    let running = started(&launch);
    let key = host.key().to_string_lossy().into_owned();
    let settings = [("host", host.address()), ("host_key", &key), ("program", RELAY)];
    let there: Vec<String> = settings.iter().map(|(key, value)| format!("--set={key}={value}")).collect();
    swapped(&launch, &[&["relay"], &there.iter().map(String::as_str).collect::<Vec<_>>()[..]].concat());
    assert_eq!(processes_of(host.process()).len(), 1, "the stage runs there: {}", host.messages());
    wait_for_two_barriers(&launch);
    swapped(&launch, &["relay", "--back"]);
    wait_for("the end of the stage there", || processes_of(host.process()).is_empty().then_some(()));
    wait_for_two_barriers(&launch);
    stop(&launch);
    assert_eq!(running.wait(), Some(3), "drained");
    let lines = String::from_utf8(launch.read("sink.txt")).expect("text");
    let lines: Vec<&str> = lines.lines().collect();
    assert!(lines == undisturbed_lines(lines.len() / 2, ""), "the swaps changed the result");
}

#[test]
fn stage_on_another_host_restarts_alone_in_a_live_run() {
    let host = OtherHost::start();
    let live = Launch::misbehaving("mode = \"live\"", "ticks = 1000000\npoints = 500\npace_ms = 2", "");
    let launch = host.runs(live, "relay", RELAY, host.address());
    let running = launch.start();
    launch.wait_for_barrier_of("sink", 2);
    let others = ["source", "sink"].map(|name| running.stage(name));
    let there = processes_of(host.process());
    assert_eq!(there.len(), 1, "{}", host.messages());
    kill_process(there[0], Signal::KILL).expect("the stage lives");
    wait_for("the next process there", || {
        processes_of(host.process()).iter().any(|pid| *pid != there[0]).then_some(())
    });
    let barrier = launch.newest_barrier().unwrap_or_default();
    launch.wait_for_barrier_of("sink", barrier + 4);
    assert_eq!(["source", "sink"].map(|name| running.stage(name)), others, "the others continue");
    running.signal(Signal::INT);
    assert_eq!(running.wait(), Some(3), "{}", launch.stderr());
    assert_eq!(launch.summary()["total"]["restarts"], 1, "{}", launch.stderr());
}

#[test]
fn changed_file_on_the_other_host_ends_the_run() {
    let host = OtherHost::start();
    // A file in the agent's folder that a setting names, as it would name the model of a network.
    let folder = binary(RELAY).parent().expect("a folder").to_owned();
    let model = tempfile::Builder::new().prefix("two_machines").tempfile_in(&folder).expect("a file");
    let name = model.path().file_name().expect("a name").to_string_lossy().into_owned();
    let launch = || {
        let launch = Launch::misbehaving("", "ticks = 3000\npoints = 500", &format!("once = \"{name}\""));
        host.runs(launch, "relay", RELAY, host.address())
    };
    let other = launch();
    std::fs::write(other.folder().join(&name), "another model").expect("written");
    let text = refusal(other);
    assert!(text.contains(&format!("{name} on {} differs from", host.address())), "{text}");

    let launch = launch();
    let running = launch.start();
    launch.wait_for_barrier(2);
    std::fs::write(model.path(), "another model").expect("written");
    kill_process(running.stage("relay"), Signal::KILL).expect("the stage lives");
    assert_eq!(running.wait(), Some(1), "{}", launch.stderr());
    let text = launch.stderr();
    assert!(text.contains(&format!("{name} on {} has changed since the run was started", host.address())), "{text}");
    assert_eq!(launch.start_again(&["--resume"]).wait(), Some(78), "{}", launch.stderr());
    assert!(launch.stderr().contains(&format!("{}:{name}", host.address())), "{}", launch.stderr());
}

/// The refusal of a launch file by `--check`.
fn refusal(launch: Launch) -> String {
    let output = launch.with("--check").run();
    assert_eq!(output.status.code(), Some(78), "{}", output_text(&output));
    output_text(&output)
}

#[test]
fn check_reports_what_the_other_host_refuses() {
    let host = OtherHost::start();
    let launch = || Launch::misbehaving("", SOURCE, "");
    let check = |address: &str, program: &str| refusal(host.runs(launch(), "relay", program, address));
    let accepted = host.runs(launch(), "relay", RELAY, host.address()).with("--check").run();
    assert_eq!(accepted.status.code(), Some(0), "{}", output_text(&accepted));
    assert!(check("127.0.0.1:1", RELAY).contains("does `replica agent` run there?"));
    assert!(check("127.0.0.1", RELAY).contains("must be HOST:PORT"));
    assert!(check(host.address(), "absent").contains("absent does not exist"));
    assert!(check(host.address(), "../relay").contains("must be a path in the agent's folder"));
    let unknown = host.runs(launch(), "relay", RELAY, host.address()).with("--set").with("relay.salty=1");
    let text = refusal(unknown);
    assert!(text.contains(&format!("on {}: unknown key; did you mean `salt`?", host.address())), "{text}");
    let source = host.runs(launch(), "source", "misbehaving-source", host.address());
    assert!(refusal(source).contains("it cannot run on"));
}

#[test]
fn agent_with_another_key_and_key_that_others_can_read_are_refused() {
    let host = OtherHost::start();
    let other = OtherHost::start();
    let launch = || Launch::misbehaving("", SOURCE, "");
    let text = refusal(host.runs(launch(), "relay", RELAY, other.address()));
    assert!(text.contains("has another key"), "{text}");
    assert!(other.messages().contains("has another key"), "{}", other.messages());
    std::fs::set_permissions(host.key(), Permissions::from_mode(0o644)).expect("changed");
    let text = refusal(host.runs(launch(), "relay", RELAY, host.address()));
    assert!(text.contains("mode 0644 lets other users read the key"), "{text}");
}

/// A connection to the agent from this address of this host, which sends nothing.
fn silent_connection(from: Ipv4Addr, agent: SocketAddrV4) -> OwnedFd {
    let socket = net::socket(AddressFamily::INET, SocketType::STREAM, None).expect("a socket");
    net::bind(&socket, &SocketAddrV4::new(from, 0)).expect("an address of this host");
    net::connect(&socket, &agent).expect("the agent listens");
    socket
}

#[test]
fn hosts_without_the_key_keep_no_run_out() {
    let host = OtherHost::start();
    let agent = host.address().parse().expect("an address");
    let silent: Vec<OwnedFd> = (0..100).map(|_| silent_connection(Ipv4Addr::new(127, 0, 0, 2), agent)).collect();
    wait_for("the refusal of those beyond the limit", || {
        let is_refused = |line: &str| line.starts_with("127.0.0.2:") && line.ends_with("have not shown the key yet");
        host.messages().lines().any(is_refused).then_some(())
    });
    let checked = host.runs(Launch::misbehaving("", SOURCE, ""), "relay", RELAY, host.address()).with("--check").run();
    assert_eq!(checked.status.code(), Some(0), "{}", output_text(&checked));
    drop(silent);
}
