//! A domain, a channel and its two ends.

use ipc::{Channel, Domain, Node, Publisher, ServiceHandles, Subscriber, Wake};
use messages::{Envelope, Message, SweepHeader, SweepTopic};

/// A domain whose files are removed, even when its test fails.
pub struct TestDomain(pub Domain);

impl TestDomain {
    pub fn new(name: &str) -> Self {
        let domain = Domain::new(&format!("test{name}{}", std::process::id())).expect("name fits");
        domain.wipe().expect("wiped");
        Self(domain)
    }
}

impl Drop for TestDomain {
    fn drop(&mut self) {
        self.0.wipe().expect("wiped");
    }
}

pub struct Pair<T: Message = SweepTopic> {
    pub channel: Channel,
    pub publisher: Publisher<T>,
    pub subscriber: Subscriber<T>,
    pub consumer_wake: Wake,
    pub services: ServiceHandles,
    pub nodes: Vec<Node>,
}

fn channel_of<T: Message>() -> Channel {
    Channel::new::<T>(T::TOPIC, "producer.wake", &["consumer.wake".to_owned()])
}

pub fn pair(domain: &Domain) -> Pair {
    pair_of(domain, channel_of::<SweepTopic>())
}

/// The ends of a live run's channel: the producer never waits.
pub fn live_pair<T: Message>(domain: &Domain) -> Pair<T> {
    pair_of(domain, Channel { drops_oldest: true, ..channel_of::<T>() })
}

fn pair_of<T: Message>(domain: &Domain, channel: Channel) -> Pair<T> {
    let supervisor = domain.node("supervisor").expect("node");
    let mut services = ServiceHandles::default();
    services.create_channel(&supervisor, &channel).expect("created");
    services.create_wake(&supervisor, "producer.wake", 1).expect("created");
    services.create_wake(&supervisor, "consumer.wake", 1).expect("created");
    let producer = domain.node("producer").expect("node");
    let consumer = domain.node("consumer").expect("node");
    let consumer_wake = consumer.open_wake("consumer.wake").expect("opened");
    let publisher = Publisher::open(&producer, &channel).expect("opened");
    let subscriber = Subscriber::open(&consumer, &channel, "consumer.wake").expect("opened");
    assert!(subscriber.connect().expect("connects"));
    assert!(publisher.connect().expect("connects"));
    Pair { channel, publisher, subscriber, consumer_wake, services, nodes: vec![supervisor, producer, consumer] }
}

pub fn send(publisher: &mut Publisher<messages::SweepTopic>, seq: u64, n_points: usize) -> usize {
    let mut loan = publisher.loan(n_points + 5).expect("loaned");
    *loan.header_mut() = SweepHeader { n_rings: 32, ..SweepHeader::default() };
    let rows = loan.grow(n_points).expect("fits");
    for (i, row) in rows.iter_mut().enumerate() {
        row.x = (seq * 1000 + i as u64) as f32;
    }
    let address = rows.as_ptr().addr();
    publisher.send(loan, Envelope { seq, ..Envelope::default() }).expect("sent");
    address
}
