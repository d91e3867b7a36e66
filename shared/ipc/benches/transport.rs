//! One topic against a Unix socket that copies: latency of the hand-over and throughput when every byte is written and
//! read, at 1 KB to 64 MB. Two processes; medians. `cargo bench -p ipc --bench transport`
//!
//! The consumer is this program again, started with `CONSUMER` set; it answers each message on a channel back.

use ipc::{Channel, Domain, Keeper, Node, Publisher, Subscriber, Wake};
use messages::{Envelope, Message, NoHeader, Pod};
use std::io::{Read, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::time::{Duration, Instant};

const SIZES: [usize; 6] = [1 << 10, 64 << 10, 1 << 20, 4 << 20, 16 << 20, 64 << 20];
const PATIENCE: Duration = Duration::from_millis(100);

/// Plain bytes.
struct Bytes;
impl Message for Bytes {
    const TOPIC: &'static str = "bytes";
    const VERSION: u32 = 1;
    const QUEUE: usize = 2;
    const BORROWED: usize = 1;
    const MAX_ROWS: usize = (64 << 20) / 8;
    type Header = NoHeader;
    type Row = u64;
}

/// Rounds per size: about a gigabyte, at least 30 for a median that means something.
fn rounds(size: usize) -> usize {
    ((1_usize << 30) / size).clamp(30, 2000)
}

fn channels() -> [Channel; 2] {
    let name = |text: &str| text.to_owned();
    [
        Channel::of::<Bytes>("there", "producer.wake", &[name("consumer.wake")]),
        Channel::of::<Bytes>("back", "consumer.wake", &[name("producer.wake")]),
    ]
}

struct End {
    out: Publisher<Bytes>,
    inward: Subscriber<Bytes>,
    wake: Wake,
    _node: Node,
}

impl End {
    fn open(domain: &Domain, name: &str, out: &Channel, inward: &Channel) -> Self {
        let node = domain.node(name).expect("node");
        let own = format!("{name}.wake");
        let wake = Wake::open(&node, &own).expect("wake");
        let out = Publisher::open(&node, out).expect("publisher");
        let inward = Subscriber::open(&node, inward, &own).expect("subscriber");
        let end = Self { out, inward, wake, _node: node };
        while !(end.out.connect().expect("connects") & end.inward.connect().expect("connects")) {
            end.wake.wait(PATIENCE).expect("waits");
        }
        end
    }
    /// Sends `n` words; the first says whether the reader shall read all.
    fn send(&mut self, seq: u64, n: usize, touch: bool) {
        while !self.out.has_credit().expect("credit") {
            self.wake.wait(PATIENCE).expect("waits");
        }
        let mut loan = self.out.loan(n).expect("loan");
        if touch {
            // `grow` writes every word once; that is the producer's part of the work.
            loan.grow(n).expect("fits").fill(seq);
        } else {
            loan.grow(1).expect("fits")[0] = seq;
        }
        self.out.send(loan, Envelope { seq, ..Envelope::zeroed() }).expect("sent");
    }
    fn receive(&mut self) -> u64 {
        loop {
            if let Some(message) = self.inward.receive().expect("received") {
                return message.rows().iter().fold(0, |sum, word| sum ^ word);
            }
            self.wake.wait(PATIENCE).expect("waits");
        }
    }
}

fn consume(domain: &Domain, socket: &str) {
    let [there, back] = channels();
    let mut end = End::open(domain, "consumer", &back, &there);
    let mut stream = UnixStream::connect(socket).expect("connects");
    for size in SIZES {
        for _touch in [false, true] {
            for round in 0..rounds(size) {
                std::hint::black_box(end.receive());
                end.send(round as u64, 1, false);
            }
        }
        let mut buffer = vec![0_u8; size];
        for _ in 0..rounds(size) {
            stream.read_exact(&mut buffer).expect("reads");
            let (words, _) = buffer.as_chunks::<8>();
            std::hint::black_box(words.iter().fold(0, |sum, word| sum ^ u64::from_le_bytes(*word)));
            stream.write_all(&[1]).expect("writes");
        }
    }
    // The last answers must have been taken before this end goes.
    while end.out.n_waiting().expect("credit") > 0 {
        end.wake.wait(PATIENCE).expect("waits");
    }
}

fn median_us(mut times: Vec<Duration>) -> f64 {
    times.sort_unstable();
    times[times.len() / 2].as_secs_f64() * 1e6
}

fn main() {
    if let (Ok(name), Ok(socket)) = (std::env::var("CONSUMER"), std::env::var("SOCKET")) {
        consume(&Domain::new(&name).expect("name"), &socket);
        return;
    }
    let name = format!("bench{}", std::process::id());
    let domain = Domain::new(&name).expect("name");
    let supervisor = domain.node("supervisor").expect("node");
    let mut keeper = Keeper::default();
    let [there, back] = channels();
    for channel in [&there, &back] {
        keeper.create_channel(&supervisor, channel).expect("created");
        keeper.create_wake(&supervisor, &channel.producer, 2).expect("created");
    }
    let socket = domain.root().join("bench.socket");
    let listener = UnixListener::bind(&socket).expect("binds");
    let mut consumer = std::process::Command::new(std::env::current_exe().expect("a path"))
        .env("CONSUMER", &name)
        .env("SOCKET", &socket)
        .spawn()
        .expect("starts");
    let mut end = End::open(&domain, "producer", &there, &back);
    let (mut stream, _) = listener.accept().expect("accepts");
    println!("| size | hand-over there and back, us | written and read, us | GB/s | Unix socket, us | GB/s | ratio |");
    println!("|---|---|---|---|---|---|---|");
    for size in SIZES {
        let words = size / 8;
        let mut round_trips = |touch: bool| -> f64 {
            let times = (0..rounds(size)).map(|round| {
                let begun = Instant::now();
                end.send(round as u64, words, touch);
                end.receive();
                begun.elapsed()
            });
            median_us(times.collect())
        };
        let (hand_over, touched) = (round_trips(false), round_trips(true));
        let mut buffer = vec![0_u8; size];
        let times = (0..rounds(size)).map(|round| {
            let begun = Instant::now();
            buffer.fill(round as u8);
            stream.write_all(&buffer).expect("writes");
            stream.read_exact(&mut [0]).expect("reads");
            begun.elapsed()
        });
        let copied = median_us(times.collect());
        let rate = |us: f64| size as f64 / us * 1e-3;
        println!(
            "| {} KB | {hand_over:.0} | {touched:.0} | {:.2} | {copied:.0} | {:.2} | {:.1} |",
            size >> 10,
            rate(touched),
            rate(copied),
            copied / touched
        );
    }
    assert!(consumer.wait().expect("ends").success());
    drop((end, keeper, supervisor));
    domain.wipe().expect("wiped");
}
