//! Channels: messages are read in place, in order and without loss, by the processes of one run only.

use crate::support::{Pair, TestDomain, live_pair, pair, send};
use ipc::{
    Channel, Domain, IpcError, LatestPublisher, LatestSubscriber, Publisher, Received, ServiceHandles, Subscriber,
};
use messages::{ClassRow, CubeTopic, Envelope, ImageTopic, Message, SweepPoint, SweepTopic, TrajectoryTopic};
use std::time::Duration;

/// The next message.
fn receive(pair: &mut Pair) -> Received<messages::SweepTopic> {
    for _ in 0..100 {
        if let Some(received) = pair.subscriber.receive().expect("no error") {
            return received;
        }
        pair.consumer_wake.wait(Duration::from_millis(100)).expect("waits");
    }
    panic!("no message has arrived");
}

/// The mapping of /proc/self/maps that holds `address`.
fn mapping_of(address: usize) -> String {
    let maps = std::fs::read_to_string("/proc/self/maps").expect("Linux");
    let holds = |line: &&str| {
        let range = line.split(' ').next().and_then(|range| range.split_once('-')).expect("a range");
        let bound = |text: &str| usize::from_str_radix(text, 16).expect("hexadecimal");
        (bound(range.0)..bound(range.1)).contains(&address)
    };
    maps.lines().find(holds).expect("mapped").to_owned()
}

#[test]
fn rows_in_shared_memory_are_read_in_place() {
    let domain = TestDomain::new("inplace");
    let mut pair = pair(&domain.0);
    let written_at = send(&mut pair.publisher, 0, 100_000);
    pair.nodes[1].wake_all();
    pair.consumer_wake.wait(Duration::from_secs(5)).expect("woken");
    let received = pair.subscriber.receive().expect("no error").expect("a message");
    assert_eq!(received.rows().len(), 100_000);
    assert_eq!(received.rows()[4321].x, 4321.0);
    assert_eq!(received.header().n_rings, 32);
    let bytes = size_of_val(received.rows());
    let first = received.rows().as_ptr().addr();
    let segment = format!("/dev/shm/{}", domain.0.prefix());
    for address in [written_at, first, first + bytes - 1] {
        let mapping = mapping_of(address);
        assert!(mapping.contains(&segment), "{address:x} lies in {mapping}");
    }
    assert_eq!(first % 64, 0, "rows start on a cache line");
}

#[test]
fn full_queue_stops_producer_without_loss() {
    let domain = TestDomain::new("credit");
    let mut pair = pair(&domain.0);
    let mut sent = 0;
    while pair.publisher.has_room(1).expect("no error") {
        send(&mut pair.publisher, sent, 10 + sent as usize);
        sent += 1;
    }
    assert_eq!(sent as usize, messages::SweepTopic::QUEUE);
    let mut held = Vec::new();
    // Sizes grow, so slots are reallocated while older messages are still held.
    for expected in 0..200 {
        let received = receive(&mut pair);
        assert_eq!(received.envelope().seq, expected);
        assert_eq!(received.header().n_rings, 32);
        assert_eq!(received.rows().last().map(|row| row.x), Some((expected * 1000 + 9 + expected) as f32));
        held.push(received);
        if held.len() > messages::SweepTopic::BORROWED {
            held.remove(0);
        }
        assert!(pair.publisher.has_room(1).expect("no error"));
        send(&mut pair.publisher, sent, 10 + sent as usize);
        sent += 1;
    }
}

#[test]
fn room_is_what_the_consumer_has_taken() {
    let domain = TestDomain::new("room");
    let mut pair = pair(&domain.0);
    let queue = messages::SweepTopic::QUEUE as u64;
    assert!(pair.publisher.has_room(queue).expect("no error"));
    assert!(!pair.publisher.has_room(queue + 1).expect("no error"), "more than the queue holds");
    for seq in 0..queue {
        send(&mut pair.publisher, seq, 10);
    }
    assert!(!pair.publisher.has_room(1).expect("no error"));
    for taken in 1..=queue {
        drop(pair.subscriber.receive().expect("no error").expect("a message"));
        assert!(pair.publisher.has_room(taken).expect("no error"), "{taken} taken");
        assert!(!pair.publisher.has_room(taken + 1).expect("no error"), "{taken} taken");
    }
}

