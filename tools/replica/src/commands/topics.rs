//! `replica topics`: what travels between the stages of a run.

use crate::attach::{Run, RunArgument};
use crate::commands::status::{SECOND, millions, or_dash};
use crate::figures::{Heartbeats, TopicFigures, topics};
use crate::terminal::StopFlag;
use stage::exit;
use std::fmt::Write as _;
use std::io::Write as _;

/// Lists the topics of a run: who writes and reads them, sizes, and, if it is alive, rates over one second.
#[derive(clap::Args, Debug)]
pub struct Args {
    #[command(flatten)]
    run: RunArgument,
    /// As JSON: one object per topic, in a list.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let mut run = args.run.find()?;
    let topics = figures(&mut run)?;
    let text = if args.json { serde_json::to_string(&topics)? + "\n" } else { table(&topics) };
    Ok(std::io::stdout().write_all(text.as_bytes())?)
}

/// With rates if the run is alive.
fn figures(run: &mut Run) -> anyhow::Result<Vec<TopicFigures>> {
    let stop = StopFlag::register(exit::DONE)?;
    let heartbeats = Heartbeats::attach(run, || stop.is_set())?;
    if let Some(mut heartbeats) = heartbeats {
        heartbeats.listen(SECOND, || stop.is_set())?;
        return Ok(topics(&run.wiring, heartbeats.beats()));
    }
    Ok(topics(&run.wiring, &[]))
}

fn table(topics: &[TopicFigures]) -> String {
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
