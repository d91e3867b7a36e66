//! What those who look on promise: they see what goes by, as bytes, and hold nobody up unless they must miss nothing.

mod support;

use ipc::{Looking, Observer};
use messages::{Message, Sweep, SweepPoint, pod};
use support::{TestDomain, pair, send};

/// An onlooker that closed the services of an attempt that was over took those of the next attempt away.
#[test]
fn who_leaves_late_takes_nothing_from_the_next_attempt() {
    let domain = TestDomain::new("late");
    let first = pair(&domain.0);
    let late = domain.0.visit("onlooker", |node| Observer::open(node, &first.channel, Looking::Dropping));
    let late = late.expect("attached");
    assert!(late.is_current());
    drop(first);
    domain.0.wipe().expect("wiped");
    let mut second = pair(&domain.0);
    assert!(!late.is_current());
    drop(late);
    let visit = domain.0.visit("onlooker", |node| Observer::open(node, &second.channel, Looking::Dropping));
    let mut visit = visit.expect("the services are still there");
    send(&mut second.publisher, 0, 10);
    assert!(visit.receive().expect("no error").is_some());
}

#[test]
fn there_is_nothing_to_visit_where_no_run_is() {
    let domain = TestDomain::new("nobody");
    let error = domain.0.visit("onlooker", |_| Ok(())).err().expect("nobody is there").to_string();
    assert!(error.contains("no run at"), "{error}");
    assert!(!domain.0.root().exists(), "looking leaves nothing");
}

#[test]
fn an_observer_sees_header_and_rows_as_bytes() {
    let domain = TestDomain::new("observe");
    let mut pair = pair(&domain.0);
    let node = domain.0.node("observer").expect("node");
    let mut observer = Observer::open(&node, &pair.channel, Looking::Dropping).expect("attached");
    send(&mut pair.publisher, 0, 100);
    let received = pair.subscriber.receive().expect("no error").expect("a message");
    let observed = observer.receive().expect("no error").expect("a message");
    assert_eq!(observed.envelope(), received.envelope());
    assert_eq!(observed.header(), pod::bytes_from_rows(std::slice::from_ref(received.header())));
    assert_eq!(observed.rows(), pod::bytes_from_rows(received.rows()));
    assert_eq!(observed.rows().len(), 100 * size_of::<SweepPoint>());
}

#[test]
fn a_dropping_observer_that_does_not_look_holds_nobody_up() {
    let domain = TestDomain::new("drop");
    let mut pair = pair(&domain.0);
    let node = domain.0.node("observer").expect("node");
    let mut observer = Observer::open(&node, &pair.channel, Looking::Dropping).expect("attached");
    let n_messages = 10 * Sweep::QUEUE as u64;
    for seq in 0..n_messages {
        assert!(pair.publisher.has_credit().expect("no error"), "message {seq}");
        send(&mut pair.publisher, seq, 10);
        let received = pair.subscriber.receive().expect("no error").expect("the consumer gets them all");
        assert_eq!(received.envelope().seq, seq);
    }
    let seen = std::iter::from_fn(|| observer.receive().expect("no error")).count();
    assert_eq!(seen, Sweep::QUEUE, "what fitted its queue");
}

#[test]
fn a_lossless_observer_is_waited_for_and_forgotten_when_it_leaves() {
    let domain = TestDomain::new("lossless");
    let mut pair = pair(&domain.0);
    let node = domain.0.node("observer").expect("node");
    let mut observer = Observer::open(&node, &pair.channel, Looking::Lossless).expect("attached");
    assert!(observer.connect().expect("connects"));
    let mut sent = 0;
    while pair.publisher.has_credit().expect("no error") {
        send(&mut pair.publisher, sent, 10);
        pair.subscriber.receive().expect("no error").expect("the consumer takes at once");
        sent += 1;
    }
    assert_eq!(sent as usize, Sweep::QUEUE, "the observer's queue is full");
    for expected in 0..50 {
        let observed = observer.receive().expect("no error").expect("a message");
        assert_eq!(observed.envelope().seq, expected);
        assert!(pair.publisher.has_credit().expect("no error"));
        send(&mut pair.publisher, sent, 10);
        pair.subscriber.receive().expect("no error").expect("the consumer takes at once");
        sent += 1;
    }
    assert!(!pair.publisher.has_credit().expect("no error"));
    drop(observer);
    assert!(pair.publisher.has_credit().expect("no error"), "who has left is owed nothing");
}

#[test]
fn a_message_on_its_way_while_a_lossless_observer_comes_counts_as_owed() {
    let domain = TestDomain::new("between");
    let mut pair = pair(&domain.0);
    assert!(pair.publisher.has_credit().expect("no error"), "nobody else is there");
    let node = domain.0.node("observer").expect("node");
    let mut observer = Observer::open(&node, &pair.channel, Looking::Lossless).expect("attached");
    assert!(observer.connect().expect("connects"));
    let mut sent = 0;
    loop {
        // The first one by the credit of before.
        send(&mut pair.publisher, sent, 10);
        pair.subscriber.receive().expect("no error").expect("the consumer takes at once");
        sent += 1;
        if !pair.publisher.has_credit().expect("no error") {
            break;
        }
    }
    let seen: Vec<u64> =
        std::iter::from_fn(|| observer.receive().expect("no error")).map(|observed| observed.envelope().seq).collect();
    assert_eq!(seen, (0..sent).collect::<Vec<_>>(), "what was sent fitted its queue");
}

#[test]
fn a_lossless_observer_that_was_overrun_before_it_was_known_does_not_stop_the_producer() {
    let domain = TestDomain::new("overrun");
    let mut pair = pair(&domain.0);
    let node = domain.0.node("observer").expect("node");
    let mut observer = Observer::open(&node, &pair.channel, Looking::Lossless).expect("attached");
    let n_messages = 3 * Sweep::QUEUE as u64;
    for seq in 0..n_messages {
        // Nobody asks for credit: the producer does not know of the observer.
        send(&mut pair.publisher, seq, 10);
        pair.subscriber.receive().expect("no error").expect("the consumer takes at once");
    }
    while observer.receive().expect("no error").is_some() {}
    assert!(!pair.publisher.has_credit().expect("no error"), "it may still be on its way to the rest");
    // It looks, and looks again, and there is nothing.
    for _ in 0..2 {
        assert!(observer.receive().expect("no error").is_none());
        pair.publisher.has_credit().expect("no error");
    }
    assert!(pair.publisher.has_credit().expect("no error"));
    send(&mut pair.publisher, n_messages, 10);
    let observed = observer.receive().expect("no error").expect("a message");
    assert_eq!(observed.envelope().seq, n_messages);
}

#[test]
fn a_second_lossless_observer_is_refused_and_a_fourth_of_any_kind() {
    let domain = TestDomain::new("many");
    let pair = pair(&domain.0);
    let node = domain.0.node("observer").expect("node");
    let _first = Observer::open(&node, &pair.channel, Looking::Lossless).expect("attached");
    assert!(Observer::open(&node, &pair.channel, Looking::Lossless).is_err());
    let _others = [0, 1].map(|_| Observer::open(&node, &pair.channel, Looking::Dropping).expect("attached"));
    assert!(Observer::open(&node, &pair.channel, Looking::Dropping).is_err());
}