/// Queues `n_messages` of the sample drive's size while a live consumer does not read; all arrive later without a gap.
/// Returns the shared memory that they needed.
fn shared_bytes_of_waiting<T: Message>(n_messages: u64, n_rows: usize) -> u64 {
    let domain = TestDomain::new(T::TOPIC);
    let mut pair = live_pair::<T>(&domain.0);
    let empty = domain.0.used_bytes();
    for seq in 0..n_messages {
        let mut loan = pair.publisher.loan(n_rows).expect("loaned");
        loan.grow(n_rows).expect("fits");
        pair.publisher.send(loan, Envelope { seq, ..Envelope::default() }).expect("sent");
    }
    let used = domain.0.used_bytes() - empty;
    for expected in 0..n_messages {
        let received = pair.subscriber.receive().expect("no error").expect("a message");
        assert_eq!(received.envelope().seq, expected, "{}", T::TOPIC);
    }
    used
}

#[test]
fn live_inputs_of_colorize_wait_three_seconds_without_loss() {
    // Six cameras and two mosaic cameras fire up to four times in 3 s, the LiDAR turns thirty times.
    let of_images = shared_bytes_of_waiting::<ImageTopic>(4 * 6, 800 * 600 * 3);
    let of_cubes = shared_bytes_of_waiting::<CubeTopic>(4 * 2, 409 * 217 * 26);
    let of_poses = shared_bytes_of_waiting::<TrajectoryTopic>(30, 2);
    // The slots of larger images are reserved, but use no memory.
    let mebibytes = [of_images, of_cubes, of_poses].map(|bytes| bytes >> 20);
    assert_eq!(mebibytes, [33, 70, 0]);
}

#[test]
fn ends_of_another_layout_or_version_are_refused() {
    let domain = TestDomain::new("layout");
    let pair = pair(&domain.0);
    let node = domain.0.node("stranger").expect("node");
    let mut channel = Channel::new::<messages::SweepTopic>("sweep", "producer.wake", &["consumer.wake".to_owned()]);
    channel.version += 1;
    assert!(matches!(Publisher::<messages::SweepTopic>::open(&node, &channel), Err(IpcError::Transport { .. })));
    channel.version -= 1;
    channel.layout = messages::ClassTopic::LAYOUT;
    assert!(matches!(Publisher::<messages::SweepTopic>::open(&node, &channel), Err(IpcError::Transport { .. })));
    // The channel agrees with this type, but the attributes of the service do not.
    assert!(matches!(Publisher::<messages::ClassTopic>::open(&node, &channel), Err(IpcError::Transport { .. })));
    let wake = "consumer.wake";
    assert!(matches!(Subscriber::<messages::SweepTopic>::open(&node, &channel, wake), Err(IpcError::Transport { .. })));
    assert!(matches!(Subscriber::<messages::ClassTopic>::open(&node, &channel, wake), Err(IpcError::Transport { .. })));
    drop(pair);
}

#[test]
fn reader_receives_only_latest_value() {
    let domain = TestDomain::new("latest");
    let node = domain.0.node("supervisor").expect("node");
    let mut services = ServiceHandles::default();
    services.create_latest(&node, "health").expect("created");
    let writer = LatestPublisher::open(&node, "health").expect("opened");
    let reader = LatestSubscriber::open(&node, "health").expect("opened");
    assert!(reader.connect().expect("connects"));
    for size in [10, 20_000, 30] {
        writer.publish(&vec![7; size]).expect("published");
    }
    assert_eq!(reader.poll().expect("no error").map(|value| value.len()), Some(30));
    assert_eq!(reader.poll().expect("no error"), None);
}

