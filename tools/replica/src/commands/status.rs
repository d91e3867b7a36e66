//! `replica status`: what the stages and topics of a running pipeline are doing.

use crate::attach::{Run, RunArgument};
use crate::figures::{ConsumerFigures, Heartbeats, RunFigures, StageFigures, TopicFigures};
use crate::terminal::StopFlag;
use stage::exit;
use stage::health::{Activity, Latency};
use std::fmt::{Display, Write as _};
use std::io::{IsTerminal, Write as _};
use std::time::Duration;

/// Over which rates are taken unless something else is asked for.
pub const SECOND: Duration = Duration::from_secs(1);

/// Shows a table of the stages and one of the topics, once or again and again.
#[derive(clap::Args, Debug)]
pub struct Args {
    #[command(flatten)]
    run: RunArgument,
    /// As JSON, one object per line.
    #[arg(long)]
    json: bool,
    /// Goes on until the run ends or Ctrl-C: in place on a terminal, block after block elsewhere.
    #[arg(long)]
    watch: bool,
    /// Time over which rates are taken, s (0.2 to 3600).
    #[arg(long, value_name = "S", default_value = "1", value_parser = seconds)]
    interval: Duration,
}

fn seconds(text: &str) -> Result<Duration, String> {
    let seconds = text.parse::<f64>().ok().filter(|seconds| (0.2..=3600.0).contains(seconds));
    seconds
        .map(|seconds| Duration::from_millis((seconds * 1000.0) as u64))
        .ok_or_else(|| "must be 0.2 to 3600".to_owned())
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let stop = StopFlag::register(exit::DONE)?;
    let mut run = args.run.find_alive()?;
    let mut shown_lines = 0;
    // Each round is an attempt of the run.
    while let Some(mut heartbeats) = Heartbeats::attach(&mut run, || stop.is_set())? {
        while heartbeats.listen(args.interval, || stop.is_set())? && run.is_alive() {
            shown_lines = show(&run, &heartbeats, args, shown_lines)?;
            if !args.watch {
                return Ok(());
            }
        }
    }
    if args.watch || stop.is_set() {
        return Ok(());
    }
    anyhow::bail!("the run in {} ended while it was looked at", run.output.display())
}

/// Prints one block; how many lines the next one has to replace.
fn show(run: &Run, heartbeats: &Heartbeats, args: &Args, shown_lines: usize) -> anyhow::Result<usize> {
    let figures = RunFigures::new(run, heartbeats.beats());
    let mut stdout = std::io::stdout().lock();
    if args.json {
        writeln!(stdout, "{}", serde_json::to_string(&figures)?)?;
        stdout.flush()?;
        return Ok(0);
    }
    let text = block(&figures);
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

fn block(figures: &RunFigures) -> String {
    let mut text = format!(
        "{}  supervisor {}  started anew {}  shared memory {} MB\n",
        figures.run.display(),
        figures.supervisor,
        figures.started_anew,
        millions(figures.shared_memory_bytes as f64)
    );
    let durations = "p50/p99/max ms";
    // Writing to a string cannot fail.
    let _ = writeln!(
        text,
        "\n{:<16} {:<22} {:>7} {:>9} {:>6} {:>24} {:>24} {:>5} {:>7}",
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
    for stage in &figures.stages {
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
    for topic in &figures.topics {
        topic_row(&mut text, topic);
    }
    text
}

fn stage_row(text: &mut String, stage: &StageFigures) {
    let _ = writeln!(
        text,
        "{:<16} {:<22} {:>7} {:>9} {:>6} {:>24} {:>24} {:>5} {:>7}",
        stage.name,
        stage.activity.as_ref().map_or("no heartbeat".to_owned(), state),
        or_dash(stage.ticks_per_s.map(|rate| format!("{rate:.1}"))),
        or_dash(stage.points_per_s.map(|rate| format!("{rate:.0}"))),
        or_dash(stage.lag_s.map(|lag| format!("{lag:.1}"))),
        or_dash(stage.step.as_ref().map(durations)),
        or_dash(stage.age.as_ref().map(durations)),
        or_dash(stage.cpu_percent.map(|percent| format!("{percent:.0}"))),
        or_dash(stage.rss_bytes.map(|bytes| format!("{:.0}", bytes as f64 * 1e-6)))
    );
}

fn topic_row(text: &mut String, topic: &TopicFigures) {
    let latency_of = |consumer: &&ConsumerFigures| consumer.latency.map_or(0.0, |latency| latency.p50_ms);
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

/// Millions with two digits: MB of bytes.
pub fn millions(value: f64) -> String {
    format!("{:.2}", value * 1e-6)
}

/// What nothing is known of is a dash.
pub fn or_dash(value: Option<impl Display>) -> String {
    value.map_or("-".to_owned(), |value| value.to_string())
}

fn durations(latency: &Latency) -> String {
    if latency.count == 0 {
        return "-".to_owned();
    }
    format!("{:.1}/{:.1}/{:.1}", latency.p50_ms, latency.p99_ms, latency.max_ms)
}

/// The activity's name, and the topic that it is about.
fn state(activity: &Activity) -> String {
    let value = serde_json::to_value(activity).unwrap_or_default();
    let kind = value["kind"].as_str().unwrap_or("?").to_owned();
    match value["on"].as_str() {
        Some(topic) if !topic.is_empty() => format!("{kind} ({topic})"),
        _ => kind,
    }
}
