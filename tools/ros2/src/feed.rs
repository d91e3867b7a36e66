//! The transfer of one topic to its target.

use crate::counts::{Counts, Losses};
use crate::roles::Role;
use crate::sinks::{Sink, write_image};
use crate::subscription::Subscription;
use anyhow::anyhow;
use import::{LiveData, LiveTopic};
use std::sync::mpsc::{SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::task::Waker;
use std::thread::{self, JoinHandle};
use std::time::SystemTime;

/// Largest number of images of a camera that wait to be written: most of a second.
const MAX_WAITING: usize = 8;
/// Largest number of messages that are taken from a topic before the next topic.
const MAX_AT_ONCE: usize = 64;

/// A received message.
struct Received {
    bytes: Vec<u8>,
    /// Time of arrival, ns since the Unix epoch.
    stamp: i64,
}

/// Reads messages and writes their data.
struct Worker {
    name: String,
    topic: LiveTopic,
    sink: Sink,
    counts: Arc<Mutex<Counts>>,
}

enum Target {
    Here(Worker),
    /// Images are compressed and written by a thread per camera, so that other data does not wait for them.
    Thread(SyncSender<Received>, JoinHandle<()>),
}

/// A topic with a role.
pub struct Feed {
    pub role: Role,
    pub topic: String,
    pub subscription: Subscription,
    counts: Arc<Mutex<Counts>>,
    losses: Losses,
    target: Target,
}

impl Feed {
    pub fn new(role: Role, topic: String, kind: &str, subscription: Subscription, sink: Sink) -> anyhow::Result<Self> {
        let counts = Arc::new(Mutex::new(Counts::default()));
        let is_mosaic = matches!(role, Role::Mosaic(_));
        let reader = LiveTopic::new(kind, is_mosaic).ok_or_else(|| anyhow!("{topic}: {kind} is not taken live"))?;
        let is_image = matches!(sink, Sink::Folder(_));
        let mut worker = Worker { name: topic.clone(), topic: reader, sink, counts: Arc::clone(&counts) };
        let target = if is_image {
            let (sender, messages) = sync_channel::<Received>(MAX_WAITING);
            let work = move || messages.iter().for_each(|received| worker.handle(&received.bytes, received.stamp));
            Target::Thread(sender, thread::Builder::new().name(role.to_string()).spawn(work)?)
        } else {
            Target::Here(worker)
        };
        Ok(Self { role, topic, subscription, counts, losses: Losses::default(), target })
    }

    /// Takes the available messages. Returns whether more may be available.
    pub fn take(&mut self, waker: &Waker) -> bool {
        self.subscription.wake(waker);
        for _ in 0..MAX_AT_ONCE {
            match self.subscription.take() {
                Ok(None) => return false,
                Ok(Some(taken)) => {
                    self.losses.add(taken.publisher, taken.number);
                    self.hand_over(Received { bytes: taken.bytes, stamp: nanos_now() });
                }
                Err(reason) => leave_out(&self.counts, &self.topic, &reason),
            }
        }
        true
    }

    fn hand_over(&mut self, received: Received) {
        lock(&self.counts).n_messages += 1;
        match &mut self.target {
            Target::Here(worker) => worker.handle(&received.bytes, received.stamp),
            Target::Thread(sender, _) => {
                if let Err(TrySendError::Full(_) | TrySendError::Disconnected(_)) = sender.try_send(received) {
                    let mut counts = lock(&self.counts);
                    counts.n_dropped += 1;
                    if counts.n_dropped == 1 {
                        eprintln!("{}: image dropped: images come faster than they are written", self.topic);
                    }
                }
            }
        }
    }

    /// Writes waiting messages, and reports. Returns whether nothing was lost.
    pub fn finish(self) -> bool {
        if let Target::Thread(sender, thread) = self.target {
            drop(sender);
            // The thread has printed its panic, and its unwritten messages are counted.
            if thread.join().is_err() {
                lock(&self.counts).n_unwritten += 1;
            }
        }
        let counts = lock(&self.counts);
        let n_lost = self.losses.n_lost();
        eprintln!("{} ({}): {}", self.topic, self.role, counts.summary(n_lost));
        n_lost == 0 && counts.is_complete()
    }
}

impl Worker {
    fn handle(&mut self, message: &[u8], received: i64) {
        let read = self.topic.read(message, received);
        let n_unstamped = self.topic.n_unstamped;
        let data = match read {
            Ok(data) => data,
            Err(reason) => return leave_out(&self.counts, &self.name, &reason),
        };
        let Written { n_images, n_lines, n_packets, errors } = self.sink.write(&data);
        let mut counts = lock(&self.counts);
        counts.n_unstamped = n_unstamped;
        counts.n_images += n_images;
        counts.n_lines += n_lines;
        counts.n_packets += n_packets;
        for error in errors {
            counts.n_unwritten += 1;
            if counts.n_unwritten == 1 {
                eprintln!("{}: not written: {error:#}", self.name);
            }
        }
    }
}

/// What was written of a message.
#[derive(Default)]
struct Written {
    n_images: u64,
    n_lines: u64,
    n_packets: u64,
    /// Errors of the rest.
    errors: Vec<anyhow::Error>,
}

impl Sink {
    /// Writes the data.
    fn write(&self, data: &LiveData<'_>) -> Written {
        let split = |results: Vec<anyhow::Result<()>>| {
            let n = results.iter().filter(|result| result.is_ok()).count() as u64;
            (n, results.into_iter().filter_map(Result::err).collect())
        };
        match (self, data) {
            (Self::Folder(folder), LiveData::Image { stamp, extension, content }) => {
                let (n_images, errors) = split(vec![write_image(folder, *stamp, extension, content)]);
                Written { n_images, errors, ..Written::default() }
            }
            (Self::Udp(udp), LiveData::Lines(lines)) => {
                let (n_lines, errors) = split(lines.iter().map(|line| udp.send_line(line)).collect());
                Written { n_lines, errors, ..Written::default() }
            }
            (Self::Udp(udp), LiveData::Packets(packets)) => {
                let (n_packets, errors) = split(packets.iter().map(|packet| udp.send(packet)).collect());
                Written { n_packets, errors, ..Written::default() }
            }
            _ => Written { errors: vec![anyhow!("the role does not fit the type")], ..Written::default() },
        }
    }
}

fn leave_out(counts: &Mutex<Counts>, topic: &str, reason: &str) {
    if lock(counts).leave_out(reason) {
        eprintln!("{topic}: message left out: {reason}");
    }
}

fn lock(counts: &Mutex<Counts>) -> std::sync::MutexGuard<'_, Counts> {
    // Counts are valid after every statement.
    counts.lock().unwrap_or_else(PoisonError::into_inner)
}

fn nanos_now() -> i64 {
    SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default().as_nanos() as i64
}
