//! Observers: they receive messages as bytes and apply back-pressure only if they are lossless.

use crate::support::{TestDomain, pair, send};
use ipc::{Observer, ObserverMode};
use messages::{Message, SweepPoint, SweepTopic, pod};

/// An observer that closed the services of an ended attempt removed the services of the next attempt.
#[test]
fn observer_that_closes_late_keeps_services_of_next_attempt() {
    let domain = TestDomain::new("late");
    let first = pair(&domain.0);
    let late = domain.0.attach("observer", |node| Observer::open(node, &first.channel, ObserverMode::Dropping));
    let late = late.expect("attached");
    assert!(late.is_current());
    drop(first);
    domain.0.wipe().expect("wiped");
    let mut second = pair(&domain.0);
    assert!(!late.is_current());
    drop(late);
    let attached = domain.0.attach("observer", |node| Observer::open(node, &second.channel, ObserverMode::Dropping));
    let mut attached = attached.expect("the services are still there");
    send(&mut second.publisher, 0, 10);
    assert!(attached.receive().expect("no error").is_some());
}

#[test]
fn attach_without_run_fails_and_leaves_nothing() {
    let domain = TestDomain::new("norun");
    let error = domain.0.attach("observer", |_| Ok(())).err().expect("there is no run").to_string();
    assert!(error.contains("no run at"), "{error}");
    assert!(!domain.0.root().exists(), "the attempt leaves nothing");
}

#[test]
fn observer_receives_header_and_rows_as_bytes() {
    let domain = TestDomain::new("observe");
    let mut pair = pair(&domain.0);
    let node = domain.0.node("observer").expect("node");
    let mut observer = Observer::open(&node, &pair.channel, ObserverMode::Dropping).expect("attached");
    send(&mut pair.publisher, 0, 100);
    let received = pair.subscriber.receive().expect("no error").expect("a message");
    let observed = observer.receive().expect("no error").expect("a message");
    assert_eq!(observed.envelope(), received.envelope());
    assert_eq!(observed.header(), pod::bytes_from_rows(std::slice::from_ref(received.header())));
    assert_eq!(observed.rows(), pod::bytes_from_rows(received.rows()));
    assert_eq!(observed.rows().len(), 100 * size_of::<SweepPoint>());
}

#[test]
fn observer_counts_until_it_leaves() {
    let domain = TestDomain::new("counted");
    let pair = pair(&domain.0);
    assert!(!pair.services.have_observers(), "there is only the consumer");
    let node = domain.0.node("observer").expect("node");
    let observer = Observer::open(&node, &pair.channel, ObserverMode::Lossless).expect("attached");
    assert!(pair.services.have_observers());
    drop(observer);
    assert!(!pair.services.have_observers());
}

#[test]
fn idle_dropping_observer_does_not_stop_producer() {
    let domain = TestDomain::new("drop");
    let mut pair = pair(&domain.0);
    let node = domain.0.node("observer").expect("node");
    let mut observer = Observer::open(&node, &pair.channel, ObserverMode::Dropping).expect("attached");
    let n_messages = 10 * SweepTopic::QUEUE as u64;
    for seq in 0..n_messages {
        assert!(pair.publisher.has_room(1).expect("no error"), "message {seq}");
        send(&mut pair.publisher, seq, 10);
        let received = pair.subscriber.receive().expect("no error").expect("the consumer receives all");
        assert_eq!(received.envelope().seq, seq);
    }
    let seen = std::iter::from_fn(|| observer.receive().expect("no error")).count();
    assert_eq!(seen, SweepTopic::QUEUE, "messages that fitted its queue");
}

#[test]
fn lossless_observer_applies_back_pressure_until_it_leaves() {
    let domain = TestDomain::new("lossless");
    let mut pair = pair(&domain.0);
    let node = domain.0.node("observer").expect("node");
    let mut observer = Observer::open(&node, &pair.channel, ObserverMode::Lossless).expect("attached");
    assert!(observer.connect().expect("connects"));
    let mut sent = 0;
    while pair.publisher.has_room(1).expect("no error") {
        send(&mut pair.publisher, sent, 10);
        pair.subscriber.receive().expect("no error").expect("the consumer takes at once");
        sent += 1;
    }
    assert_eq!(sent as usize, SweepTopic::QUEUE, "the observer's queue is full");
    for expected in 0..50 {
        let observed = observer.receive().expect("no error").expect("a message");
        assert_eq!(observed.envelope().seq, expected);
        assert!(pair.publisher.has_room(1).expect("no error"));
        send(&mut pair.publisher, sent, 10);
        pair.subscriber.receive().expect("no error").expect("the consumer takes at once");
        sent += 1;
    }
    assert!(!pair.publisher.has_room(1).expect("no error"));
    drop(observer);
    assert!(pair.publisher.has_room(1).expect("no error"), "the observer has left");
}

#[test]
fn lossless_observer_receives_message_sent_while_it_attaches() {
    let domain = TestDomain::new("between");
    let mut pair = pair(&domain.0);
    assert!(pair.publisher.has_room(1).expect("no error"), "the queue is empty");
    let node = domain.0.node("observer").expect("node");
    let mut observer = Observer::open(&node, &pair.channel, ObserverMode::Lossless).expect("attached");
    assert!(observer.connect().expect("connects"));
    let mut sent = 0;
    loop {
        // The first one is sent by the credit from before.
        send(&mut pair.publisher, sent, 10);
        pair.subscriber.receive().expect("no error").expect("the consumer takes at once");
        sent += 1;
        if !pair.publisher.has_room(1).expect("no error") {
            break;
        }
    }
    let seen: Vec<u64> =
        std::iter::from_fn(|| observer.receive().expect("no error")).map(|observed| observed.envelope().seq).collect();
    assert_eq!(seen, (0..sent).collect::<Vec<_>>(), "all sent messages fitted its queue");
}

#[test]
fn lossless_observer_overrun_before_it_was_known_does_not_stop_producer() {
    let domain = TestDomain::new("overrun");
    let mut pair = pair(&domain.0);
    let node = domain.0.node("observer").expect("node");
    let mut observer = Observer::open(&node, &pair.channel, ObserverMode::Lossless).expect("attached");
    let n_messages = 3 * SweepTopic::QUEUE as u64;
    for seq in 0..n_messages {
        // Without requesting credit, the producer does not register the observer.
        send(&mut pair.publisher, seq, 10);
        pair.subscriber.receive().expect("no error").expect("the consumer takes at once");
    }
    while observer.receive().expect("no error").is_some() {}
    assert!(!pair.publisher.has_room(1).expect("no error"), "the rest may still arrive");
    // It polls twice and finds nothing.
    for _ in 0..2 {
        assert!(observer.receive().expect("no error").is_none());
        pair.publisher.has_room(1).expect("no error");
    }
    assert!(pair.publisher.has_room(1).expect("no error"));
    send(&mut pair.publisher, n_messages, 10);
    let observed = observer.receive().expect("no error").expect("a message");
    assert_eq!(observed.envelope().seq, n_messages);
}

#[test]
fn second_lossless_and_fourth_observer_are_refused() {
    let domain = TestDomain::new("many");
    let pair = pair(&domain.0);
    let node = domain.0.node("observer").expect("node");
    let _first = Observer::open(&node, &pair.channel, ObserverMode::Lossless).expect("attached");
    assert!(Observer::open(&node, &pair.channel, ObserverMode::Lossless).is_err());
    let _others = [0, 1].map(|_| Observer::open(&node, &pair.channel, ObserverMode::Dropping).expect("attached"));
    assert!(Observer::open(&node, &pair.channel, ObserverMode::Dropping).is_err());
}
