//! `replica hz`: rate and intervals of the messages of a topic.

use super::attach::{RunArgument, TopicEvent, TopicReader};
use crate::terminal::StopFlag;
use ipc::{Observed, ObserverMode};
use run::exit;
use std::collections::VecDeque;
use std::io::Write;
use std::time::{Duration, Instant};

/// More lines per second could not be read.
const LINE_INTERVAL: Duration = Duration::from_secs(1);

/// Show the message rate of a topic, one line per second.
///
/// Runs until the run ends or Ctrl-C. Missed messages count towards the rate. They do not count towards the intervals, which are
/// between the times of publication of consecutive messages.
#[derive(clap::Args, Debug)]
#[command(after_help = "Exit codes: 0 done, 1 no such run, 2 wrong usage")]
pub struct Args {
    /// Name of the topic; `replica topics` lists them
    topic: String,
    #[command(flatten)]
    run: RunArgument,
    /// Time that rate and intervals are averaged over, s (1 to 3600)
    #[arg(long, value_name = "S", default_value_t = 10, value_parser = clap::value_parser!(u64).range(1..=3600))]
    window: u64,
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let stop = StopFlag::register(exit::DONE)?;
    let run = args.run.find_alive()?;
    let topic = run.topic(&args.topic)?.channels.topic.clone();
    let Some(mut reader) = TopicReader::open(run, &topic, ObserverMode::Dropping, stop)? else { return Ok(()) };
    let mut window = Window::new(args.window);
    let mut next_line = Instant::now() + LINE_INTERVAL;
    loop {
        match reader.next(Some(next_line))? {
            Some(TopicEvent::Message(message, missed)) => window.add(Received::new(&message), missed),
            Some(TopicEvent::Restarted(attempt)) => {
                eprintln!("restart {attempt}: the run continues from its last barrier");
                window.messages.clear();
            }
            Some(TopicEvent::Ended) => break,
            None => {}
        }
        if Instant::now() >= next_line {
            next_line += LINE_INTERVAL;
            print(&window.line())?;
        }
    }
    print(&window.line())
}

fn print(line: &str) -> anyhow::Result<()> {
    let mut stdout = std::io::stdout().lock();
    writeln!(stdout, "{line}")?;
    Ok(stdout.flush()?)
}

/// The properties of a message that count here.
#[derive(Clone, Copy)]
struct Received {
    seq: u64,
    /// Time of publication. A late poll does not change it.
    sent_nanos: u64,
    rows: u64,
    bytes: u64,
}

impl Received {
    fn new(message: &Observed) -> Self {
        let envelope = message.envelope();
        let bytes = message.rows().len() as u64;
        Self { seq: envelope.seq, sent_nanos: envelope.sent_nanos, rows: u64::from(envelope.len), bytes }
    }
}

/// The messages that were received in the last seconds.
struct Window {
    nanos: u64,
    messages: VecDeque<Received>,
    n_received: u64,
    n_missed: u64,
}

impl Window {
    fn new(seconds: u64) -> Self {
        Self { nanos: seconds * 1_000_000_000, messages: VecDeque::new(), n_received: 0, n_missed: 0 }
    }

    fn add(&mut self, message: Received, missed: u64) {
        self.n_received += 1;
        self.n_missed += missed;
        self.messages.push_back(message);
        let begin = message.sent_nanos.saturating_sub(self.nanos);
        while self.messages.front().is_some_and(|first| first.sent_nanos < begin) {
            self.messages.pop_front();
        }
    }

    /// Rates and intervals of the window. Missed messages count towards the rates like received ones.
    fn line(&self) -> String {
        let counts = format!("received {}  missed {}", self.n_received, self.n_missed);
        let (Some(first), Some(last)) = (self.messages.front(), self.messages.back()) else {
            return format!("no messages  {counts}");
        };
        let seconds = last.sent_nanos.saturating_sub(first.sent_nanos) as f64 * 1e-9;
        if seconds <= 0.0 {
            return format!("one message  {counts}");
        }
        let messages_per_s = (last.seq - first.seq) as f64 / seconds;
        let mean = |count: fn(&Received) -> u64| {
            self.messages.iter().skip(1).map(count).sum::<u64>() as f64 / (self.messages.len() - 1) as f64
        };
        format!(
            "{messages_per_s:.2} messages/s  {:.0} rows/s  {:.2} MB/s  interval {}  {counts}",
            mean(|message| message.rows) * messages_per_s,
            mean(|message| message.bytes) * messages_per_s * 1e-6,
            self.intervals()
        )
    }

    /// Times between consecutive messages.
    fn intervals(&self) -> String {
        let pairs = self.messages.iter().zip(self.messages.iter().skip(1)).filter(|(a, b)| b.seq == a.seq + 1);
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

    fn message(seq: u64, ms: u64) -> Received {
        Received { seq, sent_nanos: ms * 1_000_000, rows: 100, bytes: 2_000_000 }
    }

    #[test]
    fn missed_messages_count_towards_rates_but_not_intervals() {
        let mut window = Window::new(10);
        assert_eq!(window.line(), "no messages  received 0  missed 0");
        for (message, missed) in
            [(message(5, 1000), 0), (message(6, 1100), 0), (message(7, 1300), 0), (message(15, 2000), 7)]
        {
            window.add(message, missed);
        }
        assert_eq!(
            window.line(),
            "10.00 messages/s  1000 rows/s  20.00 MB/s  interval mean 150.00 min 100.00 max 200.00 std 50.00 ms  \
             received 4  missed 7"
        );
    }

    #[test]
    fn old_messages_leave_the_window() {
        let mut window = Window::new(1);
        (0..50).for_each(|i| window.add(message(i, i * 1000), 0));
        assert_eq!(window.messages.len(), 2);
        assert!(window.line().starts_with("1.00 messages/s"), "{}", window.line());
    }
}
