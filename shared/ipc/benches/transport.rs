//! Compares a topic with a Unix socket that copies, at 1 KB to 64 MB, between two processes:
//!
//! - *hand-over*: from the payload being ready at the producer to its first word being read by the consumer,
//!   which sleeps on its wake or polls; the payload is not touched otherwise,
//! - *written and read*: a round trip in which the producer writes every byte and the consumer reads every byte.
//!
//! `cargo bench -p ipc --bench transport [-- --load]`; `--load` keeps every core busy with a separate process
//! meanwhile.
//! The consumer is this program again, started with `CONSUMER` set; it answers each message on a channel back.

use ipc::{Channel, Domain, Node, Publisher, ServiceHandles, Subscriber, Wake};
use messages::{Envelope, Message, NoHeader};
use rustix::process::{Signal, set_parent_process_death_signal};
use rustix::time::{ClockId, clock_gettime};
use std::io::{Read, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::process::{Child, Command};
use std::time::{Duration, Instant};

const SIZES: [usize; 6] = [1 << 10, 64 << 10, 1 << 20, 4 << 20, 16 << 20, 64 << 20];
const PATIENCE: Duration = Duration::from_millis(100);
/// Hand-overs of each size and kind; large messages cost no more.
const HAND_OVERS: usize = 500;
/// Messages before the measured ones: the pages of the slots are touched for the first time.
const WARM_UP: usize = 8;

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

/// Kind of measurement, in this order for each size.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    ByWake,
    ByPoll,
    Touched,
}
const KINDS: [Kind; 3] = [Kind::ByWake, Kind::ByPoll, Kind::Touched];

/// Rounds per size: for whole messages about a gigabyte, at least 30 for a meaningful median.
fn rounds(size: usize, kind: Kind) -> usize {
    WARM_UP + if kind == Kind::Touched { ((1_usize << 30) / size).clamp(30, 2000) } else { HAND_OVERS }
}

/// Rounds over the socket, where a hand-over is a copy.
fn socket_rounds(size: usize) -> usize {
    rounds(size, Kind::Touched).min(HAND_OVERS)
}

fn channels() -> [Channel; 2] {
    let name = |text: &str| text.to_owned();
    [
        Channel::new::<Bytes>("there", "producer.wake", &[name("consumer.wake")]),
        Channel::new::<Bytes>("back", "consumer.wake", &[name("producer.wake")]),
    ]
}

/// The monotonic clock, the same in both processes.
fn now_nanos() -> u64 {
    let now = clock_gettime(ClockId::Monotonic);
    now.tv_sec as u64 * 1_000_000_000 + now.tv_nsec as u64
}

struct End {
    out: Publisher<Bytes>,
    inward: Subscriber<Bytes>,
    wake: Wake,
    node: Node,
}

impl End {
    fn open(domain: &Domain, name: &str, out: &Channel, inward: &Channel) -> Self {
        let node = domain.node(name).expect("node");
        let own = format!("{name}.wake");
        let wake = node.open_wake(&own).expect("wake");
        let out = Publisher::open(&node, out).expect("publisher");
        let inward = Subscriber::open(&node, inward, &own).expect("subscriber");
        let end = Self { out, inward, wake, node };
        while !(end.out.connect().expect("connects") & end.inward.connect().expect("connects")) {
            end.wake.wait(PATIENCE).expect("waits");
        }
        end
    }
    /// Sends `n` words, all written or only the first.
    fn send(&mut self, first: u64, n: usize, kind: Kind) {
        while !self.out.has_room(1).expect("credit") {
            if kind != Kind::ByPoll {
                self.wake.wait(PATIENCE).expect("waits");
            }
        }
        let mut loan = self.out.loan(n).expect("loan");
        loan.grow_with(if kind == Kind::Touched { n } else { 1 }, |_| first).expect("fits");
        let sent_nanos = now_nanos();
        self.out.send(loan, Envelope { sent_nanos, ..Envelope::default() }).expect("sent");
        self.node.wake_all();
    }
    /// Receives a message. Returns the nanoseconds since it was sent, and the sum of all its words.
    fn receive(&mut self, kind: Kind) -> (u64, u64) {
        loop {
            if let Some(message) = self.inward.receive().expect("received") {
                self.node.wake_all();
                let first = std::hint::black_box(message.rows()[0]);
                let late = now_nanos() - message.envelope().sent_nanos;
                let rest = if kind == Kind::Touched { &message.rows()[1..] } else { &[] };
                return (late, rest.iter().fold(first, |sum, word| sum ^ word));
            }
            if kind != Kind::ByPoll {
                self.wake.wait(PATIENCE).expect("waits");
            }
        }
    }
}

