//! `replica status`: state, rates and latencies of the stages and topics of a running pipeline.

use super::attach::{Run, RunArgument};
use super::metrics::{ConsumerMetrics, Heartbeats, RunMetrics, StageMetrics, TopicMetrics};
use crate::argument::InvalidValue;
use crate::terminal::StopFlag;
use run::exit;
use run::health::{Activity, Latency};
use std::fmt::{Display, Write as _};
use std::io::{IsTerminal, Write as _};
use std::time::Duration;

/// Show state, rates and latencies of the stages and topics of a run.
#[derive(clap::Args, Debug)]
#[command(after_help = "Exit codes: 0 done, 1 no such run or it ended, 2 wrong usage")]
pub struct Args {
    #[command(flatten)]
    run: RunArgument,
    /// Print JSON, one object per line
    #[arg(long)]
    json: bool,
    /// Repeat until the run ends or Ctrl-C: on a terminal in place, elsewhere one block after the other
    #[arg(long)]
    watch: bool,
    /// Time that rates are averaged over, s (0.2 to 3600)
    #[arg(long, value_name = "S", default_value = "1", value_parser = seconds)]
    interval: Duration,
}

fn seconds(text: &str) -> Result<Duration, InvalidValue> {
    let seconds = text.parse::<f64>().ok().filter(|seconds| (0.2..=3600.0).contains(seconds));
    seconds.map(|seconds| Duration::from_millis((seconds * 1000.0) as u64)).ok_or(InvalidValue("0.2 to 3600"))
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let stop = StopFlag::register(exit::DONE)?;
    let mut run = args.run.find_alive()?;
    let mut shown_lines = 0;
    // One iteration per attempt of the run.
    while let Some(mut heartbeats) = Heartbeats::attach(&mut run, || stop.is_set())? {
        while heartbeats.receive(args.interval, || stop.is_set())? && run.is_alive() {
            shown_lines = show(&run, &heartbeats, args, shown_lines)?;
            if !args.watch {
                return Ok(());
            }
        }
    }
    if args.watch || stop.is_set() {
        return Ok(());
    }
    anyhow::bail!("the run in {} ended before its state was known", run.output.display())
}

/// Prints one block. Returns the number of lines that the next block replaces.
fn show(run: &Run, heartbeats: &Heartbeats, args: &Args, shown_lines: usize) -> anyhow::Result<usize> {
    let metrics = RunMetrics::new(run, heartbeats.pairs());
    let mut stdout = std::io::stdout().lock();
    if args.json {
        writeln!(stdout, "{}", serde_json::to_string(&metrics)?)?;
        stdout.flush()?;
        return Ok(0);
    }
    let text = block(&metrics);
    let in_place = args.watch && stdout.is_terminal();
    if in_place && shown_lines > 0 {
        // Up by the last block's height, then clear to the end of the screen.
        write!(stdout, "\x1b[{shown_lines}A\x1b[J")?;
    }
    stdout.write_all(text.as_bytes())?;
    if args.watch && !in_place {
        writeln!(stdout)?;
    }
    stdout.flush()?;
    Ok(text.lines().count())
}

fn block(metrics: &RunMetrics) -> String {
    let mut text = format!(
        "{}  supervisor {}  restarts {}  shared memory {} MB\n",
        metrics.run.display(),
        metrics.supervisor,
        metrics.started_anew,
        millions(metrics.shared_memory_bytes as f64)
    );
    let durations = "p50/p99/max ms";
    // Writing to a string cannot fail.
    let _ = writeln!(
        text,
        "\n{:<16} {:<28} {:>7} {:>9} {:>6} {:>24} {:>24} {:>5} {:>7}",
        "STAGE",
        "STATE",
        "TICKS/s",
        "POINTS/s",
        "LAG s",
        format!("STEP {durations}"),
        format!("AGE {durations}"),
        "CPU %",
        "RSS MB"
    );
    for stage in &metrics.stages {
        stage_row(&mut text, stage);
    }
    let _ = writeln!(
        text,
        "\n{:<12} {:>8} {:>9} {:>9} {:>7} {:>5} {:>26}  SLOWEST CONSUMER",
        "TOPIC",
        "MSG/s",
        "ROWS/s",
        "MB/s",
        "WAITING",
        "QUEUE",
        format!("LATENCY {durations}")
    );
    for topic in &metrics.topics {
        topic_row(&mut text, topic);
    }
    text
}

fn stage_row(text: &mut String, stage: &StageMetrics) {
    let _ = writeln!(
        text,
        "{:<16} {:<28} {:>7} {:>9} {:>6} {:>24} {:>24} {:>5} {:>7}",
        stage.name,
        stage.activity.as_ref().map_or_else(|| "no heartbeat".to_owned(), Activity::to_string),
        or_dash(stage.ticks_per_s.map(|rate| format!("{rate:.1}"))),
        or_dash(stage.points_per_s.map(|rate| format!("{rate:.0}"))),
        or_dash(stage.lag_s.map(|lag| format!("{lag:.1}"))),
        or_dash(stage.step.as_ref().map(durations)),
        or_dash(stage.age.as_ref().map(durations)),
        or_dash(stage.cpu_percent.map(|percent| format!("{percent:.0}"))),
        or_dash(stage.rss_bytes.map(|bytes| format!("{:.0}", bytes as f64 * 1e-6)))
    );
}

fn topic_row(text: &mut String, topic: &TopicMetrics) {
    let latency_of = |consumer: &&ConsumerMetrics| consumer.latency.map_or(0.0, |latency| latency.p50_ms);
    let slowest = topic.consumers.iter().max_by(|a, b| latency_of(a).total_cmp(&latency_of(b)));
    let queue = topic.consumers.iter().filter_map(|consumer| consumer.queue).max();
    let _ = writeln!(
        text,
        "{:<12} {:>8} {:>9} {:>9} {:>7} {:>5} {:>26}  {}",
        topic.topic,
        or_dash(topic.messages_per_s.map(|rate| format!("{rate:.1}"))),
        or_dash(topic.rows_per_s.map(|rate| format!("{rate:.0}"))),
        or_dash(topic.bytes_per_s.map(millions)),
        or_dash(topic.waiting),
        or_dash(queue),
        or_dash(slowest.and_then(|slowest| slowest.latency.as_ref()).map(durations)),
        slowest.map_or("-", |slowest| slowest.stage.as_str())
    );
}

/// In millions, with two decimals: MB if the value is in bytes.
pub fn millions(value: f64) -> String {
    format!("{:.2}", value * 1e-6)
}

/// A dash if the value is unknown.
pub fn or_dash(value: Option<impl Display>) -> String {
    value.map_or("-".to_owned(), |value| value.to_string())
}

fn durations(latency: &Latency) -> String {
    if latency.count == 0 {
        return "-".to_owned();
    }
    format!("{:.1}/{:.1}/{:.1}", latency.p50_ms, latency.p99_ms, latency.max_ms)
}
