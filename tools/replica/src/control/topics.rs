//! `replica topics`: producers, consumers, sizes and rates of the topics of a run.

use super::attach::{Run, RunArgument};
use super::metrics::{Heartbeats, TopicMetrics, topics};
use super::status::{millions, or_dash};
use command_line::terminal::StopFlag;
use run::exit;
use std::fmt::Write as _;
use std::io::Write as _;
use std::time::Duration;

/// Time that rates are averaged over.
const RATE_INTERVAL: Duration = Duration::from_secs(1);

/// List the topics of a run with producer, consumers and sizes.
///
/// If the run is alive, rates over one second are listed as well.
#[derive(clap::Args, Debug)]
#[command(after_help = "Exit codes: 0 done, 1 no such run, 2 wrong usage\n\n\
                  Example: replica topics --run out/sample")]
pub struct Args {
    #[command(flatten)]
    run: RunArgument,
    /// Print JSON: a list with one object per topic
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let mut run = args.run.find()?;
    let topics = metrics(&mut run)?;
    let text = if args.json { serde_json::to_string(&topics)? + "\n" } else { table(&topics) };
    Ok(std::io::stdout().write_all(text.as_bytes())?)
}

/// Metrics of the topics, with rates if the run is alive.
fn metrics(run: &mut Run) -> anyhow::Result<Vec<TopicMetrics>> {
    let stop = StopFlag::register(exit::DONE)?;
    let heartbeats = Heartbeats::attach(run, || stop.is_set())?;
    if let Some(mut heartbeats) = heartbeats {
        heartbeats.receive(RATE_INTERVAL, || stop.is_set())?;
        return Ok(topics(&run.wiring, heartbeats.pairs()));
    }
    Ok(topics(&run.wiring, &[]))
}

fn table(topics: &[TopicMetrics]) -> String {
    let mut text = format!(
        "{:<12} {:<16} {:>3} {:>6} {:>6} {:>9} {:>9} {:>9} {:>9}  CONSUMERS\n",
        "TOPIC", "PRODUCER", "VER", "HEADER", "ROW", "MAX ROWS", "MESSAGES", "ROWS/s", "MB/s"
    );
    for topic in topics {
        let consumers: Vec<&str> = topic.consumers.iter().map(|consumer| consumer.stage.as_str()).collect();
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{:<12} {:<16} {:>3} {:>6} {:>6} {:>9} {:>9} {:>9} {:>9}  {}",
            topic.topic,
            topic.producer,
            topic.version,
            topic.header_bytes,
            topic.row_bytes,
            topic.max_rows,
            or_dash(topic.published.as_ref().map(|published| published.messages)),
            or_dash(topic.rows_per_s.map(|rate| format!("{rate:.0}"))),
            or_dash(topic.bytes_per_s.map(millions)),
            consumers.join(", ")
        );
    }
    text
}