#[test]
fn shared_memory_is_private_and_wipe_removes_all() {
    use std::os::unix::fs::PermissionsExt;
    let domain = TestDomain::new("wipe");
    let other = TestDomain::new("other");
    let files = |domain: &Domain| -> Vec<std::path::PathBuf> {
        let entries = std::fs::read_dir("/dev/shm").expect("Linux").flatten();
        entries.map(|e| e.path()).filter(|p| p.to_string_lossy().contains(&domain.prefix())).collect()
    };
    let mut pair = pair(&domain.0);
    send(&mut pair.publisher, 0, 1000);
    let _other_pair = self::pair(&other.0);
    let present = files(&domain.0);
    assert!(!present.is_empty());
    for file in present {
        let mode = std::fs::metadata(&file).expect("there").permissions().mode();
        assert_eq!(mode & 0o077, 0, "{} has mode {mode:o}", file.display());
    }
    // The state after SIGKILL: no destructor runs.
    std::mem::forget(pair);
    domain.0.wipe().expect("wiped");
    assert_eq!(files(&domain.0), Vec::<std::path::PathBuf>::new());
    assert!(!domain.0.root().exists());
    assert!(!files(&other.0).is_empty(), "another run's memory is not touched");
}

#[test]
fn folder_that_others_could_enter_is_no_domain() {
    use std::os::unix::fs::PermissionsExt;
    let domain = TestDomain::new("open");
    let root = domain.0.root();
    std::fs::create_dir(&root).expect("made");
    std::fs::set_permissions(&root, std::fs::Permissions::from_mode(0o755)).expect("set");
    let error = domain.0.node("node").err().expect("is open").to_string();
    assert!(error.contains("is open to other users (mode 755)"), "{error}");
    std::fs::remove_dir(&root).expect("removed");
    let elsewhere = tempfile::tempdir().expect("a folder");
    std::os::unix::fs::symlink(elsewhere.path(), &root).expect("linked");
    let error = domain.0.node("node").err().expect("is a link").to_string();
    assert!(error.contains("is not a folder"), "{error}");
    std::fs::remove_file(&root).expect("removed");
    assert_eq!(std::fs::read_dir(elsewhere.path()).expect("there").count(), 0, "nothing was created behind the link");
}

#[test]
fn link_with_the_name_of_a_domain_file_does_not_change_its_target() {
    use std::os::unix::fs::PermissionsExt;
    let domain = TestDomain::new("link");
    let folder = tempfile::tempdir().expect("a folder");
    let target = folder.path().join("shared");
    std::fs::write(&target, "of the user").expect("written");
    std::fs::set_permissions(&target, std::fs::Permissions::from_mode(0o644)).expect("set");
    let link = format!("/dev/shm/{}x.global_mgmt", domain.0.prefix());
    std::os::unix::fs::symlink(&target, &link).expect("linked");
    drop(domain.0.node("node").expect("a node"));
    let mode = std::fs::metadata(&target).expect("there").permissions().mode() & 0o777;
    assert_eq!(mode, 0o644, "the mode of another file was changed");
    domain.0.wipe().expect("wiped");
    assert!(target.exists() && std::fs::symlink_metadata(&link).is_err(), "the link is removed, not its target");
}

#[test]
fn domains_of_an_output_are_found() {
    let domain = TestDomain::new("found");
    let output = std::path::Path::new("/nowhere/of/this/test").join(std::process::id().to_string());
    let _node = domain.0.node("node").expect("a node");
    assert_eq!(Domain::find_abandoned(&output).expect("listed"), []);
    domain.0.write_output(&output).expect("written");
    assert_eq!(Domain::find_abandoned(&output).expect("listed"), std::slice::from_ref(&domain.0));
    assert_ne!(Domain::random().expect("a name"), Domain::random().expect("a name"));
    assert!(!domain.0.is_taken().expect("listed"));
}

