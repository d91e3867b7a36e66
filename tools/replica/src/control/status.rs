//! `replica status`: state, rates and latencies of the stages and topics of a running pipeline.

use super::attach::{Run, RunArgument};
use super::columns::{Column, Table};
use super::metrics::{ConsumerMetrics, Heartbeats, RunMetrics, StageMetrics, TopicMetrics};
use command_line::argument::InvalidValue;
use command_line::terminal::StopFlag;
use run::exit;
use run::health::{Activity, Latency};
use run::terminal::{Screen, Style};
use std::fmt::Display;
use std::io::Write as _;
use std::time::Duration;

/// Show state, rates and latencies of the stages and topics of a run.
#[derive(clap::Args, Debug)]
#[command(after_help = "Exit codes: 0 done, 1 no such run or it ended, 2 wrong usage\n\n\
                  Example: replica status --watch")]
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
    let screen = Screen::from_output(&stdout).filter(|_| args.watch);
    let text = match screen {
        Some(screen) => fitting(&block(&metrics, screen.columns), screen),
        None => block(&metrics, usize::MAX),
    };
    if screen.is_some() && shown_lines > 0 {
        // Up by the last block's height, then clear to the end of the screen.
        write!(stdout, "\x1b[{shown_lines}A\x1b[J")?;
    }
    stdout.write_all(text.as_bytes())?;
    if args.watch && screen.is_none() {
        writeln!(stdout)?;
    }
    stdout.flush()?;
    Ok(text.lines().count())
}

/// The first lines, cut to the width of the screen: a block that scrolls cannot be redrawn in place.
fn fitting(block: &str, screen: Screen) -> String {
    let lines: Vec<&str> = block.lines().collect();
    // The cursor has the last line.
    let n_fitting = screen.rows.saturating_sub(1);
    let n_shown = if lines.len() > n_fitting { n_fitting.saturating_sub(1) } else { lines.len() };
    let style = |line: &str| ["STAGE", "TOPIC"].iter().any(|heading| line.starts_with(heading)).then_some(Style::Bold);
    let mut text: String = lines[..n_shown].iter().map(|line| screen.line(line, style(line)) + "\n").collect();
    if n_shown < lines.len() {
        let more = format!("{} more lines in a larger window", lines.len() - n_shown);
        text = text + &screen.line(&more, None) + "\n";
    }
    text
}

const STAGE_COLUMNS: [Column; 9] = [
    Column { heading: "STAGE", width: 14, rank: 0 },
    Column { heading: "STATE", width: 26, rank: 0 },
    Column { heading: "TICKS/s", width: 7, rank: 1 },
    Column { heading: "POINTS/s", width: 9, rank: 4 },
    Column { heading: "LAG s", width: 5, rank: 2 },
    Column { heading: "STEP p50/p99/max ms", width: 21, rank: 5 },
    Column { heading: "AGE p50/p99/max ms", width: 24, rank: 6 },
    Column { heading: "CPU %", width: 5, rank: 1 },
    Column { heading: "RSS MB", width: 6, rank: 3 },
];

const TOPIC_COLUMNS: [Column; 8] = [
    Column { heading: "TOPIC", width: 10, rank: 0 },
    Column { heading: "SLOWEST CONSUMER", width: 16, rank: 2 },
    Column { heading: "MSG/s", width: 7, rank: 1 },
    Column { heading: "ROWS/s", width: 9, rank: 4 },
    Column { heading: "MB/s", width: 7, rank: 3 },
    Column { heading: "WAITING", width: 7, rank: 1 },
    Column { heading: "QUEUE", width: 5, rank: 2 },
    Column { heading: "LATENCY p50/p99/max ms", width: 24, rank: 5 },
];

fn block(metrics: &RunMetrics, width: usize) -> String {
    let stages = Table { columns: &STAGE_COLUMNS, n_texts: 2, rows: metrics.stages.iter().map(stage_row).collect() };
    let topics = Table { columns: &TOPIC_COLUMNS, n_texts: 2, rows: metrics.topics.iter().map(topic_row).collect() };
    format!(
        "{}  supervisor {}  restarts {}  shared memory {} MB\n{}\n{}",
        metrics.run.display(),
        metrics.supervisor,
        metrics.started_anew,
        millions(metrics.shared_memory_bytes as f64),
        stages.text(width),
        topics.text(width)
    )
}

fn stage_row(stage: &StageMetrics) -> Vec<String> {
    vec![
        stage.name.clone(),
        stage.activity.as_ref().map_or_else(|| "no heartbeat".to_owned(), Activity::to_string),
        or_dash(stage.ticks_per_s.map(|rate| format!("{rate:.1}"))),
        or_dash(stage.points_per_s.map(|rate| format!("{rate:.0}"))),
        or_dash(stage.lag_s.map(|lag| format!("{lag:.1}"))),
        or_dash(stage.step.as_ref().map(durations)),
        or_dash(stage.age.as_ref().map(durations)),
        or_dash(stage.cpu_percent.map(|percent| format!("{percent:.0}"))),
        or_dash(stage.rss_bytes.map(|bytes| format!("{:.0}", bytes as f64 * 1e-6))),
    ]
}

fn topic_row(topic: &TopicMetrics) -> Vec<String> {
    let latency_of = |consumer: &&ConsumerMetrics| consumer.latency.map_or(0.0, |latency| latency.p50_ms);
    let slowest = topic.consumers.iter().max_by(|a, b| latency_of(a).total_cmp(&latency_of(b)));
    let queue = topic.consumers.iter().filter_map(|consumer| consumer.queue).max();
    vec![
        topic.topic.clone(),
        slowest.map_or("-", |slowest| slowest.stage.as_str()).to_owned(),
        or_dash(topic.messages_per_s.map(|rate| format!("{rate:.1}"))),
        or_dash(topic.rows_per_s.map(|rate| format!("{rate:.0}"))),
        or_dash(topic.bytes_per_s.map(millions)),
        or_dash(topic.waiting),
        or_dash(queue),
        or_dash(slowest.and_then(|slowest| slowest.latency.as_ref()).map(durations)),
    ]
}

/// The value in millions, with two decimals: MB if the value is in bytes.
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
