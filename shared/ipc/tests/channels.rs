//! What a channel promises: in place, in order, nothing lost, nobody else's.

mod support;

use ipc::{
    Channel, Domain, IpcError, Keeper, LatestPublisher, LatestSubscriber, Publisher, Received, Subscriber, Transport,
};
use messages::{ClassRow, Envelope, Message, Pod, SweepPoint};
use std::time::Duration;
use support::{Pair, TestDomain, pair, pair_over, send, sweep_channel};

/// The next message; over a socket it takes a moment to come.
fn receive(pair: &mut Pair) -> Received<messages::Sweep> {
    for _ in 0..100 {
        if let Some(received) = pair.subscriber.receive().expect("no error") {
            return received;
        }
        pair.consumer_wake.wait(Duration::from_millis(100)).expect("waits");
    }
    panic!("no message has come");
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
fn rows_are_read_where_they_were_written() {
    let domain = TestDomain::new("inplace");
    let mut pair = pair(&domain.0);
    let written_at = send(&mut pair.publisher, 0, 100_000);
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
fn a_full_queue_stops_the_producer_and_nothing_is_lost() {
    for (name, transport) in [("credit", Transport::Shared), ("creditcopy", Transport::Copying)] {
        let domain = TestDomain::new(name);
        let mut pair = pair_over(&domain.0, transport);
        let mut sent = 0;
        while pair.publisher.has_credit().expect("no error") {
            send(&mut pair.publisher, sent, 10 + sent as usize);
            sent += 1;
        }
        assert_eq!(sent as usize, messages::Sweep::QUEUE);
        let mut held = Vec::new();
        // Sizes grow, so slots are reallocated while older messages are still held.
        for expected in 0..200 {
            let received = receive(&mut pair);
            assert_eq!(received.envelope().seq, expected);
            assert_eq!(received.header().n_rings, 32);
            assert_eq!(received.rows().last().map(|row| row.x), Some((expected * 1000 + 9 + expected) as f32));
            held.push(received);
            if held.len() > messages::Sweep::BORROWED {
                held.remove(0);
            }
            assert!(pair.publisher.has_credit().expect("no error"));
            send(&mut pair.publisher, sent, 10 + sent as usize);
            sent += 1;
        }
    }
}

/// Far more than a socket holds: the producer is done all the same, because a queue's length is read ahead.
#[test]
fn a_copying_producer_does_not_wait_for_a_consumer_that_does_not_look() {
    let domain = TestDomain::new("ahead");
    let mut pair = pair_over(&domain.0, Transport::Copying);
    for seq in 0..messages::Sweep::QUEUE as u64 {
        send(&mut pair.publisher, seq, 500_000);
    }
    assert!(!pair.publisher.has_credit().expect("no error"));
    for expected in 0..messages::Sweep::QUEUE as u64 {
        let received = receive(&mut pair);
        assert_eq!(received.envelope().seq, expected);
        assert_eq!(received.rows()[499_999].x, (expected * 1000 + 499_999) as f32);
        assert!(mapping_of(received.rows().as_ptr().addr()).contains(" 0 "), "the rows are the consumer's own");
    }
    assert!(pair.publisher.has_credit().expect("no error"));
}

#[test]
fn a_copying_consumer_of_another_layout_is_refused() {
    let domain = TestDomain::new("hello");
    let pair = pair_over(&domain.0, Transport::Copying);
    let node = domain.0.node("stranger").expect("node");
    let channel = Channel { layout: messages::Class::LAYOUT, ..sweep_channel(Transport::Copying) };
    assert!(matches!(Publisher::<messages::Sweep>::open(&node, &channel), Err(IpcError::Transport { .. })));
    drop(pair.subscriber);
    let stranger = Subscriber::<messages::Sweep>::open(&node, &channel, "consumer.wake").expect("opened");
    stranger.connect().expect("knocks");
    assert!(matches!(pair.publisher.connect(), Err(IpcError::Transport { .. })));
}

#[test]
fn another_layout_or_version_is_refused() {
    let domain = TestDomain::new("layout");
    let pair = pair(&domain.0);
    let node = domain.0.node("stranger").expect("node");
    let mut channel = Channel::of::<messages::Sweep>("sweep", "producer.wake", &["consumer.wake".to_owned()]);
    channel.version += 1;
    assert!(matches!(Publisher::<messages::Sweep>::open(&node, &channel), Err(IpcError::Transport { .. })));
    channel.version -= 1;
    channel.layout = messages::Class::LAYOUT;
    assert!(matches!(Publisher::<messages::Sweep>::open(&node, &channel), Err(IpcError::Transport { .. })));
    // A program of the other type that was told so meets the service's own attributes.
    assert!(matches!(Publisher::<messages::Class>::open(&node, &channel), Err(IpcError::Transport { .. })));
    drop(pair);
}

#[test]
fn a_reader_sees_the_latest_value_only() {
    let domain = TestDomain::new("latest");
    let node = domain.0.node("supervisor").expect("node");
    let mut keeper = Keeper::default();
    keeper.create_latest(&node, "health").expect("created");
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
fn shared_memory_is_the_owners_alone_and_a_wipe_leaves_nothing() {
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
    // As after SIGKILL: nobody runs a destructor.
    std::mem::forget(pair);
    domain.0.wipe().expect("wiped");
    assert_eq!(files(&domain.0), Vec::<std::path::PathBuf>::new());
    assert!(!domain.0.root().exists());
    assert!(!files(&other.0).is_empty(), "another run's memory is not touched");
}

#[test]
fn the_dead_are_forgotten_also_if_one_died_while_he_made_a_file() {
    let domain = TestDomain::new("unfinished");
    let pair = pair(&domain.0);
    let node = &pair.nodes[0];
    assert!(node.forget_dead(), "all files of a channel have a length");
    let path = format!("/dev/shm/{}unfinished.connection", domain.0.prefix());
    let file = std::fs::File::create(&path).expect("made");
    assert!(!node.forget_dead(), "somebody may be making it");
    file.set_modified(std::time::SystemTime::now() - Duration::from_mins(1)).expect("set");
    assert!(node.forget_dead());
    assert!(!std::path::Path::new(&path).exists(), "who would have made it is dead");
}

#[test]
fn rows_have_the_sizes_of_their_byte_tables() {
    assert_eq!(size_of::<SweepPoint>(), 20);
    assert_eq!(size_of::<messages::SubmapPoint>(), 28);
    assert_eq!(size_of::<Envelope>(), 64);
    assert_eq!(size_of::<ClassRow>(), 2);
    assert_eq!(size_of::<messages::TickRow>(), 48);
}

#[test]
fn a_slot_is_reserved_at_full_size_and_used_as_far_as_written() {
    let domain = TestDomain::new("large");
    let mut pair = pair(&domain.0);
    for capacity in [10, messages::Sweep::MAX_ROWS] {
        let mut loan = pair.publisher.loan(capacity).expect("loaned");
        loan.grow(10).expect("fits");
        pair.publisher.send(loan, Envelope::zeroed()).expect("sent");
        pair.subscriber.receive().expect("no error").expect("a message");
    }
    assert!(pair.publisher.loan(messages::Sweep::MAX_ROWS + 1).is_err());
    assert!(domain.0.used_bytes() < 4 << 20, "memory that is never written is never used");
}

/// iceoryx2 0.10 loses a slot with each growth of its slots, and then all of them: sizes from 50 to half a million rows
/// failed at 4 MB. Slots have had one size since.
#[test]
fn messages_may_grow_as_long_as_they_fit() {
    let domain = TestDomain::new("growth");
    let mut pair = pair(&domain.0);
    let mut seq = 0;
    for shift in 0..=19 {
        for _ in 0..20 {
            // `send` lends a few rows more than it writes.
            let n_points = (1 << shift) - if shift == 19 { 5 } else { 0 };
            send(&mut pair.publisher, seq, n_points);
            let received = pair.subscriber.receive().expect("no error").expect("a message");
            assert_eq!(received.rows().len(), n_points);
            seq += 1;
        }
    }
}