#[test]
fn ports_of_process_killed_while_creating_a_file_are_removed() {
    let domain = TestDomain::new("unfinished");
    let pair = pair(&domain.0);
    let node = &pair.nodes[0];
    assert!(node.remove_dead_ports(), "all files of a channel have a length");
    let path = format!("/dev/shm/{}unfinished.connection", domain.0.prefix());
    let file = std::fs::File::create(&path).expect("made");
    assert!(!node.remove_dead_ports(), "a process may be creating it");
    file.set_modified(std::time::SystemTime::now() - Duration::from_mins(1)).expect("set");
    assert!(node.remove_dead_ports());
    assert!(!std::path::Path::new(&path).exists(), "the process that was creating it is dead");
}

#[test]
fn row_sizes_match_byte_tables() {
    assert_eq!(size_of::<SweepPoint>(), 20);
    assert_eq!(size_of::<messages::SubmapPoint>(), 28);
    assert_eq!(size_of::<Envelope>(), 64);
    assert_eq!(size_of::<ClassRow>(), 2);
    assert_eq!(size_of::<messages::TickRow>(), 48);
}

#[test]
fn unwritten_part_of_slot_uses_no_memory() {
    let domain = TestDomain::new("large");
    let mut pair = pair(&domain.0);
    for capacity in [10, messages::SweepTopic::MAX_ROWS] {
        let mut loan = pair.publisher.loan(capacity).expect("loaned");
        loan.grow(10).expect("fits");
        pair.publisher.send(loan, Envelope::default()).expect("sent");
        pair.subscriber.receive().expect("no error").expect("a message");
    }
    assert!(pair.publisher.loan(messages::SweepTopic::MAX_ROWS + 1).is_err());
    assert!(domain.0.used_bytes() < 4 << 20, "memory that is never written is never used");
}

/// iceoryx2 0.10 loses a slot with each growth of its slots until none is left: sizes from 50 to half a million rows failed
/// at 4 MB. Therefore all slots have the largest size.
#[test]
fn messages_of_growing_size_are_sent_without_loss() {
    let domain = TestDomain::new("growth");
    let mut pair = pair(&domain.0);
    let mut seq = 0;
    for shift in 0..=19 {
        for _ in 0..20 {
            // `send` loans a few rows more than it writes.
            let n_points = (1 << shift) - if shift == 19 { 5 } else { 0 };
            send(&mut pair.publisher, seq, n_points);
            let received = pair.subscriber.receive().expect("no error").expect("a message");
            assert_eq!(received.rows().len(), n_points);
            seq += 1;
        }
    }
}

/// Between the death of a producer and the removal of its entry, its memory is gone.
#[test]
fn consumer_of_a_dead_producer_waits_instead_of_failing() {
    let domain = TestDomain::new("dead");
    let channel = Channel::new::<SweepTopic>(SweepTopic::TOPIC, "producer.wake", &["consumer.wake".to_owned()]);
    let supervisor = domain.0.node("supervisor").expect("node");
    let mut services = ServiceHandles::default();
    services.create_channel(&supervisor, &channel).expect("created");
    services.create_wake(&supervisor, "producer.wake", 1).expect("created");
    services.create_wake(&supervisor, "consumer.wake", 1).expect("created");
    let [producer, consumer] = ["producer", "consumer"].map(|name| domain.0.node(name).expect("node"));
    let mut subscriber: Subscriber<SweepTopic> =
        Subscriber::open(&consumer, &channel, "consumer.wake").expect("opened");
    let _publisher: Publisher<SweepTopic> = Publisher::open(&producer, &channel).expect("opened");
    let is_memory = |name: &str| name.starts_with(&domain.0.prefix()) && name.rsplit('.').next() == Some("data");
    let memories = std::fs::read_dir("/dev/shm").expect("lists").flatten();
    let removed = memories.filter(|entry| is_memory(&entry.file_name().to_string_lossy()));
    assert!(removed.map(|entry| std::fs::remove_file(entry.path()).expect("removes")).count() > 0);
    assert!(!subscriber.connect().expect("waits"));
    assert!(subscriber.receive().expect("waits").is_none());
}
