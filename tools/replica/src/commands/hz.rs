//! `replica hz`: how often messages come, and how evenly.

use crate::attach::{RunArgument, Tap, TapEvent};
use crate::terminal::StopFlag;
use ipc::{Looking, Observed};
use stage::exit;
use std::collections::VecDeque;
use std::io::Write;
use std::time::{Duration, Instant};

/// A line that changes more often cannot be read.
const LINE_EVERY: Duration = Duration::from_secs(1);

/// Shows how often messages of a topic are published, a line per second, until the run ends or Ctrl-C.
#[derive(clap::Args, Debug)]
pub struct Args {
    /// The topic.
    topic: String,
    #[command(flatten)]
    run: RunArgument,
    /// Time that a line's figures are over, s (1 to 3600).
    #[arg(long, value_name = "S", default_value_t = 10, value_parser = clap::value_parser!(u64).range(1..=3600))]
    window: u64,
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let stop = StopFlag::register(exit::DONE)?;
    let run = args.run.find_alive()?;
    let topic = run.topic(&args.topic)?.channels.topic.clone();
    let Some(mut tap) = Tap::open(run, &topic, Looking::Dropping, stop)? else { return Ok(()) };
    let mut window = Window::new(args.window);
    let mut next_line = Instant::now() + LINE_EVERY;
    loop {
        match tap.next(Some(next_line))? {
            Some(TapEvent::Message(message, missed)) => window.add(Seen::of(&message), missed),
            Some(TapEvent::Restarted(attempt)) => {
                eprintln!("restart {attempt}: the run goes on from its last barrier");
                window.seen.clear();
            }
            Some(TapEvent::Ended) => break,
            None => {}
        }
        if Instant::now() >= next_line {
            next_line += LINE_EVERY;
            say(&window.line())?;
        }
    }
    say(&window.line())
}

fn say(line: &str) -> anyhow::Result<()> {
    let mut stdout = std::io::stdout().lock();
    writeln!(stdout, "{line}")?;
    Ok(stdout.flush()?)
}

/// What counts of a message.
#[derive(Clone, Copy)]
struct Seen {
    seq: u64,
    /// When it was published: looking late does not show in the figures.
    sent_nanos: u64,
    rows: u64,
    bytes: u64,
}

impl Seen {
    fn of(message: &Observed) -> Self {
        let envelope = message.envelope();
        let bytes = message.rows().len() as u64;
        Self { seq: envelope.seq, sent_nanos: envelope.sent_nanos, rows: u64::from(envelope.len), bytes }
    }
}

/// The messages of the last seconds.
struct Window {
    nanos: u64,
    seen: VecDeque<Seen>,
    n_seen: u64,
    n_missed: u64,
}

impl Window {
    fn new(seconds: u64) -> Self {
        Self { nanos: seconds * 1_000_000_000, seen: VecDeque::new(), n_seen: 0, n_missed: 0 }
    }

    fn add(&mut self, seen: Seen, missed: u64) {
        self.n_seen += 1;
        self.n_missed += missed;
        self.seen.push_back(seen);
        let begin = seen.sent_nanos.saturating_sub(self.nanos);
        while self.seen.front().is_some_and(|first| first.sent_nanos < begin) {
            self.seen.pop_front();
        }
    }

    /// The window's figures. Messages that went by unseen count as the seen ones do.
    fn line(&self) -> String {
        let seen = format!("seen {}  unseen {}", self.n_seen, self.n_missed);
        let (Some(first), Some(last)) = (self.seen.front(), self.seen.back()) else {
            return format!("no messages  {seen}");
        };
        let seconds = last.sent_nanos.saturating_sub(first.sent_nanos) as f64 * 1e-9;
        if seconds <= 0.0 {
            return format!("one message  {seen}");
        }
        let messages_per_s = (last.seq - first.seq) as f64 / seconds;
        let mean = |count: fn(&Seen) -> u64| {
            self.seen.iter().skip(1).map(count).sum::<u64>() as f64 / (self.seen.len() - 1) as f64
        };
        format!(
            "{messages_per_s:.2} messages/s  {:.0} rows/s  {:.2} MB/s  interval {}  {seen}",
            mean(|seen| seen.rows) * messages_per_s,
            mean(|seen| seen.bytes) * messages_per_s * 1e-6,
            self.intervals()
        )
    }

    /// Times between messages that follow each other.
    fn intervals(&self) -> String {
        let pairs = self.seen.iter().zip(self.seen.iter().skip(1)).filter(|(a, b)| b.seq == a.seq + 1);
        let ms: Vec<f64> = pairs.map(|(a, b)| (b.sent_nanos - a.sent_nanos) as f64 * 1e-6).collect();
        if ms.is_empty() {
            return "-".to_owned();
        }
        let mean = ms.iter().sum::<f64>() / ms.len() as f64;
        let std = (ms.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / ms.len() as f64).sqrt();
        let (min, max) = ms.iter().fold((f64::INFINITY, 0.0_f64), |(min, max), x| (min.min(*x), max.max(*x)));
        format!("mean {mean:.2} min {min:.2} max {max:.2} std {std:.2} ms")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(seq: u64, ms: u64) -> Seen {
        Seen { seq, sent_nanos: ms * 1_000_000, rows: 100, bytes: 2_000_000 }
    }

    #[test]
    fn rates_count_what_went_by_unseen_and_intervals_do_not() {
        let mut window = Window::new(10);
        assert_eq!(window.line(), "no messages  seen 0  unseen 0");
        for (message, missed) in [(seen(5, 1000), 0), (seen(6, 1100), 0), (seen(7, 1300), 0), (seen(15, 2000), 7)] {
            window.add(message, missed);
        }
        assert_eq!(
            window.line(),
            "10.00 messages/s  1000 rows/s  20.00 MB/s  interval mean 150.00 min 100.00 max 200.00 std 50.00 ms  \
             seen 4  unseen 7"
        );
    }

    #[test]
    fn the_window_forgets() {
        let mut window = Window::new(1);
        (0..50).for_each(|i| window.add(seen(i, i * 1000), 0));
        assert_eq!(window.seen.len(), 2);
        assert!(window.line().starts_with("1.00 messages/s"), "{}", window.line());
    }
}