fn consume(domain: &Domain, socket: &str) {
    let [there, back] = channels();
    let mut end = End::open(domain, "consumer", &back, &there);
    let mut stream = UnixStream::connect(socket).expect("connects");
    for size in SIZES {
        for kind in KINDS {
            for _ in 0..rounds(size, kind) {
                let (late, sum) = end.receive(kind);
                std::hint::black_box(sum);
                // The answer is small and contains the delay of the message.
                end.send(late, 1, if kind == Kind::ByPoll { kind } else { Kind::ByWake });
            }
        }
        let mut buffer = vec![0_u8; size];
        for _ in 0..socket_rounds(size) {
            stream.read_exact(&mut buffer).expect("reads");
            let late = now_nanos() - u64::from_le_bytes(buffer[..8].try_into().expect("8 bytes"));
            let (words, _) = buffer.as_chunks::<8>();
            std::hint::black_box(words.iter().fold(0, |sum, word| sum ^ u64::from_le_bytes(*word)));
            stream.write_all(&late.to_le_bytes()).expect("writes");
        }
    }
    // The last answers must have been taken before this end closes.
    end.node.wake_all();
    while end.out.n_waiting().expect("credit") > 0 {
        end.wake.wait(PATIENCE).expect("waits");
    }
}

/// Median and 99th percentile, microseconds, without the warm-up.
fn percentiles_us(mut nanos: Vec<u64>) -> (f64, f64) {
    nanos.drain(..WARM_UP);
    nanos.sort_unstable();
    let at = |share: f64| nanos[((nanos.len() - 1) as f64 * share) as usize] as f64 * 1e-3;
    (at(0.5), at(0.99))
}

/// Figures of one size, microseconds.
#[derive(Default)]
struct Row {
    by_wake: (f64, f64),
    by_poll: (f64, f64),
    touched: f64,
    socket: (f64, f64),
    socket_touched: f64,
}

fn measure(size: usize, end: &mut End, stream: &mut UnixStream) -> Row {
    let mut row = Row::default();
    for kind in KINDS {
        let mut late = Vec::new();
        let mut whole = Vec::new();
        for round in 0..rounds(size, kind) {
            let begun = Instant::now();
            end.send(round as u64, size / 8, kind);
            loop {
                // Only the answer's first word is used; the rest is never touched.
                if let Some(answer) = end.inward.receive().expect("received") {
                    late.push(answer.rows()[0]);
                    break;
                }
                if kind != Kind::ByPoll {
                    end.wake.wait(PATIENCE).expect("waits");
                }
            }
            whole.push(begun.elapsed().as_nanos() as u64);
        }
        match kind {
            Kind::ByWake => row.by_wake = percentiles_us(late),
            Kind::ByPoll => row.by_poll = percentiles_us(late),
            Kind::Touched => row.touched = percentiles_us(whole).0,
        }
    }
    let mut buffer = vec![0_u8; size];
    let mut late = Vec::new();
    let mut whole = Vec::new();
    for round in 0..socket_rounds(size) {
        let begun = Instant::now();
        buffer.fill(round as u8);
        buffer[..8].copy_from_slice(&now_nanos().to_le_bytes());
        stream.write_all(&buffer).expect("writes");
        let mut answer = [0; 8];
        stream.read_exact(&mut answer).expect("reads");
        late.push(u64::from_le_bytes(answer));
        whole.push(begun.elapsed().as_nanos() as u64);
    }
    row.socket = percentiles_us(late);
    row.socket_touched = percentiles_us(whole).0;
    row
}

/// One busy process per core.
fn load() -> Vec<Child> {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let start = |_| Command::new(std::env::current_exe().expect("a path")).env("LOAD", "1").spawn().expect("starts");
    (0..cores).map(start).collect()
}

