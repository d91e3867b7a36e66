//! `replica hz`: rate and intervals of the messages of a topic.

use super::attach::{RunArgument, TopicEvent, TopicReader};
use command_line::answer::Answer;
use command_line::say_error;
use command_line::terminal::StopFlag;
use ipc::{Observed, ObserverMode};
use run::exit;
use serde::Serialize;
use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// Interval between lines: more per second would be unreadable.
const LINE_INTERVAL: Duration = Duration::from_secs(1);

/// Show the message rate of a topic, one line per second.
///
/// Runs until the run ends or Ctrl-C. Missed messages count towards the rate. They do not count towards the intervals, which are
/// between the times of publication of consecutive messages.
#[derive(clap::Args, Debug)]
#[command(after_help = "Exit codes: 0 done, 1 no such run, 2 wrong usage\n\n\
                  Example: replica hz submap")]
pub struct Args {
    /// Name of the topic; `replica topics` lists them
    topic: String,
    #[command(flatten)]
    run: RunArgument,
    /// Time that rate and intervals are averaged over, s (1 to 3600)
    #[arg(long, value_name = "S", default_value_t = 10, value_parser = clap::value_parser!(u64).range(1..=3600))]
    window: u64,
    #[command(flatten)]
    answer: Answer,
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
                say_error!("restart {attempt}: the run continues from its last barrier");
                window.messages.clear();
            }
            Some(TopicEvent::Ended) => break,
            None => {}
        }
        if Instant::now() >= next_line {
            next_line += LINE_INTERVAL;
            print(args, &window)?;
        }
    }
    print(args, &window)
}

fn print(args: &Args, window: &Window) -> anyhow::Result<()> {
    let rates = window.rates();
    args.answer.print_line(&rates, || rates.line())
}

/// Rates and intervals of a window. `None`: too few messages.
#[derive(Serialize)]
struct Rates {
    messages_per_s: Option<f64>,
    rows_per_s: Option<f64>,
    bytes_per_s: Option<f64>,
    interval_ms: Option<Intervals>,
    /// Messages of the window.
    #[serde(skip)]
    n_in_window: usize,
    /// Messages received since the start of the command.
    received: u64,
    missed: u64,
}

/// Times between consecutive messages, ms.
#[derive(Serialize)]
struct Intervals {
    mean: f64,
    min: f64,
    max: f64,
    deviation: f64,
}

impl Rates {
    fn line(&self) -> String {
        let counts = format!("received {}  missed {}", self.received, self.missed);
        let (Some(messages), Some(rows), Some(bytes)) = (self.messages_per_s, self.rows_per_s, self.bytes_per_s) else {
            return format!("{}  {counts}", if self.n_in_window == 0 { "no messages" } else { "one message" });
        };
        let intervals = self.interval_ms.as_ref().map_or("-".to_owned(), |Intervals { mean, min, max, deviation }| {
            format!("mean {mean:.2} min {min:.2} max {max:.2} std {deviation:.2} ms")
        });
        let mb = bytes * 1e-6;
        format!("{messages:.2} messages/s  {rows:.0} rows/s  {mb:.2} MB/s  interval {intervals}  {counts}")
    }
}

/// The properties of a message that rates and intervals need.
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

    /// Missed messages count towards the rates like received ones.
    fn rates(&self) -> Rates {
        let mut rates = Rates {
            messages_per_s: None,
            rows_per_s: None,
            bytes_per_s: None,
            interval_ms: self.intervals(),
            n_in_window: self.messages.len(),
            received: self.n_received,
            missed: self.n_missed,
        };
        let (Some(first), Some(last)) = (self.messages.front(), self.messages.back()) else { return rates };
        let seconds = last.sent_nanos.saturating_sub(first.sent_nanos) as f64 * 1e-9;
        if seconds > 0.0 {
            let messages_per_s = (last.seq - first.seq) as f64 / seconds;
            let per_s = |count: fn(&Received) -> u64| {
                let n = self.messages.iter().skip(1).map(count).sum::<u64>();
                n as f64 / (self.messages.len() - 1) as f64 * messages_per_s
            };
            rates.messages_per_s = Some(messages_per_s);
            rates.rows_per_s = Some(per_s(|message| message.rows));
            rates.bytes_per_s = Some(per_s(|message| message.bytes));
        }
        rates
    }

    /// Times between consecutive messages.
    fn intervals(&self) -> Option<Intervals> {
        let pairs = self.messages.iter().zip(self.messages.iter().skip(1)).filter(|(a, b)| b.seq == a.seq + 1);
        let ms: Vec<f64> = pairs.map(|(a, b)| (b.sent_nanos - a.sent_nanos) as f64 * 1e-6).collect();
        if ms.is_empty() {
            return None;
        }
        let mean = ms.iter().sum::<f64>() / ms.len() as f64;
        let deviation = (ms.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / ms.len() as f64).sqrt();
        let (min, max) = ms.iter().fold((f64::INFINITY, 0.0_f64), |(min, max), x| (min.min(*x), max.max(*x)));
        Some(Intervals { mean, min, max, deviation })
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
        assert_eq!(window.rates().line(), "no messages  received 0  missed 0");
        for (message, missed) in
            [(message(5, 1000), 0), (message(6, 1100), 0), (message(7, 1300), 0), (message(15, 2000), 7)]
        {
            window.add(message, missed);
        }
        assert_eq!(
            window.rates().line(),
            "10.00 messages/s  1000 rows/s  20.00 MB/s  interval mean 150.00 min 100.00 max 200.00 std 50.00 ms  \
             received 4  missed 7"
        );
    }

    #[test]
    fn old_messages_leave_the_window() {
        let mut window = Window::new(1);
        (0..50).for_each(|i| window.add(message(i, i * 1000), 0));
        assert_eq!(window.messages.len(), 2);
        assert!(window.rates().line().starts_with("1.00 messages/s"), "{}", window.rates().line());
    }
}
