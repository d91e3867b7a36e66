//! `replica echo`: the messages of a topic, decoded by its byte table.

mod message_text;

use super::attach::{RunArgument, TopicEvent, TopicReader};
use command_line::say_error;
use command_line::terminal::StopFlag;
use command_line::usage_error::UsageError;
use ipc::ObserverMode;
use message_text::{Format, MessageText};
use run::exit;
use std::io::{BufWriter, Write};

/// Print the messages of a topic of a running pipeline.
///
/// Prints the envelope, the header and the first rows of each message as it arrives. Without --lossless, messages that arrive
/// faster than they are printed are missed and counted.
#[derive(clap::Args, Debug)]
#[command(after_help = "Exit codes: 0 done, 1 no such run, 2 wrong usage or no such topic or field\n\n\
                  Example: replica echo submap --count 1")]
pub struct Args {
    /// Name of the topic; `replica topics` lists them
    topic: String,
    #[command(flatten)]
    run: RunArgument,
    /// Rows to print of each message
    #[arg(long, value_name = "N", default_value_t = 10)]
    rows: usize,
    /// Messages to print [default: until the run ends or Ctrl-C]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    count: Option<u64>,
    /// Fields of header and rows to print [default: all]
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    fields: Vec<String>,
    /// Receive every message from the first one on, with back-pressure: a slow reader of the output slows the run, a stopped
    /// reader stops it
    #[arg(long)]
    lossless: bool,
    /// Print JSON, one object per message and line; numbers that are not finite become null
    #[arg(long, conflicts_with = "csv")]
    json: bool,
    /// Print CSV, one line per row: seq, stamp, tick, row, then the row's fields; headers are left out
    #[arg(long)]
    csv: bool,
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let stop = StopFlag::register(exit::DONE)?;
    let run = args.run.find_alive()?;
    let format = match (args.json, args.csv) {
        (true, _) => Format::Json,
        (_, true) => Format::Csv,
        _ => Format::Text,
    };
    let table = run.topic(&args.topic)?.table.clone();
    let message_text = MessageText::new(table, &args.fields, args.rows, format)
        .map_err(|error| UsageError(format!("--fields: {error}")))?;
    let mode = if args.lossless { ObserverMode::Lossless } else { ObserverMode::Dropping };
    let Some(mut reader) = TopicReader::open(run, &args.topic, mode, stop)? else { return Ok(()) };
    let mut stdout = BufWriter::new(std::io::stdout().lock());
    stdout.write_all(message_text.title().as_bytes())?;
    let mut n_printed = 0;
    let mut n_missed = 0;
    while args.count.is_none_or(|count| n_printed < count) {
        match reader.next(None)? {
            Some(TopicEvent::Message(message, missed)) => {
                n_printed += 1;
                n_missed += missed;
                stdout.write_all(message_text.format(&message, missed)?.as_bytes())?;
                // A reader of a pipe gets each message as it arrives.
                stdout.flush()?;
            }
            Some(TopicEvent::Restarted(attempt)) => {
                say_error!("restart {attempt}: the run continues from its last barrier");
            }
            Some(TopicEvent::Ended) => break,
            None => {}
        }
    }
    say_error!("{n_printed} messages printed, {n_missed} missed");
    Ok(())
}