fn print_goals(rows: &[Row], loaded: bool) {
    let small = &rows[0];
    let large = &rows[rows.len() - 1];
    let goals = [
        ("hand-over of 64 MB / 1 KB, by wake", large.by_wake.0 / small.by_wake.0, "<=", 3.0, true),
        ("hand-over of 64 MB / 1 KB, by poll", large.by_poll.0 / small.by_poll.0, "<=", 3.0, true),
        ("hand-over of 64 MB by wake under load, us", large.by_wake.0, "<", 100.0, loaded),
        ("socket / topic: hand-over of 64 MB, by wake", large.socket.0 / large.by_wake.0, ">=", 200.0, true),
        ("topic / socket: throughput at 64 MB", large.socket_touched / large.touched, ">=", 2.5, true),
    ];
    println!("\n| figure | measured | goal | |\n|---|---|---|---|");
    for (name, value, sign, goal, _) in goals.iter().filter(|goal| goal.4) {
        let reached = if *sign == ">=" { value >= goal } else { value <= goal };
        println!("| {name} | {value:.2} | {sign} {goal} | {} |", if reached { "reached" } else { "MISSED" });
    }
}

fn main() {
    if std::env::var_os("LOAD").is_some() || std::env::var_os("CONSUMER").is_some() {
        // Ends the busy processes even if the bench fails.
        set_parent_process_death_signal(Some(Signal::KILL)).expect("Linux");
    }
    if std::env::var_os("LOAD").is_some() {
        loop {
            std::hint::spin_loop();
        }
    }
    if let (Ok(name), Ok(socket)) = (std::env::var("CONSUMER"), std::env::var("SOCKET")) {
        consume(&Domain::new(&name).expect("name"), &socket);
        return;
    }
    let loaded = std::env::args().any(|argument| argument == "--load");
    let name = format!("bench{}", std::process::id());
    let domain = Domain::new(&name).expect("name");
    let supervisor = domain.node("supervisor").expect("node");
    let mut services = ServiceHandles::default();
    let [there, back] = channels();
    for channel in [&there, &back] {
        services.create_channel(&supervisor, channel).expect("created");
        services.create_wake(&supervisor, &channel.producer, 2).expect("created");
    }
    let socket = domain.root().join("bench.socket");
    let listener = UnixListener::bind(&socket).expect("binds");
    let mut consumer = Command::new(std::env::current_exe().expect("a path"))
        .env("CONSUMER", &name)
        .env("SOCKET", &socket)
        .spawn()
        .expect("starts");
    let mut end = End::open(&domain, "producer", &there, &back);
    let (mut stream, _) = listener.accept().expect("accepts");
    let busy = if loaded { load() } else { Vec::new() };
    println!("| size | hand-over by wake p50 / p99, us | by poll p50 / p99, us | socket p50 / p99, us |");
    println!("|---|---|---|---|");
    let rows: Vec<Row> = SIZES
        .iter()
        .map(|size| {
            let row = measure(*size, &mut end, &mut stream);
            let wake = row.by_wake;
            let poll = row.by_poll;
            let socket = row.socket;
            println!(
                "| {} KB | {:.1} / {:.1} | {:.1} / {:.1} | {:.1} / {:.1} |",
                size >> 10,
                wake.0,
                wake.1,
                poll.0,
                poll.1,
                socket.0,
                socket.1
            );
            row
        })
        .collect();
    println!(
        "\n| size | written and read, us | GB/s | by socket, us | GB/s | socket / topic |\n|---|---|---|---|---|---|"
    );
    for (size, row) in SIZES.iter().zip(&rows) {
        let rate = |us: f64| *size as f64 / us * 1e-3;
        println!(
            "| {} KB | {:.0} | {:.2} | {:.0} | {:.2} | {:.1} |",
            size >> 10,
            row.touched,
            rate(row.touched),
            row.socket_touched,
            rate(row.socket_touched),
            row.socket_touched / row.touched
        );
    }
    print_goals(&rows, loaded);
    for mut process in busy {
        process.kill().expect("runs");
        process.wait().expect("ends");
    }
    assert!(consumer.wait().expect("ends").success());
    drop((end, services, supervisor));
    domain.wipe().expect("wiped");
}
